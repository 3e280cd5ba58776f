// The WebSocket to the engine: messages out, messages in, requests and their replies, and coming back when it is lost.
import { Emitter } from "./events.js";
import { read } from "./frames.js";

const PROTOCOL = "haptograph.studio.1";
const FIRST_WAIT_S = 0.5;
const LONGEST_WAIT_S = 8;

// Emits `open`, `lost` ({ wait_s, ever }), `samples`, `sound`, and every JSON message by its type.
export class Connection extends Emitter {
    #socket = null;
    #wait_s = FIRST_WAIT_S;
    #ever = false;
    #next = 1;
    #waiting = new Map();

    connect() {
        const address = new URL("live", location.href);
        address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
        address.search = new URLSearchParams({ token: new URLSearchParams(location.search).get("token") ?? "" });
        const socket = new WebSocket(address, PROTOCOL);
        socket.binaryType = "arraybuffer";
        socket.addEventListener("open", () => this.#opened());
        socket.addEventListener("message", (event) => this.#received(event.data));
        socket.addEventListener("close", () => this.#closed());
        this.#socket = socket;
    }

    get open() {
        return this.#socket?.readyState === WebSocket.OPEN;
    }

    // Bytes that still have to leave this machine.
    get unsent() {
        return this.#socket?.bufferedAmount ?? 0;
    }

    send(message) {
        if (this.open) this.#socket.send(JSON.stringify(message));
    }

    sendBinary(buffer) {
        if (this.open) this.#socket.send(buffer);
    }

    // Sends `message` with a number of its own; the promise holds the engine's reply, or `ok: false` and why not.
    request(message) {
        if (!this.open) return Promise.resolve(failure("The engine is not connected."));
        const request = this.#next++;
        return new Promise((resolve) => {
            this.#waiting.set(request, resolve);
            this.send({ ...message, request });
        });
    }

    #opened() {
        this.#ever = true;
        this.#wait_s = FIRST_WAIT_S;
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
        if (message.type === "reply") {
            this.#waiting.get(message.request)?.(message);
            this.#waiting.delete(message.request);
        }
        this.emit(message.type, message);
    }

    #closed() {
        for (const resolve of this.#waiting.values()) resolve(failure("The connection was lost before the answer came."));
        this.#waiting.clear();
        const wait_s = this.#wait_s;
        this.#wait_s = Math.min(LONGEST_WAIT_S, wait_s * 1.7);
        this.emit("lost", { wait_s, ever: this.#ever });
        setTimeout(() => this.connect(), wait_s * 1000);
    }
}

const failure = (error) => ({ ok: false, error, diagnostics: [], change: null });
