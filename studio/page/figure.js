// What a view or a scope shows, as a figure: SVG to be edited and printed, PNG to be shown.
import { make, save } from "./dom.js";
import { colours, FONT } from "./theme.js";

const PNG_SCALE = 3; // its pixels for one of the page's
const MAKERS = { svg: svgOf, png: pngOf };

// A menu that saves what `shown` returns: { name, surfaces, draw }; `draw` paints the surfaces, one over the other.
export function figureMenu(studio, shown) {
    const forms = Object.keys(MAKERS).map((form) => make("option", { value: form, text: form.toUpperCase() }));
    const menu = make("select", { class: "quiet figure-menu", "aria-label": "Save as a figure", title: "Save as a figure" }, make("option", { value: "", text: "Save" }), ...forms);
    menu.addEventListener("change", () => {
        const form = menu.value;
        menu.selectedIndex = 0;
        saveFigure(shown(), form).catch((error) => studio.say("bad", `The figure was not saved: ${error.message}`));
    });
    return menu;
}

// Draws once more, on another context.
async function saveFigure({ name, surfaces, draw }, form) {
    const [{ width, height }] = surfaces;
    const { context, blob } = await MAKERS[form](width, height);
    context.fillStyle = colours.box;
    context.fillRect(0, 0, width, height);
    context.font = FONT;
    try {
        for (const surface of surfaces) surface.figure = context;
        draw();
    } finally {
        for (const surface of surfaces) surface.figure = null;
        draw();
    }
    save(`${name.replace(/[^\p{L}\p{N}._-]+/gu, "-")}.${form}`, await blob());
}

async function svgOf(width, height) {
    const { Context } = await import("./vendor/svgcanvas.js");
    const context = new Context({ width, height });
    return { context, blob: () => new Blob([context.getSerializedSvg(true)], { type: "image/svg+xml" }) };
}

async function pngOf(width, height) {
    const canvas = make("canvas", { width: Math.round(PNG_SCALE * width), height: Math.round(PNG_SCALE * height) });
    const context = canvas.getContext("2d");
    context.scale(PNG_SCALE, PNG_SCALE);
    return { context, blob: () => new Promise((done) => canvas.toBlob(done, "image/png")) };
}
