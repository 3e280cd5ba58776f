// Which ports the engine sends, and the traces of what it sent. A port that several panels show is sent once.
import { Trace } from "./trace.js";

const MOST_PORTS = 16;
const UNSETTLED_MS = 250; // how long messages that were under way may still follow the list before

export class Taps {
    #connection;
    #slots = []; // { trace, since_ms } or null: the places of the latest list
    #pending = false;
    #offsets_s = new Map(); // by driver: its time less the page's own
    #drivers = new Map(); // by port, where real drivers run, each by its own time
    #first = null; // the driver whose time is that of the run

    constructor(connection) {
        this.#connection = connection;
        connection.on("samples", (frame) => this.#take(frame));
        connection.on("graph", (graph) => this.#restart(graph));
        connection.on("lost", () => this.#offsets_s.clear());
    }

    // The trace of a port, sent from now on until it is released; null if all slots are taken.
    watch(name, raw = false) {
        let slot = this.#slots.find((slot) => slot?.trace.name === name && slot.trace.raw === raw);
        if (!slot) {
            const free = this.#slots.indexOf(null);
            const at = free < 0 ? this.#slots.length : free;
            if (at >= MOST_PORTS) return null;
            slot = this.#slots[at] = { trace: new Trace(name, raw), since_ms: performance.now() };
            this.#announce();
        }
        slot.trace.users++;
        return slot.trace;
    }

    // Ends one use. Its place stays empty until another trace takes it: the others keep theirs, and lose nothing.
    release(trace) {
        if (!trace || --trace.users > 0) return;
        const at = this.#slots.findIndex((slot) => slot?.trace === trace);
        if (at < 0) return;
        this.#slots[at] = null;
        this.#announce();
    }

    // The traces that are sent now.
    get traces() {
        return this.#slots.flatMap((slot) => slot?.trace ?? []);
    }

    // The time of the run, interpolated by the page's clock.
    now_s() {
        return performance.now() / 1000 + this.#offset_s;
    }

    // The time of a trace's own driver less that of the run.
    ahead_s({ name }) {
        return (this.#offsets_s.get(this.#driverOf(name)) ?? this.#offset_s) - this.#offset_s;
    }

    get #offset_s() {
        return this.#offsets_s.get(this.#first) ?? this.#offsets_s.values().next().value ?? 0;
    }

    #driverOf(name) {
        return this.#drivers.get(name) ?? this.#first;
    }

    #announce() {
        if (this.#pending) return;
        this.#pending = true;
        queueMicrotask(() => {
            this.#pending = false;
            this.#connection.send({ type: "scope", ports: this.#slots.map(portOf) });
        });
    }

    #restart({ ports, contacts, drivers = [] }) {
        for (const trace of this.traces) trace.clear();
        this.#offsets_s.clear();
        const isOne = drivers.every(({ simulated }) => simulated);
        this.#first = isOne ? null : drivers[0].name;
        this.#drivers = new Map(isOne ? [] : [...ports, ...contacts].map(({ name, driver }) => [name, driver ?? this.#first]));
        this.#announce();
    }

    #take(frame) {
        const slot = this.#slots[frame.place];
        if (!slot || performance.now() - slot.since_ms < UNSETTLED_MS) return;
        slot.trace.push(frame);
        this.#follow(this.#driverOf(slot.trace.name), slot.trace.end_s - performance.now() / 1000);
    }

    #follow(driver, offset_s) {
        const known_s = this.#offsets_s.get(driver) ?? -Infinity;
        const error_s = offset_s - known_s;
        const follows = error_s * (error_s > 0 ? 0.05 : 0.005);
        this.#offsets_s.set(driver, Math.abs(error_s) > 0.3 ? offset_s : known_s + follows);
    }
}

// An empty place asks for no port.
const portOf = (slot) => ({ name: slot?.trace.name ?? "", raw: slot?.trace.raw ?? false });
