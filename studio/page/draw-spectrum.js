// A scope over frequency: density in decibels, averaged, with the peaks of the last seconds above it; and its picture over time.
import { boxOf } from "./draw-time.js";
import { density } from "./fft.js";
import { colours, haloText } from "./theme.js";

const LARGEST = 4096;
const LEAST_HZ = 10;
const EVERY_MS = 40;
const AVERAGE = 0.3;
const PEAK_FALL_DB = 0.25;
const SPAN_DB = 80;
const HEAT = [
    [0, 0, 4],
    [24, 15, 61],
    [68, 15, 118],
    [114, 31, 129],
    [158, 47, 127],
    [205, 64, 113],
    [241, 96, 93],
    [253, 150, 104],
    [254, 202, 141],
    [252, 253, 191],
];

// Takes the newest samples, or those that end `back_s` earlier, into `memory` if an update is due; true if there is a
// spectrum.
function measure(trace, memory, now_ms, back_s = 0) {
    if (memory.density && now_ms - memory.at_ms < EVERY_MS && memory.back_s === back_s) return true;
    const back = Math.round(back_s / (trace.interval_s || 1));
    const size = Math.min(
        LARGEST,
        2 ** Math.floor(Math.log2(Math.max(1, trace.count - back))),
        2 ** Math.ceil(Math.log2(0.2 / (trace.interval_s || 1))),
    );
    if (size < 32) return false;
    const samples = new Float64Array(size);
    for (let i = 0; i < size; i++) samples[i] = trace.most[trace.place(back + size - 1 - i)] || 0;
    const fresh = density(samples, 1 / trace.interval_s);
    if (memory.density?.length !== fresh.length || back_s > 0 || memory.back_s > 0)
        [memory.density, memory.peaks, memory.history] = [fresh, fresh.map(decibels), []];
    memory.at_ms = now_ms;
    memory.back_s = back_s;
    memory.bin_hz = 1 / (trace.interval_s * size);
    fresh.forEach((value, i) => {
        memory.density[i] += AVERAGE * (value - memory.density[i]);
        memory.peaks[i] = Math.max(memory.peaks[i] - PEAK_FALL_DB, decibels(memory.density[i]));
    });
    memory.fresh = fresh;
    memory.fresh_count = (memory.fresh_count ?? 0) + 1;
    return true;
}

const decibels = (power) => 10 * Math.log10(Math.max(power, 1e-30));

// Frequency axis: logarithmic from 10 Hz (or the lowest bin) to half the rate.
function axisOf(box, memory) {
    const most_hz = memory.bin_hz * (memory.density.length - 1),
        least_hz = Math.max(LEAST_HZ, memory.bin_hz);
    const range = Math.log(most_hz / least_hz);
    return {
        least_hz,
        most_hz,
        x: (hz) => box.left + (box.width * Math.log(hz / least_hz)) / range,
        hz: (x) => least_hz * Math.exp(((x - box.left) / box.width) * range),
    };
}

// Largest of `values` between two frequencies; between bins, the line from one to the next.
function largest(values, low_hz, high_hz, bin_hz) {
    const [a, b] = [low_hz / bin_hz, high_hz / bin_hz];
    const i = Math.floor(a);
    let most = values[i] + (a - i) * ((values[i + 1] ?? values[i]) - values[i]);
    for (let k = Math.ceil(a); k <= b && k < values.length; k++) most = Math.max(most, values[k]);
    return most;
}

export function drawSpectrum(context, surface, { trace, memory, now_ms, back_s, port, zoom }) {
    if (!measure(trace, memory, now_ms, back_s)) return waiting(context, surface);
    const box = boxOf(surface),
        axis = axisOf(box, memory);
    const level = memory.density.map(decibels);
    const top = topOf(memory, level),
        span = SPAN_DB / zoom;
    const y = (db) => box.top + box.height * Math.min(1, Math.max(0, (top - db) / span));
    drawFrame(context, box, axis, top, span, y, port.unit);
    const curve = (values) => {
        context.beginPath();
        for (let x = box.left; x < box.left + box.width; x++) {
            context[x === box.left ? "moveTo" : "lineTo"](x, y(largest(values, axis.hz(x), axis.hz(x + 1), memory.bin_hz)));
        }
    };
    curve(memory.peaks);
    context.strokeStyle = colours.ink1;
    context.globalAlpha = 0.6;
    context.lineWidth = 1;
    context.stroke();
    context.globalAlpha = 1;
    curve(level);
    context.strokeStyle = colours.ink0;
    context.lineWidth = 1.4;
    context.stroke();
    context.lineTo(box.left + box.width, box.top + box.height);
    context.lineTo(box.left, box.top + box.height);
    context.fillStyle = colours.ink0;
    context.globalAlpha = 0.14;
    context.fill();
    context.globalAlpha = 1;
}

// The upper end: ten decibels above the largest, in steps of ten, slow to come down.
function topOf(memory, level) {
    let most = -300;
    for (let i = 1; i < level.length; i++) most = Math.max(most, memory.peaks[i]);
    const wanted = 10 * Math.ceil((Math.max(most, -160) + 3) / 10);
    memory.top = Math.max(wanted, memory.top ?? wanted);
    memory.top = memory.top > wanted + 10 ? memory.top - 10 : memory.top;
    return memory.top;
}

function drawFrame(context, box, axis, top, span, y, unit) {
    context.lineWidth = 1;
    context.strokeStyle = colours.grid;
    context.fillStyle = colours.soft;
    context.textAlign = "right";
    const step = span / box.height > 0.9 ? 40 : 20;
    for (let db = step * Math.floor(top / step); db >= top - span; db -= step) {
        horizontal(context, box, y(db));
        context.fillText(String(db).replace("-", "−"), box.left - 6, Math.max(y(db) + 4, box.top + 8));
    }
    context.textAlign = "left";
    context.fillText("dB", 6, box.top + box.height + 14);
    drawFrequencies(context, box, axis);
    context.textAlign = "right";
    haloText(context, `re ${reference(unit)}`, box.left + box.width - 4, box.top + 11, colours.soft, colours.box);
    context.textAlign = "left";
}

function drawFrequencies(context, box, axis) {
    context.textAlign = "center";
    for (let decade = 10; decade < axis.most_hz; decade *= 10) {
        for (let k = 1; k < 10; k++) {
            const x = axis.x(k * decade);
            if (x < box.left - 1 || x > box.left + box.width) continue;
            context.globalAlpha = k === 1 ? 1 : 0.45;
            context.beginPath();
            context.moveTo(Math.round(x) + 0.5, box.top);
            context.lineTo(Math.round(x) + 0.5, box.top + box.height);
            context.stroke();
            context.globalAlpha = 1;
            if (k === 1)
                context.fillText(
                    decade >= 1000 ? `${decade / 1000} kHz` : `${decade} Hz`,
                    Math.max(x, box.left + 12),
                    box.top + box.height + 14,
                );
        }
    }
}

function horizontal(context, box, y) {
    context.beginPath();
    context.moveTo(box.left, Math.round(y) + 0.5);
    context.lineTo(box.left + box.width, Math.round(y) + 0.5);
    context.stroke();
}

function waiting(context, surface) {
    context.fillStyle = colours.soft;
    context.fillText("waiting for samples", 12, surface.height / 2);
}

// The spectra of the last seconds, a column each, dark to bright over 70 dB.
export function drawSpectrogram(context, surface, { trace, memory, now_ms, paused }) {
    const before = memory.fresh_count;
    if (!measure(trace, memory, now_ms)) return waiting(context, surface);
    const box = boxOf(surface),
        axis = axisOf(box, memory);
    const picture = pictureOf(memory, Math.max(1, Math.floor(box.width / 2)), Math.max(1, Math.floor(box.height)));
    if (memory.fresh_count !== before) addColumn(picture, memory, axis, box);
    context.imageSmoothingEnabled = false;
    context.drawImage(picture.canvas, box.left, box.top, box.width, box.height);
    context.fillStyle = colours.soft;
    context.textAlign = "right";
    for (let hz = 10; hz < axis.most_hz; hz *= 10) {
        const y = box.top + box.height * (1 - (axis.x(hz) - box.left) / box.width);
        if (y < box.top + box.height + 1)
            context.fillText(hz >= 1000 ? `${hz / 1000} k` : String(hz), box.left - 6, Math.min(y + 4, box.top + box.height));
    }
    context.textAlign = "left";
    context.fillText("Hz", 6, box.top + box.height + 14);
    context.fillText(`−${Math.round((picture.canvas.width * EVERY_MS) / 1000)} s`, box.left, box.top + box.height + 14);
    context.textAlign = "right";
    context.fillText(paused ? "pause" : "now", box.left + box.width, box.top + box.height + 14);
    context.textAlign = "left";
}

function pictureOf(memory, width, height) {
    if (memory.picture?.canvas.width !== width || memory.picture.canvas.height !== height) {
        const canvas = document.createElement("canvas");
        [canvas.width, canvas.height] = [width, height];
        const context = canvas.getContext("2d");
        context.fillStyle = `rgb(${HEAT[0].join(" ")})`;
        context.fillRect(0, 0, width, height);
        memory.picture = { canvas, context };
    }
    return memory.picture;
}

function addColumn({ canvas, context }, memory, axis, box) {
    context.drawImage(canvas, -1, 0);
    const column = context.createImageData(1, canvas.height);
    const level = memory.fresh.map(decibels);
    memory.brightest = Math.max(
        level.reduce((a, b) => Math.max(a, b), -160),
        (memory.brightest ?? -160) - 0.05,
    );
    for (let row = 0; row < canvas.height; row++) {
        const at = (i) => axis.hz(box.left + (box.width * (canvas.height - row - i)) / canvas.height);
        const x = 1 - (memory.brightest - largest(level, at(1), at(0), memory.bin_hz)) / 70;
        const place = Math.min(1, Math.max(0, x)) * (HEAT.length - 1);
        const below = Math.min(HEAT.length - 2, Math.floor(place));
        HEAT[below].forEach((a, k) => (column.data[4 * row + k] = a + (HEAT[below + 1][k] - a) * (place - below)));
        column.data[4 * row + 3] = 255;
    }
    context.putImageData(column, canvas.width - 1, 0);
}

// 1 A²/Hz, 1 (m/s²)²/Hz, and 1/Hz where there is no unit.
function reference(unit) {
    if (!unit) return "1/Hz";
    return /^\p{Letter}+$/u.test(unit) ? `1 ${unit}²/Hz` : `1 (${unit})²/Hz`;
}
