// A scope over time: minimum and maximum of every pixel column, so that no peak is lost.
import { roundUp, scaleOf, tickText, ticks } from "./numbers.js";
import { colours, haloText } from "./theme.js";

const INSET = { left: 46, right: 6, top: 5, bottom: 17 };
const NARROWER = 0.985;
export const LANE_INKS = ["ink0", "ink1", "ink2", "ink3", "ink4", "ink5"];

// Smallest range of an axis: the noise of a signal at rest does not fill a scope.
const LEAST_SHOWN = { m: 0.005, "m/s": 0.01, N: 0.05, "m/s²": 0.05, A: 1e-3, V: 1e-3 };

// The box of a plot in a scope's canvas.
export const boxOf = (surface) => ({
    left: INSET.left,
    top: INSET.top,
    width: surface.width - INSET.left - INSET.right,
    height: surface.height - INSET.top - INSET.bottom,
});

// Draws `trace` from `end_s - span_s` to `end_s`. `memory` keeps the range between frames; `limits` are the actuator's.
export function drawTime(context, surface, { trace, end_s, back_s, span_s, memory, limits, port, zoom, paused }) {
    const box = boxOf(surface);
    const columns = columnsOf(trace, end_s, span_s, Math.max(1, Math.floor(box.width)));
    memory.least ??= LEAST_SHOWN[port.unit] ?? 1e-6;
    const range = rangeOf(columns, memory, limits, zoom, paused ? 1 : NARROWER);
    const scale = scaleOf(port.unit, Math.max(Math.abs(range[0]), range[1]));
    const y = (value) => box.top + (box.height * (range[1] - value)) / (range[1] - range[0]);
    drawAxes(context, box, range, scale, [ago(span_s + back_s), back_s > 0 ? ago(back_s) : paused ? "pause" : "now"], y);
    if (limits) drawLimits(context, box, range, limits, y);
    context.save();
    context.beginPath();
    context.rect(box.left, box.top - 1, box.width, box.height + 2);
    context.clip();
    for (let lane = trace.lanes - 1; lane >= 0; lane--) drawLane(context, box, columns, lane, y);
    drawFaults(context, box, columns);
    context.restore();
    if (trace.lanes > 1) drawNames(context, box, port.lanes);
}

// Minimum and maximum of each column for every component, NaN without samples; and the columns that hold both NaN and
// numbers.
// With `value` of its own (of a frame in a ring) there is one component.
export function columnsOf(trace, end_s, span_s, width, value = null) {
    const lanes = value ? 1 : trace.lanes;
    const low = Array.from({ length: lanes }, () => new Float32Array(width).fill(NaN));
    const high = low.map((lane) => new Float32Array(lane));
    let first = 0,
        last = 0;
    const faults = new Set();
    const scale = width / span_s;
    for (let back = 0; back < trace.count; back++) {
        const x = Math.floor((trace.end_s - (back + 1) * trace.interval_s - end_s + span_s) * scale);
        if (x >= width) continue;
        if (x < 0) break;
        const at = trace.place(back);
        for (let lane = 0; lane < lanes; lane++) {
            let least = value ? value(trace.least, at) : trace.least[at + lane];
            let most = value ? value(trace.most, at) : trace.most[at + lane];
            if (least > most) [least, most] = [most, least]; // lengths of thinned vectors
            const [under, over] = Number.isNaN(least) ? [most, most] : [least, most];
            if (under < low[lane][x] || Number.isNaN(low[lane][x])) low[lane][x] = under;
            if (over > high[lane][x] || Number.isNaN(high[lane][x])) high[lane][x] = over;
            if (Number.isNaN(least) && !Number.isNaN(most)) faults.add(x);
        }
        last = Math.max(last, x);
        first = x;
    }
    return { low, high, first, last, faults, sparse: trace.interval_s * scale > 0.9 };
}

// The range of the axis follows the visible samples: wider at once, narrower by at most the factor `narrower` per
// frame.
export function rangeOf({ low, high }, memory, limits, zoom, narrower) {
    let [least, most] = [0, 0];
    low.forEach((lane) => lane.forEach((value) => value < least && (least = value)));
    high.forEach((lane) => lane.forEach((value) => value > most && (most = value)));
    const two = least < -0.05 * most;
    const wanted = Math.max(most, -least);
    memory.size = Math.max(wanted, (memory.size ?? 0) * narrower, limits ? limits.peak * 1e-3 : memory.least);
    memory.two = two || (memory.two && wanted < memory.size * 0.2);
    const size = roundUp(memory.size * 1.02) / zoom;
    return memory.two ? [-size, size] : [least < 0 ? -size * 0.05 : 0, size];
}

const ago = (time_s) => (time_s < 1 ? `−${Math.round(time_s * 1000)} ms` : `−${Number(time_s.toFixed(2))} s`);

export function drawAxes(context, box, range, scale, [start, end], y) {
    context.lineWidth = 1;
    context.textAlign = "right";
    const [low, high] = range.map((value) => value * scale.factor);
    const marks = ticks(low, high, Math.max(2, box.height / 34));
    const step = marks.length > 1 ? marks[1] - marks[0] : 1;
    for (const mark of marks) {
        const at = Math.round(y(mark / scale.factor)) + 0.5;
        context.strokeStyle = mark === 0 ? colours.axis : colours.grid;
        context.beginPath();
        context.moveTo(box.left, at);
        context.lineTo(box.left + box.width, at);
        context.stroke();
        context.fillStyle = colours.soft;
        context.fillText(
            tickText(mark, step).replace("-", "−"),
            box.left - 6,
            Math.max(box.top + 8, Math.min(at + 4, box.top + box.height + 2)),
        );
    }
    context.textAlign = "left";
    context.fillText(scale.unit, 6, box.top + box.height + 14);
    context.textAlign = "right";
    context.fillText(end, box.left + box.width, box.top + box.height + 14);
    context.textAlign = "left";
    const unitEnd = 12 + context.measureText(scale.unit).width;
    context.fillText(start, Math.max(box.left - 8, unitEnd), box.top + box.height + 14);
}

// The peak limit as a line, the continuous one dashed, if they lie within the axis.
function drawLimits(context, box, range, limits, y) {
    context.strokeStyle = colours.bad;
    context.lineWidth = 1.2;
    for (const [value, dash] of [
        [limits.peak, []],
        [-limits.peak, []],
        [limits.continuous, [5, 4]],
        [-limits.continuous, [5, 4]],
    ]) {
        if (!value || value > range[1] || value < range[0]) continue;
        context.setLineDash(dash);
        context.beginPath();
        context.moveTo(box.left, y(value));
        context.lineTo(box.left + box.width, y(value));
        context.stroke();
    }
    context.setLineDash([]);
}

export function drawLane(
    context,
    box,
    { low, high, first, last, sparse },
    lane,
    y,
    ink = colours[LANE_INKS[lane % LANE_INKS.length]],
    dash = [],
) {
    context.beginPath();
    let pen = false;
    for (let x = first; x <= last; x++) {
        const [least, most] = [low[lane][x], high[lane][x]];
        if (Number.isNaN(most)) {
            pen = pen && sparse;
            continue;
        }
        const at = box.left + x + 0.5;
        context[pen ? "lineTo" : "moveTo"](at, y(most));
        if (least !== most) context.lineTo(at, y(least));
        pen = true;
    }
    context.strokeStyle = ink;
    context.lineWidth = 1.3;
    context.lineJoin = "round";
    context.setLineDash(dash);
    context.stroke();
    context.setLineDash([]);
}

// Marks of NaN.
function drawFaults(context, box, { faults }) {
    context.fillStyle = colours.bad;
    for (const x of faults) context.fillRect(box.left + x - 1, box.top, 3, box.height);
}

function drawNames(context, box, names) {
    let x = box.left + 6;
    names.forEach((name, lane) => {
        context.fillStyle = colours[LANE_INKS[lane % LANE_INKS.length]];
        context.fillRect(x, box.top + 4, 8, 8);
        haloText(context, name, x + 12, box.top + 11, colours.ink, colours.box);
        x += context.measureText(name).width + 24;
    });
}
