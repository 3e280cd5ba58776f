// Two surfaces side by side on one pad: the left half is one, the right half the other; blind, nobody sees which.
import { find, imageOf, make, setText } from "./dom.js";
import { everyFrame } from "./frame.js";
import { bare, parameterOf, quoted, toneOf } from "./surfaces.js";

const BEYOND_MM = 2; // the hand has to be this far across

// `studio.compared` are the surfaces, left then right, or null; `studio.blind` hides which.
export function mountCompare(studio) {
    // `side` is the half whose surface runs, `refused` the surface that the engine rejected.
    const state = { on: false, chosen: ["", ""], swapped: false, side: null, refused: null, asked: false, turn: 0 };
    const [button, blind, tools] = ["compare", "blind", "compare-tools"].map(find);
    const choices = ["compare-a", "compare-b"].map(find);
    studio.compared = null;
    studio.blind = false;
    const show = () => {
        const { surfaces } = studio.graph;
        const pair = state.chosen.map((path) => surfaces.find((surface) => surface.path === path));
        studio.compared = state.on && pair.every(Boolean) ? (state.swapped ? pair.reverse() : pair) : null;
        studio.blind = Boolean(studio.compared) && blind.checked;
        document.body.classList.toggle("blind", studio.blind);
        tools.hidden = !state.on;
        button.setAttribute("aria-pressed", String(state.on));
        studio.emit("compared", studio.compared);
    };
    const begin = () => {
        state.swapped = blind.checked && Math.random() < 0.5;
        state.side = state.refused = null;
        state.turn++;
        show();
    };
    button.addEventListener("click", () => {
        state.on = !state.on;
        begin();
    });
    blind.addEventListener("change", begin); // who ends being blind sees which was which
    choices.forEach((choice, i) =>
        choice.addEventListener("change", () => {
            state.chosen[i] = choice.value;
            begin();
        }),
    );
    studio.on("graph", ({ surfaces }) => {
        const usable = surfaces.length > 1 && parameterOf(studio.graph) !== null;
        button.hidden = !usable;
        if (!usable) state.on = false;
        state.chosen = state.chosen.map((path, i) =>
            surfaces.some((known) => known.path === path) ? path : (surfaces[i]?.path ?? ""),
        );
        choices.forEach((choice, i) => {
            choice.replaceChildren(
                ...surfaces.map(({ path, name }) => make("option", { value: path, text: name, title: bare(path) })),
            );
            choice.value = state.chosen[i];
        });
        show();
    });
    everyFrame(() => follow(studio, state));
}

// Runs the surface of the half under the hand.
async function follow(studio, state) {
    const x_mm = studio.pad.hands.down[0]?.samples.at(-1)?.x_mm;
    if (x_mm === undefined) state.refused = null; // the next touch asks again
    if (!studio.compared || x_mm === undefined || state.asked) return;
    if (Math.abs(x_mm) < BEYOND_MM && state.side !== null) return;
    const side = x_mm < 0 ? 0 : 1;
    if (side === state.side || side === state.refused) return;
    const { turn } = state;
    state.asked = true;
    const reply = await studio.parameter(parameterOf(studio.graph).name, quoted(studio.compared[side].path));
    state.asked = false;
    if (turn !== state.turn) return; // other surfaces were chosen meanwhile
    state[reply.ok ? "side" : "refused"] = side;
    if (!reply.ok) studio.say("bad", studio.blind ? "The engine refused the surface of this half" : reply.error);
}

// Shows picture and name of the surface on each half; only a number in a blind comparison.
export function showHalves(studio, element) {
    const { compared, blind } = studio;
    element.replaceChildren(
        ...(compared ?? []).map((surface, i) => {
            const half = make("div", { class: "pad-half" });
            if (!blind) Object.assign(half.style, pictureOf(studio, surface));
            half.append(make("span", { text: blind ? String(i + 1) : surface.name }));
            return half;
        }),
    );
    if (compared) element.style.backgroundImage = "none"; // of the surface that ran before
    if (compared) setText(find("pad-surface-name"), blind ? "1 or 2?" : compared.map(({ name }) => name).join(" or "));
}

// The storage key of a surface's photograph.
export const photoName = (surface) => surface?.path ?? "";

// The picture of a surface as a background: its own photograph, else its swatch on its tone below `veil`.
export function pictureOf(studio, surface, veil = null) {
    const photo = studio.photos.get(photoName(surface));
    if (photo) return { backgroundImage: `url("${photo}")`, backgroundColor: "", backgroundBlendMode: "normal" };
    const swatch = surface?.swatch ? `url("${imageOf(surface.swatch)}")` : null;
    return {
        backgroundImage: swatch ? [veil, swatch].filter(Boolean).join(", ") : "none",
        backgroundColor: toneOf(surface),
        backgroundBlendMode: "",
    };
}
