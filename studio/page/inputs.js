// What the page can move besides pads: a fader for each number of the inputs, a field for two of a vector, a switch where there
// is only on and off. An input that nobody holds shows what the graph gives it.
import { controlRow } from "./control.js";
import { find, make, setText } from "./dom.js";
import { everyFrame } from "./frame.js";

// A section with all inputs of the graph; null if it has none. `dispose` ends its listening.
export function inputsSection(studio, label = "Inputs") {
    const made = studio.graph.inputs.map((input) => inputRows(studio, input));
    if (made.length === 0) return null;
    const element = make(
        "section",
        { class: "control-group inputs", "aria-label": label },
        make("h3", {}, "Inputs", make("span", { class: "soft", text: "in place of the devices that the graph reads" })),
        ...made.map(({ element: each }) => each),
    );
    return { element, dispose: () => made.forEach(({ dispose }) => dispose()) };
}

// Shows the inputs in place of the pad where a graph has none.
export function mountPadInputs(studio) {
    let shown = null,
        shape = null;
    // What another page took, or a lost connection let go, is not taken again by itself.
    studio.connection.on("status", ({ owner }) => owner === false && studio.pad.hands.forgetInputs());
    studio.connection.on("lost", () => studio.pad.hands.forgetInputs());
    studio.on("graph", ({ pads, inputs }) => {
        const now = JSON.stringify([pads.length, inputs]);
        if (now === shape) return;
        shape = now;
        shown?.dispose();
        shown = pads.length === 0 ? inputsSection(studio, "Inputs in place of the pad") : null;
        find("pad").hidden = Boolean(shown);
        find("pad-inputs").hidden = !shown;
        find("pad-panel").classList.toggle("without-pad", pads.length === 0);
        find("pad-inputs").replaceChildren(...(shown ? [shown.element] : []));
        setText(find("pad-title"), shown ? "Inputs" : "Pad");
    });
}

function inputRows(studio, input) {
    const { hands } = studio.pad;
    const port = studio.graph.ports.find(({ name }) => name === input.port);
    const name = `${input.endpoint}${input.channel === "value" ? "" : ` ${input.channel}`}`;
    const lanes = (port?.lanes ?? [""]).slice(0, 3);
    const { min, max } = input;
    const trace = studio.taps.watch(input.port);
    const listeners = [];
    let parts = lanes.map(() => 0.5);
    const valueOf = (lane) => min + parts[lane] * (max - min);
    // What the graph reads, while nobody holds the input.
    const follow = () => {
        lanes.forEach((_, lane) => {
            const value = trace?.latest(lane);
            if (Number.isFinite(value)) parts[lane] = (value - min) / (max - min);
        });
    };
    const set = (lane, value) => {
        const to = parts.with(lane, (value - min) / (max - min));
        if (!hands.hold(input, to)) return studio.say("warn", `${name} was not moved: ${why(studio)}`);
        parts = to;
        show();
    };
    const switches = input.channel === "touching";
    const rows = lanes.map((lane, i) => {
        const setting = {
            ...{ name: input.port, node: name, field: lane || input.channel, min, max, value: valueOf(i), unit: port?.unit ?? "" },
            ...{ whole: switches, isSwitch: switches, digits: 4, id: `input ${input.endpoint}.${input.channel}${lane && ` ${lane}`}` },
        };
        const turn = { isLive: true, set: (to) => set(i, to), now: () => valueOf(i), follow: (listener) => (listeners.push(() => listener(valueOf(i))), () => {}) };
        return controlRow(studio, setting, { compact: true, turn });
    });
    const state = make("span", { class: "soft clip" });
    const back = make("button", { text: "As the graph has it", "aria-label": `${name}: as the graph has it`, onclick: () => (hands.release(input), show()) });
    const field = lanes.length > 1 ? xyField(parts, (x, y) => (set(0, min + x * (max - min)), set(1, min + y * (max - min)))) : null;
    const show = () => {
        const held = hands.holds(input);
        back.disabled = !held;
        setText(state, held ? "held by you" : "moved by the graph");
        if (!held) follow();
        listeners.forEach((listener) => listener());
        field?.show(parts);
    };
    const end = everyFrame(show);
    const head = make("div", { class: "input-head" }, make("strong", { class: "mono", text: name }), state, make("span", { class: "grow" }), back);
    const element = make("div", { class: "input" }, head, field?.element, ...rows.map((row) => row.element));
    const dispose = () => (end(), studio.taps.release(trace), rows.forEach((row) => row.dispose()));
    return { element, dispose };
}

const why = (studio) => (!studio.runs ? "the run is stopped; resume it first" : "another page owns the inputs");

// A field whose point is two numbers, 0 to 1 from left and below. The faders beside it do the same by keys.
function xyField(parts, set) {
    const point = make("span", { class: "xy-point" });
    const element = make("div", { class: "xy", "aria-hidden": "true" }, point);
    const move = (event) => {
        const box = element.getBoundingClientRect();
        const within = (part) => Math.max(0, Math.min(1, part));
        set(within((event.clientX - box.left) / box.width), within((box.bottom - event.clientY) / box.height));
    };
    element.addEventListener("pointerdown", (event) => {
        element.setPointerCapture(event.pointerId);
        move(event);
    });
    element.addEventListener("pointermove", (event) => element.hasPointerCapture(event.pointerId) && move(event));
    const percent = (part) => `${100 * Math.max(0, Math.min(1, part))}%`;
    const show = ([x, y]) => Object.assign(point.style, { left: percent(x), bottom: percent(y) });
    show(parts);
    return { element, show };
}
