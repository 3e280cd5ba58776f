// The binary messages, little-endian, as in docs/studio-protocol.md.
const POINTERS = 1;
const SAMPLES = 2;
const SOUND = 3;
const POINTER_HEAD = 8;
const POINTER_BYTES = 28;

// Binary 1: the samples of a hand on a pad or input by its number, oldest first; `planned` ones are sent ahead of their times.
// `graph` is the number of the graph whose pads these are, 0 for any.
export function pointers(pad, samples, planned = false, graph = 0) {
    const view = new DataView(new ArrayBuffer(POINTER_HEAD + POINTER_BYTES * samples.length));
    view.setUint8(0, POINTERS);
    view.setUint8(1, pad);
    view.setUint16(2, samples.length, true);
    view.setUint8(4, Number(planned));
    view.setUint16(6, graph, true);
    samples.forEach((sample, i) => {
        const at = POINTER_HEAD + POINTER_BYTES * i;
        view.setFloat64(at, sample.time_ms, true);
        view.setFloat32(at + 8, sample.x_mm, true);
        view.setFloat32(at + 12, sample.y_mm, true);
        view.setFloat32(at + 16, sample.force_n, true);
        view.setFloat32(at + 20, sample.tilt_x_deg, true);
        view.setFloat32(at + 24, sample.tilt_y_deg, true);
    });
    return view.buffer;
}

// Binary 2 or 3 as an object; null for a message that this page does not know or that is cut short.
export function read(buffer) {
    if (buffer.byteLength < 16) return null;
    const view = new DataView(buffer);
    const kind = view.getUint8(0);
    const count = view.getUint32(4, true);
    const time_s = view.getFloat64(8, true);
    if (kind === SOUND && buffer.byteLength >= 16 + 4 * count) {
        return { kind: "sound", count, time_s, values: new Float32Array(buffer, 16, count) };
    }
    if (kind !== SAMPLES || buffer.byteLength < 24) return null;
    const lanes = view.getUint8(2);
    const thinned = view.getUint8(3) === 1;
    const numbers = count * lanes * (thinned ? 2 : 1);
    if (buffer.byteLength < 24 + 4 * numbers) return null;
    const interval_s = view.getFloat64(16, true);
    const values = new Float32Array(buffer, 24, numbers);
    return { kind: "samples", place: view.getUint8(1), lanes, thinned, count, time_s, interval_s, values };
}
