// The connection to an engine in the audio thread, in place of a WebSocket. A second engine checks edits here, so that
// the playing engine loads only valid graphs.
import { Module } from "./module.js";

const CHECKED = new Set(["check", "apply", "parameter"]);
const EDIT_WAITS_MS = 500;
const LEARNS_AT_MOST_MS = 600_000;
const encoder = new TextEncoder();
const decoder = new TextDecoder();

export class EngineLink {
    #port;
    #checker = new Promise(() => {});
    #learning = null; // the request and the end of what is learned
    #later; // addresses: { whole, surfaces }
    #begun; // what a further engine begins with: { files, opened }
    #added = []; // surfaces since then

    constructor({ port, wasm, files, opened, later }) {
        this.#port = port;
        this.#later = later;
        this.#begun = { files, opened };
        this.readyState = WebSocket.OPEN;
        this.bufferedAmount = 0;
        this.onmessage = this.onclose = () => {};
        port.onmessage = ({ data }) => (data.failed ? this.#fail(data.failed) : this.#deliver(data));
        // A study is not edited.
        if (!wasm) return;
        this.#checker = Promise.resolve().then(() => {
            const module = new Module(wasm);
            for (const file of files) module.put(file);
            module.openChecker(opened);
            return module;
        });
    }

    send(message) {
        if (typeof message !== "string") return this.#port.postMessage({ bytes: message, text: false }, [message]);
        const read = JSON.parse(message);
        if (["learn", "listen", "export"].includes(read.type)) this.#learn(read);
        else if (read.type === "cancel") this.#cancel(read);
        else if (CHECKED.has(read.type)) this.#check(message);
        else this.#forward(message);
    }

    // In a worker of its own, so that neither the page nor the sound waits.
    async #learn(read) {
        const { request, name = "", csv = "", mapping = {}, reads = false } = read;
        const reply = (more) => {
            const whole = { type: "reply", request, ok: false, error: null, diagnostics: [], change: null, ...more };
            this.onmessage({ data: JSON.stringify(whole) });
        };
        if (this.#learning) return reply({ error: "another recording is being learned; retry when it is done" });
        const loading = new AbortController();
        this.#learning = { request, end: (why) => loading.abort(new Error(why)) };
        try {
            const whole = await bytesOf(this.#later.whole, loading.signal);
            const listens = read.type === "listen" && { ...this.#begun, surfaces: this.#added, message: encoder.encode(JSON.stringify({ ...read, csv: "" })) };
            const exports = read.type === "export" && encoder.encode(JSON.stringify(read));
            const learned = await learnBeside(whole, { name, csv, mapping, reads, listens, exports }, (end) => (this.#learning.end = end));
            if (listens || exports) return this.onmessage({ data: JSON.stringify(learned) });
            if (reads) return reply({ ok: true, read: learned });
            const surface = { name: encoder.encode(learned.name), text: encoder.encode(learned.surface) };
            const path = (await this.#checker).addSurface(surface);
            if (!path) throw new Error("a thousand surfaces with this name exist; reload the page");
            this.#addToEngine(surface);
            reply({ ok: true, change: decoder.decode(path), learned });
        } catch (error) {
            reply({ error: error instanceof Uint8Array ? decoder.decode(error) : (error.message ?? String(error)) });
        } finally {
            this.#learning = null;
        }
    }

    #addToEngine(surface) {
        this.#added.push(surface);
        this.#port.postMessage({ surface, edits: true });
        this.#flushLater();
    }

    // Loads the surfaces beside the graph's own, once.
    async loadSurfaces() {
        const addresses = this.#later?.surfaces.splice(0) ?? [];
        for (const address of addresses) {
            try {
                const name = decodeURIComponent(address.split("/").at(-1)).replace(/\.ron$/, "");
                const surface = { name: encoder.encode(name), text: await bytesOf(address) };
                (await this.#checker).addSurface(surface);
                this.#addToEngine(surface);
            } catch {
                this.#later.surfaces.push(address); // the next time it may be there
            }
        }
    }

    #cancel({ request }) {
        if (this.#learning?.request === request) this.#learning.end("learning was cancelled");
    }

    async #check(message) {
        const begun_ms = performance.now();
        try {
            const answer = (await this.#checker).check(encoder.encode(message));
            if (!answer) return this.#forward(message, true);
            const reply = { ...JSON.parse(decoder.decode(answer)), ms: performance.now() - begun_ms };
            this.onmessage({ data: JSON.stringify(reply) });
        } catch (error) {
            const { request } = JSON.parse(message);
            const why = `the engine that checks edits failed: ${String(error)}; reload the page`;
            this.onmessage({
                data: JSON.stringify({ type: "reply", request, ok: false, error: why, diagnostics: [], change: null }),
            });
        }
    }

    #forward(message, edits = false) {
        const bytes = encoder.encode(message).buffer;
        this.#port.postMessage({ bytes, text: true, edits }, [bytes]);
        if (edits) this.#flushLater();
    }

    // Without playback no other message may follow, and the edit would not be loaded.
    #flushLater() {
        setTimeout(() => this.#port.postMessage({ bytes: new ArrayBuffer(0), text: false }), EDIT_WAITS_MS);
    }

    #deliver({ bytes, text }) {
        const data = text ? decoder.decode(bytes) : bytes;
        if (text && /"type":"graph"/.test(data)) this.#follow(data);
        this.onmessage({ data });
    }

    async #follow(message) {
        const checker = await this.#checker.catch(() => null); // a check says why there is none
        try {
            checker?.follow(encoder.encode(message));
        } catch {
            // The next check reports it.
        }
    }

    #fail(why) {
        this.readyState = WebSocket.CLOSED;
        this.onclose({ reason: typeof why === "string" ? why : decoder.decode(why) });
    }
}

async function bytesOf(address, signal = null) {
    const response = await fetch(address, { signal });
    if (!response.ok) throw new Error(`${address}: ${response.status} ${response.statusText}`);
    return new Uint8Array(await response.arrayBuffer());
}

// `begun` gets the function that ends it with a reason.
function learnBeside(wasm, { name, csv, mapping, reads, listens, exports }, begun) {
    return new Promise((done, failed) => {
        const worker = new Worker(new URL("learn-worker.js", import.meta.url), { type: "module" });
        worker.onmessage = ({ data: { learned, error } }) => (learned ? done(learned) : failed(new Error(error)));
        const cancel = (why) => (worker.terminate(), failed(new Error(why)));
        const end = (why) => cancel(`the engine that learns ${why}; use a shorter recording`);
        begun(cancel);
        worker.onerror = ({ message }) => end(`failed: ${message}`);
        worker.onmessageerror = () => end("gave an answer that cannot be read");
        // A worker that the browser ends for lack of memory may send no message.
        setTimeout(end, LEARNS_AT_MOST_MS, `took more than ${LEARNS_AT_MOST_MS / 60_000} minutes`);
        const bytes = encoder.encode(csv);
        const recording = { path: encoder.encode(name), bytes, mapping: encoder.encode(JSON.stringify(mapping)) };
        worker.postMessage({ wasm, recording, reads, listens, exports }, [bytes.buffer]);
    });
}
