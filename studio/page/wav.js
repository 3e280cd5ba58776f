// The last seconds of the sound as a file: WAV of 32-bit floats, with a comment that says what full scale is.
const KEPT_S = 10;
const FLOAT = 3; // WAVE_FORMAT_IEEE_FLOAT

// A node that keeps what `player` plays.
export async function keeperOf(context, player) {
    await context.audioWorklet.addModule(new URL("keep-worklet.js", import.meta.url));
    const keeper = new AudioWorkletNode(context, "keeper", { numberOfOutputs: 1, processorOptions: { kept_s: KEPT_S } });
    // A node that is not connected does not run.
    player.connect(keeper).connect(new GainNode(context, { gain: 0 })).connect(context.destination);
    return keeper;
}

// What it kept.
export const lastOf = (keeper) =>
    new Promise((done) => {
        keeper.port.onmessage = ({ data }) => done(data);
        keeper.port.postMessage(null);
    });

// One channel as a file.
export function wavOf(samples, rate_hz, comment) {
    const said = new TextEncoder().encode(`${comment}\0`);
    const info = bytesOf(text("INFO"), chunk("ICMT", said));
    const format = bytesOf(u16(FLOAT), u16(1), u32(rate_hz), u32(4 * rate_hz), u16(4), u16(32), u16(0));
    const data = floats(samples);
    const parts = [chunk("fmt ", format), chunk("fact", u32(samples.length)), chunk("LIST", info), chunk("data", data)];
    return new Blob([chunk("RIFF", bytesOf(text("WAVE"), ...parts))], { type: "audio/wav" });
}

// The message that asks for the same as a file of phones and controllers. Its type is first, as long messages have it.
export function patternOf(format, samples, about) {
    const bytes = floats(samples);
    let letters = "";
    for (let at = 0; at < bytes.length; at += 0x8000) letters += String.fromCharCode(...bytes.subarray(at, at + 0x8000));
    return { type: "export", format, ...about, samples: btoa(letters) };
}

// 32-bit floats, little-endian.
function floats(samples) {
    const data = new DataView(new ArrayBuffer(4 * samples.length));
    samples.forEach((sample, i) => data.setFloat32(4 * i, sample, true));
    return new Uint8Array(data.buffer);
}

const text = (letters) => new TextEncoder().encode(letters);
const u16 = (value) => Uint8Array.of(value & 255, value >> 8);
const u32 = (value) => Uint8Array.of(value & 255, (value >> 8) & 255, (value >> 16) & 255, value >>> 24);

function bytesOf(...parts) {
    const whole = new Uint8Array(parts.reduce((sum, { length }) => sum + length, 0));
    parts.reduce((at, part) => (whole.set(part, at), at + part.length), 0);
    return whole;
}

const chunk = (name, content) => bytesOf(text(name), u32(content.length), content, new Uint8Array(content.length % 2));
