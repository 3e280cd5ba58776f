// In place of a WebSocket: the way to an engine in the audio thread. Edits are checked here, beside it, by a second
// engine, so that the one that plays loads only what is right.
import { Module } from "./module.js";

const CHECKED = new Set(["check", "apply", "parameter"]);
const EDIT_WAITS_MS = 500;
const encoder = new TextEncoder();
const decoder = new TextDecoder();

export class EngineLink {
    #port;
    #checker = new Promise(() => {});

    constructor({ port, wasm, files, opened }) {
        this.#port = port;
        this.readyState = WebSocket.OPEN;
        this.bufferedAmount = 0;
        this.onmessage = this.onclose = () => {};
        port.onmessage = ({ data }) => (data.failed ? this.#fail(data.failed) : this.#deliver(data));
        this.#checker = Promise.resolve().then(() => {
            const module = new Module(wasm);
            for (const file of files) module.put(file);
            module.openChecker(opened);
            return module;
        });
    }

    send(message) {
        if (typeof message !== "string") this.#port.postMessage({ bytes: message, text: false }, [message]);
        else if (CHECKED.has(JSON.parse(message).type)) this.#check(message);
        else this.#forward(message);
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
        // Where nothing plays any more, nothing else may come that has it loaded.
        if (edits) setTimeout(() => this.#port.postMessage({ bytes: new ArrayBuffer(0), text: false }), EDIT_WAITS_MS);
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
            // The next check says so.
        }
    }

    #fail(why) {
        this.readyState = WebSocket.CLOSED;
        this.onclose({ reason: typeof why === "string" ? why : decoder.decode(why) });
    }
}
