// The actuator's command as sound: only after a press, and quiet at first.
import { find, save, setText } from "./dom.js";
import { keeperOf, lastOf, patternOf, wavOf } from "./wav.js";

const FIRST_LEVEL_DB = -20;
const SILENT_DB = -60;
const RAMP_S = 0.25;
const CUT_S = 0.004;

export class Sound {
    #studio;
    #context = null;
    #player = null;
    #gain = null;
    #keeper = null;

    constructor(studio) {
        this.#studio = studio;
        this.on = false;
        this.level_db = FIRST_LEVEL_DB;
        this.report = null;
        this.error = null;
        find("sound").addEventListener("click", () => this.toggle());
        find("wav")?.addEventListener("click", () => this.#keep()); // a participant keeps nothing
        find("level").addEventListener("input", (event) => this.#setLevel(Number(event.target.value)));
        studio.on("graph", (graph) => this.#follow(graph));
        document.addEventListener("visibilitychange", () => (document.hidden ? this.cut() : this.resume()));
        this.#show();
    }

    // The reason why sound is impossible here; null if it is possible.
    get obstacle() {
        if (!this.#studio.graph) return null;
        if (!this.#studio.graph.sound) return "This graph has no output that can be played as sound";
        if (!("audioWorklet" in AudioContext.prototype))
            return this.#studio.hello?.from === "network"
                ? "This page came from another machine over plain HTTP, so browsers play no sound and report the pointer only once per frame. Listen, edit, save, record and learn on that machine"
                : "No sound at this address: browsers play no sound over plain HTTP from another machine. Open the page on the machine itself";
        return this.error;
    }

    // Latency from the engine to the ear, s; null while nothing plays.
    get latency_s() {
        if (!this.on || !this.report || !this.#context) return null;
        return this.report.fill_s + (this.#context.baseLatency || 0) + (this.#context.outputLatency || 0);
    }

    // The current gain of the sound.
    get gain() {
        return this.#gain?.gain.value ?? 0;
    }

    // The gain of the chosen level.
    get gainAtLevel() {
        return this.level_db <= SILENT_DB ? 0 : 10 ** (this.level_db / 20);
    }

    async toggle() {
        if (this.on) return this.#end();
        this.error = null;
        try {
            await this.#begin();
        } catch (error) {
            this.error = `The sound did not start: ${error.message}`;
        }
        this.#show();
    }

    // Mutes at once, at STOP.
    cut() {
        this.#gain?.gain.cancelScheduledValues(0);
        this.#gain?.gain.setTargetAtTime(0, this.#context.currentTime, CUT_S);
    }

    // Back to the level, slowly.
    resume() {
        this.#ramp();
    }

    async #begin() {
        const { sound } = this.#studio.graph ?? {};
        if (!sound || this.obstacle) return;
        const { engine } = this.#studio.connection;
        if (engine ? this.#player !== engine.node : this.#context?.sampleRate !== sound.rate_hz) await this.#open(sound.rate_hz);
        await this.#context.resume();
        this.on = true;
        if (!engine) {
            this.#player.port.postMessage({ restart: true });
            this.#studio.connection.send({ type: "sound", on: true });
        }
        this.#ramp();
    }

    async #open(rate_hz) {
        const { engine } = this.#studio.connection;
        if (engine) return await this.#connect(engine.context, engine.node);
        await this.#context?.close();
        this.#context = contextAt(rate_hz);
        await this.#context.audioWorklet.addModule(new URL("worklet.js", import.meta.url));
        const player = new AudioWorkletNode(this.#context, "player", {
            numberOfInputs: 0,
            outputChannelCount: [2],
            processorOptions: { rate_hz },
        });
        const { port1, port2 } = new MessageChannel();
        this.#studio.connection.playBy(port1);
        player.port.postMessage({ source: port2 }, [port2]);
        await this.#connect(this.#context, player);
    }

    // The player, or the engine itself, plays through a gain.
    async #connect(context, player) {
        this.#context = context;
        this.#player = player;
        // The browser counts its underruns.
        player.port.onmessage = ({ data }) =>
            (this.report = { ...data, underruns: data.underruns + (context.playbackStats?.underrunEvents ?? 0) });
        this.#gain = new GainNode(context, { gain: 0 });
        player.connect(this.#gain).connect(context.destination);
        if (find("wav")) this.#keeper = await keeperOf(context, player);
    }

    // Downloads the last seconds, at the level at which the actuator gets them.
    async #keep() {
        const samples = await lastOf(this.#keeper);
        const { name, sound, actuators } = this.#studio.graph;
        const rate_hz = this.#context.sampleRate;
        const { peak, unit } = actuators.find(({ name }) => sound.what.startsWith(`${name}.`));
        const format = find("wav-format").value;
        const last = `The last ${(samples.length / rate_hz).toFixed(1)} s`;
        if (format !== "wav") {
            const message = patternOf(format, samples, { rate_hz, full_scale: peak, unit });
            const { pattern, error } = await this.#studio.connection.request(message);
            if (!pattern) return this.#studio.say("bad", `${last} were not saved: ${error}`);
            save(`${name}.${format}`, new Blob([pattern.text], { type: "application/json" }));
            return this.#studio.say("good", `${last} were saved. Decoded again, ${lossOf(pattern.loss)}`);
        }
        const what = `${sound.what} of ${name}; 1.0 is its limit, ${peak} ${unit}`;
        save(`${name}.wav`, wavOf(samples, rate_hz, what));
        this.#studio.say("good", `${last} were saved: ${what}`);
    }

    #end() {
        this.on = false;
        this.cut();
        if (!this.#studio.connection.engine) {
            this.#studio.connection.send({ type: "sound", on: false });
            setTimeout(() => !this.on && this.#context?.suspend(), 100);
        }
        this.#show();
    }

    // Another graph, or the same engine again: the sound has to be requested anew.
    async #follow({ sound }) {
        if (!this.on) return this.#show();
        if (!sound) return this.#end();
        await this.#begin();
    }

    #setLevel(level_db) {
        this.level_db = level_db;
        this.#ramp(0.03);
        this.#show();
    }

    // Only while the engine runs and the page is visible; otherwise the sound stays muted.
    #ramp(time_s = RAMP_S) {
        if (!this.on || !this.#studio.runs || document.hidden) return;
        const { gain } = this.#gain;
        gain.cancelScheduledValues(0);
        gain.setTargetAtTime(this.gainAtLevel, this.#context.currentTime, time_s / 3);
    }

    #show() {
        find("sound").setAttribute("aria-pressed", String(this.on));
        setText(find("sound"), this.on ? "Sound: on" : "Sound: off");
        if (find("wav")) find("wav").hidden = find("wav-format").hidden = !this.on;
        find("sound").disabled = this.obstacle !== null && !this.error;
        const text = this.level_db <= SILENT_DB ? "silent" : `${this.level_db} dB`.replace("-", "−");
        setText(find("level-text"), text);
        find("level").setAttribute("aria-valuetext", text);
    }
}

// What is lost in a file, in words.
const lossOf = ({ envelope_db, lsd_db, lost }) =>
    `levels over 50 ms are ${envelope_db.toFixed(1)} dB off, third octaves ${lsd_db?.toFixed(1) ?? "?"} dB. No such file holds ${lost}`;

// A context at the engine's rate, or at the card's if the browser rejects that.
function contextAt(rate_hz) {
    try {
        return new AudioContext({ sampleRate: rate_hz, latencyHint: "interactive" });
    } catch {
        return new AudioContext({ latencyHint: "interactive" });
    }
}
