// What a plot shows of its signals, without drawing: single values, pairs of two signals, paths, and ranges of axes.
import { roundUp } from "./numbers.js";

const STEP_S = 0.004; // least time between two points
const LAST_S = 8; // a point is kept so long
const SAME = 1e-9; // of an interval: differences of computed times
const TIGHT = 0.35; // part of an axis below which its range narrows

// The value of a frame: a scalar's own, a vector's length, an event's if it happened.
export function valueOf(values, at, kind) {
    if (kind === "scalar") return values[at];
    if (kind === "event") return values[at] ? values[at + 1] : NaN;
    return Math.hypot(values[at], values[at + 1], values[at + 2]);
}

// The place of a frame seen from above; of a contact the proxy's, while it touches.
export function placeOf(values, at, kind) {
    if (kind !== "contact") return [values[at], values[at + 1]];
    return values[at] ? [values[at + 4], values[at + 5]] : [NaN, NaN];
}

// How many frames before the last of `trace` the latest at a time begins; negative if it has not come yet.
const backAt = (trace, time_s) => Math.ceil((trace.end_s - time_s) / trace.interval_s - 1 - SAME);

// The points of one curve, [x, y] with their times: new ones are added as samples come, old ones leave.
export class Points {
    constructor() {
        this.clear();
    }

    clear() {
        this.times = [];
        this.points = [];
        this.until_s = -Infinity;
    }

    // Each y with the latest x of its time; the rates may differ.
    takePairs(x, x_kind, y, y_kind) {
        this.#take(y, (at, time_s) => {
            const back = x.interval_s > 0 ? backAt(x, time_s) : -1;
            if (back < 0) return null;
            if (back >= x.count) return [NaN, NaN];
            return [valueOf(x.most, x.place(back), x_kind), valueOf(y.most, at, y_kind)];
        });
    }

    takePlaces(trace, kind) {
        this.#take(trace, (at) => placeOf(trace.most, at, kind));
    }

    // Adds the points of new frames until `point` has none yet.
    #take(trace, point) {
        if (trace.count === 0) return;
        if (trace.end_s < this.until_s) this.clear(); // another run
        const first_s = trace.end_s - trace.count * trace.interval_s;
        const from_s = Math.max(this.until_s + Math.max(STEP_S, trace.interval_s), first_s, trace.end_s - LAST_S);
        for (let time_s = from_s; time_s < trace.end_s - SAME; time_s += Math.max(STEP_S, trace.interval_s)) {
            const back = backAt(trace, time_s);
            if (back < 0) break;
            const found = point(trace.place(back), trace.end_s - (back + 1) * trace.interval_s);
            if (!found) break;
            this.times.push(time_s);
            this.points.push(found);
            this.until_s = time_s;
        }
        const old = this.times.findIndex((time_s) => time_s > trace.end_s - LAST_S);
        if (old > 0) [this.times, this.points] = [this.times.slice(old), this.points.slice(old)];
    }
}

// [low, high] of the finite numbers, null without any.
export function extentOf(values) {
    let [low, high] = [Infinity, -Infinity];
    for (const value of values) {
        if (value < low) low = value;
        if (value > high) high = value;
    }
    return low <= high ? [low, high] : null;
}

// True if a range is that of a constant.
export const isConstant = ([low, high]) => high - low <= 1e-6 * Math.max(Math.abs(low), Math.abs(high));

// A round range around [low, high]; `before` stays where it holds both and is not much too wide.
export function axisRange([low, high], before = null) {
    const fits = before && low >= before[0] && high <= before[1] && high - low > TIGHT * (before[1] - before[0]);
    if (fits) return before;
    if (low > 0 && low < 0.5 * high) low = 0;
    if (high < 0 && high > 0.5 * low) high = 0;
    const step = roundUp((high - low || Math.abs(high) || 1) / 5);
    const [first, last] = [Math.floor(low / step + SAME), Math.ceil(high / step - SAME)];
    return [first * step, Math.max(last, first + 1) * step];
}

// Two ranges of one scale around points: `width` by `height` pixels.
export function equalRanges([x_low, x_high], [y_low, y_high], width, height, before = null) {
    const holds = (range, [low, high]) => low >= range[0] && high <= range[1];
    const per_pixel = 1.12 * Math.max((x_high - x_low) / width, (y_high - y_low) / height, 1e-6);
    if (before && before.per_pixel < 2.5 * per_pixel && before.width === width && before.height === height) {
        if (holds(before.x, [x_low, x_high]) && holds(before.y, [y_low, y_high])) return before;
    }
    const around = (low, high, pixels) => [0.5 * (low + high - pixels * per_pixel), 0.5 * (low + high + pixels * per_pixel)];
    return { x: around(x_low, x_high, width), y: around(y_low, y_high, height), per_pixel, width, height };
}

// The frames of a plot over time: signals of one quantity share one; fast ones, which would hide each other, have their own.
export function framesOf(signals, fast_hz = 2000) {
    const frames = [];
    for (const signal of signals) {
        const isFast = signal.rate_hz >= fast_hz;
        const frame = frames.find(
            ([first]) => !isFast && first.rate_hz < fast_hz && first.unit === signal.unit && first.quantity === signal.quantity,
        );
        if (frame) frame.push(signal);
        else frames.push([signal]);
    }
    return frames;
}
