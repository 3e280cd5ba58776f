// The views of a graph: the plots that it names, the map of a texture, the object that a hand touches; as many at once as
// there is room for.
import { candidates } from "./choices.js";
import { find, kept, make, setText } from "./dom.js";
import { plotView } from "./draw-plot.js";
import { figureMenu } from "./figure.js";
import { mapView } from "./map.js";
import { objectView } from "./object.js";

const LEAST_WIDTH = 250; // px of a view beside another
const LEAST_HEIGHT = 165;
const MOST_A_SIDE = 2;
const MOST_MOVING = 3; // signals of the view of what moves
const PAINTERS = { map: mapView, object: objectView, time: plotView, xy: plotView, path: plotView };

// What can be seen of a graph: [{ id, title, form, ... }], the most telling first.
export function viewsOf({ maps, pads, plots, contacts, ports, actuators }) {
    const named = (title, others, name) => (others.length > 1 ? `${title}: ${name}` : title);
    const touched = pads.filter(({ scene }) => scene?.shapes.length);
    const views = [
        ...maps.map((map) => ({ id: `map ${map.node}`, title: named("Map", maps, map.node), form: "map", map })),
        ...touched.map((pad) => {
            const title = named("Object", touched, pad.endpoint);
            return { id: `object ${pad.endpoint}`, title, form: "object", pad, contact: contacts[0], ports, actuators };
        }),
        ...plots.map((plot) => ({ id: `plot ${plot.name}`, title: plot.name, form: plot.form, signals: plot.signals })),
    ];
    // With neither a plot nor another view, what moves.
    return views.length ? views : [{ id: "moves", title: "What moves", form: "moves" }];
}

// The plot of what moves in a graph that names none, and why each signal is in it.
function movingView(studio, view) {
    const { graph, motion } = studio;
    const found = candidates(graph)
        .filter(({ name }) => motion.moves(name))
        .slice(0, MOST_MOVING);
    const signals = found.map(({ name }) => ({ ...graph.ports.find((port) => port.name === name), label: name }));
    const why = found.map(({ name, why }) => `${name} (${why})`).join(", ");
    return { ...view, form: "time", signals, why: why && `The graph names no plot. Shown: ${why}` };
}

export function mountViews(studio) {
    const state = { cells: [], views: [], graph: null, wanted: [], isOne: kept.get("views.one", false) };
    const title = "Show one view, or as many as there is room for";
    state.one = make("button", { class: "quiet", text: "One", title, "aria-pressed": String(state.isOne) });
    state.one.addEventListener("click", () => {
        kept.set("views.one", (state.isOne = !state.isOne));
        state.one.setAttribute("aria-pressed", String(state.isOne));
        layOut(studio, state);
    });
    studio.on("graph", (graph) => {
        if (graph.name !== state.graph?.name) state.wanted = kept.get(`views.${graph.name}`, []);
        [state.graph, state.views] = [graph, viewsOf(graph)];
        for (const cell of state.cells) cell.view = null;
        layOut(studio, state);
    });
    studio.on("moved", () => {
        for (const cell of state.cells) if (cell.view?.id === "moves") follow(studio, cell);
    });
    studio.shownViews = () => state.cells.map(({ view, painter }) => ({ id: view.id, form: view.form, moves: painter.moves() }));
    new ResizeObserver(() => layOut(studio, state)).observe(find("views"));
}

// How many views there is room for.
export function roomFor(width, height, count, isOne) {
    const side = (pixels, least) => Math.max(1, Math.min(MOST_A_SIDE, Math.floor(pixels / least)));
    return Math.min(isOne ? 1 : side(width, LEAST_WIDTH) * side(height, LEAST_HEIGHT), count);
}

// The views in the cells: the wanted ones, then others in their order.
export function shownOf(views, wanted, count) {
    const known = wanted.map((id) => views.find((view) => view.id === id)).filter(Boolean);
    return [...known, ...views.filter((view) => !known.includes(view))].slice(0, count);
}

function layOut(studio, state) {
    const host = find("views");
    const { clientWidth: width, clientHeight: height } = host;
    if (!state.graph || width === 0) return;
    const count = roomFor(width, height, state.views.length, state.isOne);
    while (state.cells.length > count) {
        const cell = state.cells.pop();
        cell.painter?.end();
        cell.element.remove();
    }
    while (state.cells.length < count) state.cells.push(cellOf(studio, state, state.cells.length));
    host.dataset.count = String(count);
    host.classList.toggle("wide-views", width >= MOST_A_SIDE * LEAST_WIDTH);
    state.one.hidden = state.views.length < 2 || roomFor(width, height, state.views.length, false) < 2;
    shownOf(state.views, state.wanted, count).forEach((view, place) => show(studio, state, place, view));
}

function cellOf(studio, state, place) {
    const choice = make("select", { class: "view-choice", "aria-label": `View ${place + 1}` });
    const text = make("span", { class: "view-text figure-text soft clip" });
    const fill = make("div", { class: "fill" });
    const cell = { choice, text, fill, view: null, painter: null };
    const figure = figureMenu(studio, () => ({ name: `${state.graph.name}-${cell.view.title}`, ...cell.painter.picture }));
    const bar = make("div", { class: "view-bar" }, choice, text, figure, place === 0 ? state.one : null);
    cell.element = make("article", { class: "view" }, bar, fill);
    find("views").append(cell.element);
    choice.addEventListener("change", () => choose(studio, state, place, choice.value));
    return cell;
}

// A person chose a view; the one that it replaces goes where it was.
function choose(studio, state, place, id) {
    const shown = state.cells.map(({ view }) => view.id);
    const other = shown.indexOf(id);
    if (other >= 0) shown[other] = shown[place];
    shown[place] = id;
    state.wanted = [...shown, ...state.wanted.filter((each) => !shown.includes(each))];
    kept.set(`views.${state.graph.name}`, state.wanted);
    layOut(studio, state);
}

function show(studio, state, place, view) {
    const cell = state.cells[place];
    const ids = state.views.map(({ id }) => id).join("\n");
    if (cell.ids !== ids) {
        cell.ids = ids;
        cell.choice.replaceChildren(...state.views.map(({ id, title }) => make("option", { value: id, text: title })));
        cell.choice.disabled = state.views.length < 2;
    }
    cell.choice.value = view.id;
    if (cell.view === view) return;
    cell.view = view;
    cell.shown = null;
    if (view.id === "moves") follow(studio, cell);
    else paint(studio, cell, view);
}

function follow(studio, cell) {
    const view = movingView(studio, cell.view);
    const shown = view.signals.map(({ name }) => name).join("\n");
    if (cell.shown === shown && cell.painter) return;
    cell.shown = shown;
    paint(studio, cell, view);
}

// The new view takes its streams before the old one releases them, so that those which both show go on.
function paint(studio, cell, view) {
    const before = cell.painter;
    const fill = make("div", { class: "fill" });
    cell.fill.replaceWith(fill);
    cell.fill = fill;
    cell.element.dataset.form = view.form;
    const say = (text) => setText(cell.text, text);
    cell.text.title = view.why ?? "";
    say(view.why ?? "");
    cell.painter = PAINTERS[view.form](studio, { fill, say }, view);
    before?.end();
}
