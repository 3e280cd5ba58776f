// The engine in the audio thread: it runs as many frames as are played, and talks to the page between them.
import { Module } from "./module.js";

const PUBLISH_S = 0.01;
const REPORT_S = 0.2;
const RING = 4096;

class Engine extends AudioWorkletProcessor {
    constructor({ processorOptions: { wasm, files, opened } }) {
        super();
        this.link = null;
        this.module = null;
        this.rendered = this.driven = 0; // frames of the sound card and of the graph's driver
        this.ring = new Float64Array(RING); // where the card's rate is not the graph's
        this.written = 0;
        this.place = 0;
        this.since_s = this.report_s = this.peak = this.busy_ms = 0;
        this.told_ms = Date.now();
        this.port.onmessage = ({ data }) => this.join(data.link);
        this.attempt(() => {
            const module = new Module(wasm);
            for (const file of files) module.put(file);
            module.open(opened);
            this.module = module;
        });
    }

    join(link) {
        this.link = link;
        link.onmessage = ({ data }) => {
            this.attempt(() => this.module.hear(data));
            this.tell();
        };
        this.tell();
        if (this.failure) link.postMessage({ failed: this.failure });
    }

    // What goes wrong ends the engine, in silence.
    attempt(work) {
        if (this.failure) return;
        try {
            work();
        } catch (error) {
            this.failure = error instanceof Uint8Array ? error : this.module?.panic;
            if (!this.failure?.length) this.failure = String(error);
            this.module = null;
            this.link?.postMessage({ failed: this.failure });
        }
    }

    process(_, [[out, ...others]]) {
        if (!this.module) return !this.failure;
        const begun_ms = Date.now();
        this.attempt(() => this.render(out));
        for (const other of others) other.set(out);
        this.busy_ms += Date.now() - begun_ms;
        this.account(out);
        return true;
    }

    render(out) {
        const { module } = this;
        if (module.driver_hz !== this.driver_hz) {
            this.driver_hz = module.driver_hz;
            this.rendered = this.driven = 0;
            this.place = this.written;
        }
        this.rendered += out.length;
        const due = Math.floor((this.rendered * module.driver_hz) / sampleRate) - this.driven;
        this.driven += due;
        const played = module.process(due);
        if (module.sound_hz === sampleRate && played.length === out.length) out.set(played);
        else this.resample(played, module.sound_hz / sampleRate, out);
    }

    // Both rates come from one clock, so that the ring's fill stays as it is.
    resample(played, step, out) {
        for (const value of played) this.ring[this.written++ % RING] = value;
        for (let i = 0; i < out.length && this.written - this.place > 3; i++, this.place += step) {
            const at = Math.floor(this.place);
            const t = this.place - at;
            const [a, b, c, d] = [0, 1, 2, 3].map((k) => this.ring[(at + k) % RING]);
            out[i] = b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a)));
        }
    }

    account(out) {
        for (const value of out) this.peak = Math.max(this.peak, Math.abs(value));
        const block_s = out.length / sampleRate;
        this.since_s += block_s;
        this.report_s += block_s;
        if (this.since_s >= PUBLISH_S) this.publish();
        if (this.report_s < REPORT_S) return;
        this.port.postMessage({ fill_s: 0, target_s: 0, underruns: 0, peak: this.peak, playing: true });
        this.report_s = this.peak = 0;
    }

    publish() {
        const now_ms = Date.now();
        this.attempt(() => this.module.publish(now_ms - this.told_ms, this.busy_ms));
        this.told_ms = now_ms;
        this.since_s = this.busy_ms = 0;
        this.tell();
    }

    tell() {
        if (!this.link || !this.module) return;
        for (const message of this.module.messages()) this.link.postMessage(message, [message.bytes]);
    }
}
registerProcessor("engine", Engine);
