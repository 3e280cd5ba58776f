// The engine in the audio thread: it computes the frames as they are played, and exchanges messages with the page
// between them. While it loads an edited graph nothing can be played, so the sound fades to silence first and returns
// afterwards.
import { Module } from "./module.js";

const PUBLISH_S = 0.01;
const REPORT_S = 0.2;
const RING = 4096;
const FADE_S = 0.01;
const QUIET_MS = 200; // a context that is suspended asks for nothing

class Engine extends AudioWorkletProcessor {
    constructor({ processorOptions: { wasm, files, opened, study } }) {
        super();
        this.links = []; // to the page; of a study to the experimenter's and the participant's
        this.asked = this.kept = 0; // what the page was asked to keep of a study, and what it has kept
        this.held = []; // messages to the participant's page that wait for that
        this.module = null;
        this.rendered = this.driven = 0; // frames of the sound card and of the graph's driver
        this.ring = new Float64Array(RING); // where the card's rate is not the graph's
        this.written = 0;
        this.place = 0;
        this.edits = []; // messages that wait for silence
        this.gain = 1;
        this.edit_ms = null; // how long the latest edit kept the sound
        this.since_s = this.report_s = this.peak = this.busy_ms = 0;
        this.told_ms = this.ran_ms = Date.now();
        this.port.onmessage = ({ data }) => this.follow(data);
        this.attempt(() => {
            const module = new Module(wasm);
            for (const file of files) module.put(file);
            module.open(opened, study);
            this.module = module;
        });
    }

    follow({ link, page = 0, leaves, kept }) {
        if (kept) {
            this.kept = kept;
            this.tell();
        } else if (leaves) {
            this.links.length = 1;
            this.attempt(() => this.module.letParticipant(false));
        } else this.join(link, page);
    }

    join(link, page) {
        this.links[page] = link;
        this.held = [];
        if (page === 1) this.attempt(() => this.module.letParticipant(true));
        link.onmessage = ({ data }) => {
            if (this.links[page] !== link) return;
            // STOP does not wait for an edit; without playback there is nothing to fade.
            if (this.isQuiet) this.edits.splice(0).forEach((waiting) => this.hear(waiting));
            else if (data.edits) return this.edits.push(data);
            if (data.text || data.surface || data.bytes.byteLength) this.hear(data, page);
        };
        if (this.isQuiet) this.publish();
        this.tell();
        if (this.failure) link.postMessage({ failed: this.failure });
    }

    // True if the context does not play.
    get isQuiet() {
        return Date.now() - this.ran_ms > QUIET_MS;
    }

    hear(message, page = 0) {
        this.attempt(() => (message.surface ? this.module.addSurface(message.surface) : this.module.hear(message, page)));
        this.tell();
    }

    // An error ends the engine, in silence.
    attempt(work) {
        if (this.failure) return;
        try {
            work();
        } catch (error) {
            this.failure = error instanceof Uint8Array ? error : this.module?.panic;
            if (!this.failure?.length) this.failure = String(error);
            this.module = null;
            for (const link of this.links) link.postMessage({ failed: this.failure });
        }
    }

    process(_, [[out, ...others]]) {
        if (!this.module) return !this.failure;
        const begun_ms = Date.now();
        if (this.edits.length && this.gain === 0) {
            this.hear(this.edits.shift());
            this.edit_ms = Date.now() - begun_ms;
        }
        this.ran_ms = Date.now();
        if (!this.module) return false;
        this.attempt(() => this.render(out));
        this.fade(out);
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

    // Fades to silence while an edit waits, and back.
    fade(out) {
        const step = (this.edits.length ? -1 : 1) / (FADE_S * sampleRate);
        if (step > 0 && this.gain === 1) return;
        for (let i = 0; i < out.length; i++) {
            out[i] *= this.gain;
            this.gain = Math.max(0, Math.min(1, this.gain + step));
        }
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
        this.port.postMessage({ fill_s: 0, target_s: 0, underruns: 0, peak: this.peak, edit_ms: this.edit_ms, playing: true });
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
        if (this.links.length === 0 || !this.module) return;
        this.attempt(() => {
            const changes = [...this.module.changes()];
            if (changes.length) this.port.postMessage({ keep: ++this.asked, changes });
            for (const message of this.module.messages(0)) this.links[0].postMessage(message, [message.bytes]);
            // What was answered is on disk before the participant sees the next trial.
            this.held.push(...this.module.messages(1));
            if (this.kept < this.asked) return;
            for (const message of this.held.splice(0)) this.links[1]?.postMessage(message, [message.bytes]);
        });
    }
}
registerProcessor("engine", Engine);
