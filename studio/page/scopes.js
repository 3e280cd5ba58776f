// Scopes: any port over time, as a spectrum, a spectrogram, a meter or a number.
import { firstScopes, replacements } from "./choices.js";
import { find, kept, make, setText } from "./dom.js";
import { drawMeter, drawNumber } from "./draw-meter.js";
import { drawSpectrogram, drawSpectrum } from "./draw-spectrum.js";
import { boxOf, drawTime } from "./draw-time.js";
import { figureMenu } from "./figure.js";
import { mostFrames } from "./frame.js";
import { colours, Surface } from "./theme.js";

const SPANS_S = [0.05, 0.2, 0.5, 1, 2, 5, 10, 20];
const LAG_S = 0.04; // the right edge stands this much behind, so that it does not flicker
const SPECTRAL = new Set(["spectrum", "spectrogram"]);
const VIEWS = { time: drawTime, spectrum: drawSpectrum, spectrogram: drawSpectrogram, meter: drawMeter, number: drawNumber };
const SPECTRAL_FROM_HZ = 200;
const STILL_MS = 3000;

export function mountScopes(studio) {
    // `paused` is the state at the pause: { end_s, kept_s, back_s, now_ms, actuators, traces }, copies by the traces
    // that go on; `back_s` is the time from the end of the scopes to its end.
    const state = { cards: [], span_s: kept.get("span", 2), paused: null, graph: null };
    mountBar(studio, state);
    studio.on("graph", (graph) => follow(studio, state, graph));
    followMotion(studio, state);
    studio.scopeWindow = () => ({ span_s: state.span_s, isPaused: state.paused !== null });
    studio.addScope = (name, view = "time") => add(studio, state, name, view);
    studio.scopeCount = () => state.cards.length;
}

function mountBar(studio, state) {
    const span = find("scope-span");
    span.replaceChildren(...SPANS_S.map((s) => make("option", { value: String(s), text: s < 1 ? `${s * 1000} ms` : `${s} s` })));
    span.value = String(state.span_s);
    span.addEventListener("change", () => {
        kept.set("span", (state.span_s = Number(span.value)));
        if (state.paused) goBack(state, state.paused.back_s);
    });
    find("scope-pause").addEventListener("click", () => setPaused(studio, state, state.paused === null));
    find("scope-back").addEventListener("input", ({ target }) => goBack(state, (1 - target.value) * mostBack(state)));
    const list = find("scope-add");
    list.addEventListener("change", () => {
        if (list.value) add(studio, state, list.value, "time");
        list.selectedIndex = 0;
    });
}

// A pause freezes the scopes; zoom, span, view and going back act on the data kept at that moment.
function setPaused(studio, state, on) {
    state.paused = on
        ? {
              end_s: studio.taps.now_s() - LAG_S,
              kept_s: Math.max(0, ...studio.taps.traces.map(({ count, interval_s }) => count * interval_s)),
              back_s: 0,
              now_ms: performance.now(),
              actuators: studio.status?.actuators ?? [],
              traces: new Map(studio.taps.traces.map((trace) => [trace, trace.copy()])),
          }
        : null;
    find("scope-pause").setAttribute("aria-pressed", String(on));
    setText(find("scope-pause"), on ? "Go on" : "Pause");
    find("scope-back").disabled = !on;
    find("scope-back").value = 1;
}

const mostBack = ({ paused, span_s }) => Math.max(0, paused.kept_s - span_s);

function goBack(state, back_s) {
    const most_s = mostBack(state);
    state.paused.back_s = Math.max(0, Math.min(most_s, back_s));
    find("scope-back").value = most_s > 0 ? 1 - state.paused.back_s / most_s : 1;
}

// Over time, a paused scope is dragged.
function mountDrag(state, card, canvas) {
    let from = null; // { x, back_s } of the press
    canvas.addEventListener("pointerdown", ({ pointerId, clientX }) => {
        if (!state.paused || card.view !== "time") return;
        canvas.setPointerCapture(pointerId);
        from = { x: clientX, back_s: state.paused.back_s };
    });
    canvas.addEventListener("pointermove", ({ clientX }) => {
        if (!from || !state.paused) return;
        goBack(state, from.back_s + ((clientX - from.x) / boxOf(card.surface).width) * state.span_s);
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => (from = null));
}

// Another graph: cards whose ports are still there stay, the list is made anew.
function follow(studio, state, graph) {
    const list = find("scope-add");
    const nodes = Map.groupBy ? Map.groupBy(graph.ports, (port) => port.node) : group(graph.ports);
    list.replaceChildren(
        make("option", { value: "", text: "Add a port…" }),
        ...[...nodes].map(([node, ports]) =>
            make("optgroup", { label: node }, ...ports.map((port) => make("option", { value: port.name, text: port.name }))),
        ),
    );
    const same = state.graph?.name === graph.name;
    state.graph = graph;
    const wanted = same
        ? state.cards
        : (kept.get(`scopes.${graph.name}`, null) ?? firstScopes(graph).map((scope) => ({ ...scope, isAutomatic: true })));
    const there = (name) => graph.ports.some((port) => port.name === name);
    if (same && state.cards.every((card) => there(card.name))) {
        for (const card of state.cards) card.port = graph.ports.find((port) => port.name === card.name);
        return;
    }
    setPaused(studio, state, false);
    for (const card of [...state.cards]) remove(studio, state, card, false);
    for (const { name, view, isAutomatic } of wanted)
        if (there(name)) add(studio, state, name, view, isAutomatic ?? false, false);
    showEmpty(state);
}

function group(ports) {
    const nodes = new Map();
    for (const port of ports) nodes.set(port.node, [...(nodes.get(port.node) ?? []), port]);
    return nodes;
}

function add(studio, state, name, view, isAutomatic = false, keep = true) {
    const port = state.graph?.ports.find((each) => each.name === name);
    if (!port) return;
    const card = { name, port, view, isAutomatic, memory: {}, zoom: 1, trace: null };
    card.trace = studio.taps.watch(name, SPECTRAL.has(view));
    if (!card.trace) return studio.say("warn", "At most sixteen ports can be shown: remove a scope first.");
    const canvas = make("canvas", { role: "img", "aria-label": `${name} as ${view}` });
    card.element = make(
        "article",
        { class: "scope", "aria-label": name },
        barOf(studio, state, card),
        make("div", { class: "fill" }, canvas),
    );
    find("scopes").append(card.element);
    card.surface = new Surface(canvas);
    mountDrag(state, card, canvas);
    state.cards.push(card);
    card.end = mostFrames((now_ms) => drawCard(studio, state, card, now_ms));
    showEmpty(state);
    if (keep) remember(state);
}

function barOf(studio, state, card) {
    const views = card.port.rate_hz >= SPECTRAL_FROM_HZ ? Object.keys(VIEWS) : ["time", "meter", "number"];
    const choice = make(
        "select",
        { "aria-label": `View of ${card.name}` },
        ...views.map((view) => make("option", { text: view })),
    );
    choice.value = card.view;
    choice.addEventListener("change", () => setView(studio, state, card, choice.value));
    const zoom = (factor) => () => (card.zoom = Math.max(1 / 64, Math.min(64, card.zoom * factor)));
    const name = make("span", {
        class: "scope-name clip",
        text: card.name,
        title: `${card.name}: ${card.port.quantity}, ${card.port.rate_hz} Hz${card.port.driver ? `, by ${card.port.driver}` : ""}`,
    });
    name.style.setProperty("--curve", "var(--ink0)");
    return make(
        "div",
        { class: "scope-bar" },
        name,
        make(
            "div",
            { class: "scope-tools" },
            choice,
            figureMenu(studio, () => ({ name: `${state.graph.name}-${card.name}-${card.view}`, surfaces: [card.surface], draw: () => drawCard(studio, state, card, performance.now()) })),
            make("button", { class: "quiet", text: "−", "aria-label": "Smaller", title: "Smaller", onclick: zoom(0.5) }),
            make("button", { class: "quiet", text: "+", "aria-label": "Larger", title: "Larger", onclick: zoom(2) }),
            make("button", {
                class: "quiet",
                text: "×",
                "aria-label": `Remove ${card.name}`,
                title: "Remove",
                onclick: () => remove(studio, state, card),
            }),
        ),
    );
}

function setView(studio, state, card, view) {
    const trace = studio.taps.watch(card.name, SPECTRAL.has(view));
    if (!trace) return studio.say("warn", "At most sixteen ports can be shown: remove a scope first.");
    studio.taps.release(card.trace);
    Object.assign(card, { trace, view, isAutomatic: false, memory: {}, zoom: 1 });
    remember(state);
}

// A scope that the page chose, and that has not moved for so long while others did, shows another port.
function followMotion(studio, state) {
    let begin_ms = null; // since when a hand strokes
    studio.on("graph", () => (begin_ms = null));
    studio.on("moved", () => {
        const isStroked = studio.graph.pads.length === 0 || studio.pad.hands.down.length > 0;
        const now_ms = performance.now();
        begin_ms = isStroked ? (begin_ms ?? now_ms) : null;
        if (begin_ms === null || now_ms - begin_ms < STILL_MS || state.paused) return;
        for (const [place, name, isAlike] of replacements(state.cards, studio.graph, (port) => studio.motion.moves(port)))
            replace(studio, state, state.cards[place], name, isAlike ? state.cards[place].view : "time");
    });
}

function replace(studio, state, card, name, view) {
    const trace = studio.taps.watch(name, SPECTRAL.has(view));
    if (!trace) return;
    studio.taps.release(card.trace);
    const port = state.graph.ports.find((each) => each.name === name);
    Object.assign(card, { name, port, view, trace, memory: {}, zoom: 1 });
    card.element.setAttribute("aria-label", name);
    card.element.firstChild.replaceWith(barOf(studio, state, card));
    card.surface.canvas.setAttribute("aria-label", `${name} as ${view}`);
}

function remove(studio, state, card, keep = true) {
    studio.taps.release(card.trace);
    card.surface.end();
    card.end();
    card.element.remove();
    state.cards = state.cards.filter((each) => each !== card);
    showEmpty(state);
    if (keep) remember(state);
}

const remember = (state) =>
    kept.set(
        `scopes.${state.graph.name}`,
        state.cards.map(({ name, view, isAutomatic }) => ({ name, view, isAutomatic })),
    );

function showEmpty(state) {
    const empty = find("scopes").querySelector(".empty");
    if (state.cards.length) empty?.remove();
    else if (!empty)
        find("scopes").append(
            make("p", { class: "empty", text: "Add a port from the list, or click a wire in the drawn graph." }),
        );
}

function drawCard(studio, state, card, frame_ms) {
    const { paused, span_s } = state;
    const context = card.surface.begin();
    if (!context) return;
    const trace = paused ? paused.traces.get(card.trace) : card.trace;
    if (paused && !trace?.lanes) return drawNothing(context, card.surface);
    if (trace.lanes === 0) return;
    const limits = studio.graph.actuators.find(({ name, unit }) => name === card.port.node && unit === card.port.unit) ?? null;
    const { end_s, back_s, now_ms, actuators } = paused ?? {
        end_s: studio.taps.now_s() - LAG_S,
        back_s: 0,
        now_ms: frame_ms,
        actuators: studio.status?.actuators ?? [],
    };
    const actuator = limits && actuators.find(({ name }) => name === limits.name);
    const own_s = end_s + studio.taps.ahead_s(card.trace); // by the driver of the port
    const seen = { trace, span_s, end_s: own_s - back_s, back_s, now_ms, limits, actuator, paused: paused !== null, isStopped: !paused && !studio.runs };
    VIEWS[card.view](context, card.surface, { ...card, ...seen });
}

function drawNothing(context, { height }) {
    context.fillStyle = colours.soft;
    context.fillText("No data of this port was kept before the pause", 12, height / 2);
}
