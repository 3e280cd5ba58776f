// Tabs: of the tools on a wide page, of all that is beneath the pad on a narrow one; and the lines between the panes.
import { find, kept, make } from "./dom.js";

const TOOLS = [
    ["graph", "Graph"],
    ["editor", "Editor"],
    ["controls", "Controls"],
    ["surfaces", "Surfaces"],
];
const BELOW = [["views", "Views"], ["scopes", "Scopes"], ...TOOLS];
const STEP = 2;

export function mountTabs(studio) {
    const lists = [
        [find("tabs"), TOOLS],
        [find("phone-tabs"), BELOW],
    ];
    const show = (name) => {
        const tool = TOOLS.some(([id]) => id === name);
        if (tool) for (const panel of document.querySelectorAll(".tab-panel")) panel.hidden = panel.dataset.tab !== name;
        for (const panel of document.querySelectorAll(".side")) panel.classList.toggle("shown", panel.dataset.tab === name);
        find("tools-panel").classList.toggle("shown", tool);
        for (const [list] of lists) mark(list, name);
        kept.set("tab", name);
        studio.emit("tab", name);
    };
    for (const [list, names] of lists) fill(list, names, show);
    studio.showTab = show;
    const before = kept.get("tab", "graph");
    show(TOOLS.some(([id]) => id === before) ? before : "graph");
    if (before !== "graph" && BELOW.some(([id]) => id === before)) show(before);
    if (matchMedia("(max-width: 899px)").matches && before === "graph") show("views");
    mountExpand();
    mountGutters();
}

function fill(list, names, show) {
    const buttons = names.map(([id, text]) =>
        make("button", {
            role: "tab",
            text,
            "data-for": id,
            "aria-selected": "false",
            "aria-controls": TOOLS.some(([tool]) => tool === id) ? `${id}-tab` : `${id}-panel`,
            onclick: () => show(id),
        }),
    );
    list.replaceChildren(...buttons);
    list.addEventListener("keydown", (event) => {
        const way = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
        if (!way) return;
        event.preventDefault();
        const at = buttons.indexOf(document.activeElement);
        const next = buttons[(at + way + buttons.length) % buttons.length];
        show(next.dataset.for);
        next.focus();
    });
}

function mark(list, name) {
    const buttons = [...list.children];
    if (!buttons.some((button) => button.dataset.for === name)) return;
    for (const button of buttons) {
        const chosen = button.dataset.for === name;
        button.setAttribute("aria-selected", String(chosen));
        button.tabIndex = chosen ? 0 : -1;
    }
}

function mountExpand() {
    const button = find("expand");
    const sizes = ["", "widened", "whole"];
    let size = 0;
    button.addEventListener("click", () => {
        size = (size + 1) % sizes.length;
        for (const name of sizes.slice(1)) find("main").classList.toggle(name, name === sizes[size]);
        button.setAttribute("aria-pressed", String(size > 0));
        button.textContent = ["Widen", "Fill", "Narrow"][size];
    });
}

// The lines between the panes are dragged, or moved by the arrow keys.
function mountGutters() {
    const main = find("main");
    const sizes = { column: 54, row: 60, ...kept.get("panes", {}) };
    const set = (name, percent) => {
        sizes[name] = Math.max(20, Math.min(80, percent));
        main.style.setProperty(`--${name}`, `${sizes[name]}%`);
        for (const gutter of document.querySelectorAll(`.gutter[data-of="${name}"]`))
            gutter.setAttribute("aria-valuenow", String(Math.round(sizes[name])));
    };
    for (const name of ["column", "row"]) set(name, sizes[name]);
    for (const gutter of document.querySelectorAll(".gutter")) {
        const name = gutter.dataset.of;
        gutter.addEventListener("pointerdown", (event) => gutter.setPointerCapture(event.pointerId));
        gutter.addEventListener("pointermove", (event) => {
            if (!gutter.hasPointerCapture(event.pointerId)) return;
            const box = main.getBoundingClientRect();
            set(
                name,
                name === "column"
                    ? (100 * (event.clientX - box.left)) / box.width
                    : (100 * (event.clientY - box.top)) / box.height,
            );
        });
        gutter.addEventListener("pointerup", () => kept.set("panes", sizes));
        gutter.addEventListener("keydown", (event) => {
            const way = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 }[event.key];
            if (!way) return;
            event.preventDefault();
            set(name, sizes[name] + way * STEP);
            kept.set("panes", sizes);
        });
    }
}
