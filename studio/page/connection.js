// The connection to the engine: messages out and in, requests with their replies, and reconnection when it is lost.
import { PageEngine } from "./engine.js";
import { Emitter } from "./events.js";
import { read } from "./frames.js";
import { askOpener } from "./study-windows.js";

// True in a page of a site whose engine is in the window that opened it.
const OPENER = () => document.querySelector('meta[name="haptograph-opener"]') !== null;
const PROTOCOL = "haptograph.studio.1";
const FIRST_WAIT_S = 0.5;
const LONGEST_WAIT_S = 8;
const RESTARTED = "haptograph was started anew: open the link that it printed in its terminal, or paste it here.";

// Emits `open`, `lost` ({ wait_s, ever, reason, isAnother }; `wait_s` is null if no further attempt follows, `isAnother` true if
// another server has the address, which does not know the token of this page), `waiting` when an
// engine in this page begins or ends to wait for a press, `samples`, and every JSON message by its type. Sound goes to
// the player's port.
export class Connection extends Emitter {
    #worker = new Worker(new URL("socket.js", import.meta.url), { type: "module" });
    #wait_s = FIRST_WAIT_S;
    #ever = false;
    #next = 1;
    #waiting = new Map();
    #stop = null; // a STOP that the engine has not confirmed
    #isOver = false; // no further attempt follows

    constructor() {
        super();
        this.engine = PageEngine.here(); // null where a server is behind the page
        if (this.engine) this.engine.onchange = () => this.emit("waiting");
        this.open = false;
        this.graph = 0; // number of the latest graph, which pointers are made for
        this.unsent = 0; // bytes that still have to leave this machine
        const hear = {
            open: () => this.#opened(),
            close: ({ reason }) => this.#closed(reason),
            message: ({ data }) => this.#received(data),
            stroked: (part) => this.emit("stroked", part),
            unsent: ({ unsent }) => (this.unsent = unsent),
        };
        this.#worker.onmessage = ({ data }) => hear[data.what]?.(data);
    }

    // True if a STOP was sent or waits to be sent, and the engine has not confirmed it.
    get stopping() {
        return this.#stop !== null;
    }

    connect() {
        if (this.#isOver) return;
        if (this.engine) return this.#connectHere();
        if (OPENER()) return this.#connectToOpener();
        const address = new URL("live", location.href);
        address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
        address.search = new URLSearchParams({ token: new URLSearchParams(location.search).get("token") ?? "" });
        this.#worker.postMessage({
            what: "connect",
            address: address.href,
            protocol: PROTOCOL,
            origin_ms: performance.timeOrigin,
        });
    }

    #connectToOpener() {
        const join = (port) => this.#worker.postMessage({ what: "connect", engine: { port }, origin_ms: performance.timeOrigin }, [port]);
        askOpener({ joined: join, lost: (reason) => this.#ended({ wait_s: null, reason }) });
    }

    async #connectHere() {
        const { obstacle } = this.engine;
        if (obstacle) return this.emit("lost", { wait_s: null, ever: false, reason: obstacle });
        try {
            const engine = await this.engine.open();
            this.#worker.postMessage({ what: "connect", engine, origin_ms: performance.timeOrigin }, [engine.port]);
            this.emit("waiting");
        } catch (error) {
            this.#closed(error.message);
        }
    }

    // The port of the sound player.
    playBy(port) {
        this.#worker.postMessage({ what: "player", port }, [port]);
    }

    // Begins a gesture of simulated hands ({ hands, gesture, force_n }), or changes it without `hands`; null lifts them. Emits
    // `stroked` ({ number, samples }).
    stroke(how) {
        this.#worker.postMessage({ what: "stroke", how });
    }

    // In a site further surfaces are loaded when somebody looks for one.
    loadSurfaces() {
        if (this.engine) this.#worker.postMessage({ what: "surfaces" });
    }

    // A STOP is kept until the engine confirms it or a page resumes; all other messages are dropped without a
    // connection.
    send(message) {
        if (message.type === "stop") this.#stop = message;
        if (message.type === "resume") this.#stop = null;
        if (!this.open) return;
        const text = JSON.stringify(message);
        this.unsent += text.length;
        this.#worker.postMessage({ what: "send", message: text });
    }

    sendBinary(buffer) {
        if (this.open) this.#worker.postMessage({ what: "send", message: buffer }, [buffer]);
    }

    // Sends `message` with a number of its own; the promise holds the engine's reply, or `ok: false` and why not.
    request(message) {
        return this.numbered(message)[0];
    }

    // The same with the number, by which a request can be cancelled.
    numbered(message) {
        const request = this.#next++;
        if (!this.open) return [Promise.resolve(failure("The engine is not connected.")), request];
        const reply = new Promise((resolve) => {
            this.#waiting.set(request, resolve);
            this.send({ ...message, request });
        });
        return [reply, request];
    }

    #opened() {
        this.open = this.#ever = true;
        this.unsent = 0;
        this.#wait_s = FIRST_WAIT_S;
        if (this.#stop) this.send(this.#stop); // before anything that the panels send
        this.emit("open");
    }

    #received(data) {
        if (data instanceof ArrayBuffer) {
            const frame = read(data);
            if (frame) this.emit(frame.kind, frame);
            return;
        }
        let message;
        try {
            message = JSON.parse(data);
        } catch {
            return;
        }
        if (message.type === "graph") {
            this.graph = message.number ?? 0;
            this.#worker.postMessage({ what: "graph", number: this.graph });
        }
        if (message.type === "reply") {
            this.#waiting.get(message.request)?.(message);
            this.#waiting.delete(message.request);
        }
        const isOver = { status: message.state !== "running", participant: message.state !== "trial" }[message.type];
        if (isOver) this.#stop = null;
        this.emit(message.type, message);
    }

    #ended({ wait_s, reason, isAnother = false }) {
        this.open = false;
        for (const resolve of this.#waiting.values()) resolve(failure("The connection was lost before the answer came."));
        this.#waiting.clear();
        this.emit("lost", { wait_s, ever: this.#ever, reason, isAnother });
    }

    async #closed(reason) {
        if (this.#isOver) return;
        const wait_s = this.#wait_s;
        this.#wait_s = Math.min(LONGEST_WAIT_S, wait_s * 1.7);
        this.#ended({ wait_s, reason });
        if (OPENER()) return; // which is asked for another port
        setTimeout(() => this.connect(), wait_s * 1000);
        if (this.engine || this.#isOver || !(await isAnother()) || this.#isOver || this.open) return;
        this.#isOver = true;
        this.#ended({ wait_s: null, reason: RESTARTED, isAnother: true });
    }
}

// True if a server answers that does not know the token of this page.
async function isAnother() {
    try {
        return (await fetch(location.href, { method: "HEAD", cache: "no-store" })).status === 403;
    } catch {
        return false; // no server answers
    }
}

const failure = (error) => ({ ok: false, error, diagnostics: [], change: null });
