// Knobs of MIDI devices, axes and buttons of game controllers, and keys that move the page's controls. The browser is asked
// for MIDI only when a person assigns a control or presses Connect.
import { find, kept, make, setText, takesText } from "./dom.js";
import { everyFrame } from "./frame.js";

const LONG_PRESS_MS = 600;
const MOVED = 0.35; // of an axis's whole range, to be learned
const MAX = 200;
const SOURCE = /^(midi:(cc|note|bend):([0-9]|1[0-5])(:([0-9]{1,2}|1[01][0-9]|12[0-7]))?|pad:(axis|button):[0-9]{1,2}|key:(Key[A-Z]|Digit[0-9]|Numpad[0-9]|F[0-9]{1,2}))$/;

export class Assignments {
    #studio;
    #controls = new Map(); // by id: the places where the control is, each { label, move, button }
    #sources = {}; // by id of a control
    #learning = null; // the id of a control
    #midi = null;
    #down = []; // keys
    #axes = new Map(); // where axes stood when learning began, and their latest value

    constructor(studio) {
        this.#studio = studio;
        studio.on("graph", ({ name }) => {
            if (this.graph === name) return;
            this.graph = name;
            this.#sources = {};
            this.take(kept.get(`assign.${name}`, {}), "the browser's storage");
        });
        window.addEventListener("keydown", (event) => this.#key(event, 1), true);
        window.addEventListener("keyup", (event) => this.#key(event, 0), true);
        window.addEventListener("blur", () => this.#letGo());
        everyFrame(() => this.#poll());
    }

    // By id of a control what moves it: of the present graph, for its preset.
    get sources() {
        return { ...this.#sources };
    }

    // Takes assignments by id from a preset; what is wrong with them, one sentence each.
    take(sources, where) {
        const wrong = [];
        if (typeof sources !== "object" || sources === null || Array.isArray(sources)) return [`${where}: \`assignments\` is no map`];
        const all = Object.entries(sources);
        if (all.length > MAX) wrong.push(`${where}: \`assignments\` has ${all.length} entries, at most ${MAX}`);
        for (const [id, source] of all.slice(0, MAX)) {
            if (typeof source === "string" && SOURCE.test(source) && id.length < 200) this.#sources[id] = source;
            else wrong.push(`${where}: \`assignments\`, \`${id.slice(0, 60)}\`: ${JSON.stringify(source)?.slice(0, 40)} is no source`);
        }
        this.#changed();
        return wrong;
    }

    // Adds a control that `move` sets to a part of its range, 0 to 1. Returns its button and how to remove it; a right-click or a
    // long press on `row` does the same as the button.
    add(id, { label, move }, row) {
        const button = make("button", { class: "assign quiet", type: "button", onclick: () => this.#learn(id) });
        const entry = { label, move, button };
        if (!this.#controls.has(id)) this.#controls.set(id, new Set());
        this.#controls.get(id).add(entry);
        let timer = null;
        const end = () => clearTimeout(timer);
        row.addEventListener("contextmenu", (event) => {
            if (event.target.matches("input[type=number], input[type=text]")) return;
            event.preventDefault();
            if (this.#learning !== id) this.#learn(id);
        });
        row.addEventListener("pointerdown", ({ pointerType, target }) => {
            if (pointerType !== "mouse" && target !== button) timer = setTimeout(() => this.#learning !== id && this.#learn(id), LONG_PRESS_MS);
        });
        for (const type of ["pointerup", "pointercancel", "pointermove", "input"]) row.addEventListener(type, end);
        this.#show(id);
        return { button, dispose: () => this.#controls.get(id).delete(entry) };
    }

    // Ends the learning of a control; false if none goes on.
    endLearning() {
        if (this.#learning === null) return false;
        this.#learn(this.#learning);
        return true;
    }

    // Begins to learn what moves a control, ends that, or takes what it has away.
    async #learn(id) {
        const before = this.#learning;
        this.#learning = null;
        if (before) this.#show(before);
        if (before === id) return;
        const label = this.#label(id);
        if (this.#sources[id]) {
            this.#studio.say("good", `${label}: ${named(this.#sources[id])} no longer moves it`);
            delete this.#sources[id];
            return this.#changed();
        }
        this.#learning = id;
        this.#axes.clear();
        this.#show(id);
        this.#studio.say("note", `${label}: turn a knob, move an axis, or press a button or key. Escape ends this`);
        const why = await this.#openMidi();
        if (why && this.#learning === id) this.#studio.say("note", `${label}: move an axis, or press a button or key. ${why}`);
    }

    // Asks the browser for MIDI; why it did not give it, or null.
    async #openMidi() {
        if (this.#midi) return null;
        if (!navigator.requestMIDIAccess) return "This browser has no MIDI";
        try {
            this.#midi = await navigator.requestMIDIAccess();
        } catch {
            return "The browser did not allow MIDI";
        }
        const listen = () => {
            for (const input of this.#midi.inputs.values()) input.onmidimessage = ({ data }) => this.#hearMidi(data);
        };
        this.#midi.onstatechange = listen;
        listen();
        return this.#midi.inputs.size === 0 ? "No MIDI device is connected" : null;
    }

    // MIDI that was allowed before is opened without a question; else the button Connect MIDI does it.
    async #reopenMidi() {
        if (this.#midi || !Object.values(this.#sources).some((source) => source.startsWith("midi:"))) return;
        const state = await navigator.permissions?.query({ name: "midi" }).then(({ state }) => state, () => null);
        if (state === "granted") return this.#openMidi();
        find("midi").hidden = false;
        find("midi").onclick = async () => {
            const why = await this.#openMidi();
            find("midi").hidden = Boolean(this.#midi);
            this.#studio.say(why ? "warn" : "good", why ?? "MIDI is connected");
        };
    }

    #hearMidi([status, number, value]) {
        const [kind, channel] = [status >> 4, status & 15];
        if (kind === 11) this.#hear(`midi:cc:${channel}:${number}`, value / 127);
        if (kind === 9 && value > 0) this.#hear(`midi:note:${channel}:${number}`, value / 127);
        if (kind === 8 || (kind === 9 && value === 0)) this.#hear(`midi:note:${channel}:${number}`, 0);
        if (kind === 14) this.#hear(`midi:bend:${channel}`, ((value << 7) | number) / 16383);
    }

    // Keys that are down when the page loses the keyboard are let go.
    #letGo() {
        for (const source of this.#down.splice(0)) this.#hear(source, 0);
    }

    // STOP's keys and those that a field or a control uses stay theirs.
    #key(event, part) {
        const source = `key:${event.code}`;
        if (part === 0 && this.#down.includes(source)) {
            this.#down = this.#down.filter((down) => down !== source);
            return this.#hear(source, 0);
        }
        if (event.repeat || event.key === "Escape" || event.key === "." || event.key === "Tab" || event.ctrlKey || event.metaKey || event.altKey)
            return;
        const isOwn = this.#learning ? !SOURCE.test(source) : takesText(event.target) || !Object.values(this.#sources).includes(source);
        if (isOwn || (this.#learning && part === 0)) return;
        event.preventDefault();
        event.stopPropagation();
        if (part > 0) this.#down.push(source);
        this.#hear(source, part);
    }

    #poll() {
        if (!this.#learning && !Object.values(this.#sources).some((source) => source.startsWith("pad:"))) return;
        for (const gamepad of navigator.getGamepads?.() ?? []) {
            gamepad?.axes.forEach((value, i) => this.#axis([gamepad.index, `pad:axis:${i}`], (value + 1) / 2, MOVED));
            gamepad?.buttons.forEach(({ value }, i) => this.#axis([gamepad.index, `pad:button:${i}`], value, 0.5));
        }
    }

    // An axis that moves is heard; to be learned it has to go far.
    #axis([controller, source], part, far) {
        const axis = `${controller} ${source}`; // of several controllers each has its own
        const known = this.#axes.get(axis) ?? { began: part, last: part };
        this.#axes.set(axis, { ...known, last: part });
        if (this.#learning ? Math.abs(part - known.began) > far : part !== known.last) this.#hear(source, part);
    }

    #hear(source, part) {
        const id = this.#learning;
        if (id) {
            this.#learning = null;
            this.#sources[id] = source;
            const others = Object.entries(this.#sources).filter(([each, of]) => each !== id && of === source && this.#controls.has(each));
            const too = others.length ? `, and ${others.map(([each]) => this.#label(each)).join(", ")} as before` : "";
            this.#studio.say("good", `${this.#label(id)}: ${named(source)} moves it${too}`);
            this.#changed();
        }
        for (const [each, of] of Object.entries(this.#sources)) if (of === source) [...(this.#controls.get(each) ?? [])][0]?.move(part);
    }

    #changed() {
        kept.set(`assign.${this.graph}`, this.#sources);
        for (const id of this.#controls.keys()) this.#show(id);
        this.#reopenMidi();
    }

    #label(id) {
        return [...(this.#controls.get(id) ?? [])][0]?.label ?? id;
    }

    #show(id) {
        for (const entry of this.#controls.get(id) ?? []) this.#showOn(entry, this.#sources[id], this.#learning === id);
    }

    #showOn({ label, button }, source, learns) {
        setText(button, learns ? "turn…" : source ? short(source) : "Knob");
        button.setAttribute("aria-pressed", String(learns));
        button.classList.toggle("assigned", Boolean(source));
        const does = learns ? "End learning" : source ? `Take ${named(source)} from` : "Assign a knob, axis or key to";
        button.setAttribute("aria-label", `${does} ${label}`);
        button.title = learns ? "Waits for a knob, axis or key; Escape ends this" : `${does} ${label}`;
    }
}

// "midi:cc:0:7" as "controller 7 of MIDI channel 1".
function named(source) {
    const [from, kind, a, b] = source.split(":");
    if (from === "key") return `the key ${kind.replace(/^(Key|Digit)/, "")}`;
    if (from === "pad") return `${kind} ${Number(a) + 1} of the game controller`;
    const of = `of MIDI channel ${Number(a) + 1}`;
    return { cc: `controller ${b} ${of}`, note: `note ${b} ${of}`, bend: `the pitch wheel ${of}` }[kind];
}

function short(source) {
    const [from, kind, a, b] = source.split(":");
    if (from === "key") return kind.replace(/^(Key|Digit)/, "").slice(0, 4);
    if (from === "pad") return `${kind === "axis" ? "Ax" : "Bt"}${Number(a) + 1}`;
    return { cc: `CC${b}`, note: `N${b}`, bend: "Bend" }[kind];
}
