// Masking noise on headphones: a loop of pink or white noise, whose ends fade into each other.
const SECONDS = 12;
const FADE_S = 0.5;

export class Masking {
    #context = null;
    #gain = null;
    level_db = -36; // RMS, relative to full scale

    // Begins after a press: browsers allow no sound before.
    begin(colour) {
        if (!colour || this.#context) return;
        const context = (this.#context = new AudioContext());
        this.#gain = new GainNode(context, { gain: 0 });
        const source = new AudioBufferSourceNode(context, { buffer: loop(context, colour), loop: true });
        source.connect(this.#gain).connect(context.destination);
        source.start();
        this.set(this.level_db);
    }

    set(level_db) {
        this.level_db = level_db;
        this.#gain?.gain.setTargetAtTime(level_db <= -60 ? 0 : 10 ** (level_db / 20), this.#context.currentTime, 0.1);
    }
}

function loop(context, colour) {
    const count = SECONDS * context.sampleRate;
    const fade = Math.round(FADE_S * context.sampleRate);
    const buffer = new AudioBuffer({ length: count, numberOfChannels: 2, sampleRate: context.sampleRate });
    for (const channel of [0, 1]) {
        const noise = samples(count + fade, colour);
        const rms = Math.sqrt(noise.reduce((sum, x) => sum + x * x, 0) / noise.length);
        const into = buffer.getChannelData(channel);
        for (let i = 0; i < count; i++) {
            const part = Math.min(1, i / fade); // of equal power
            into[i] = (noise[i] * Math.sin((part * Math.PI) / 2) + (i < fade ? noise[count + i] * Math.cos((part * Math.PI) / 2) : 0)) / rms;
        }
    }
    return buffer;
}

// White noise; pink noise is a sum of first-order low-passes, an octave apart, each of noise of its own and as strong as the others.
export function samples(count, colour, random = Math.random) {
    const white = () => random() - 0.5;
    if (colour !== "pink") return Float32Array.from({ length: count }, white);
    const poles = Array.from({ length: 14 }, (_, octave) => Math.exp(-2 * Math.PI * 0.4 * 2 ** -octave));
    const states = poles.map(() => 0);
    const next = (sum, pole, i) => sum + (states[i] = pole * states[i] + Math.sqrt(1 - pole * pole) * white());
    return Float32Array.from({ length: count }, () => poles.reduce(next, 0));
}
