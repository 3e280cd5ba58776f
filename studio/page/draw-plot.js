// A plot that a graph names, live: signals over time, against another signal, or as paths seen from above.
import { make } from "./dom.js";
import { columnsOf, drawAxes, drawLane, LANE_INKS, rangeOf } from "./draw-time.js";
import { mostFrames } from "./frame.js";
import { quantity, scaleOf, ticks, tickText } from "./numbers.js";
import { axisRange, equalRanges, extentOf, framesOf, isConstant, Points, valueOf } from "./plotting.js";
import { colours, FONT, haloText, onTheme, Surface } from "./theme.js";

const INSET = { left: 48, right: 10, top: 20, bottom: 18 };
const LINE = 14; // px: height of a line of text
const LEAST_FRAME = 46; // px: height of a frame over time
const DASHES = [[], [7, 3], [2, 2.5], [9, 3, 2, 3], [4, 4], [1, 3]];
const AGES = 4; // steps in which points fade
const STILL = "Nothing moves";

// Draws `view` ({ title, form, signals }) into `fill`; returns { end, moves }.
export function plotView(studio, { fill, say }, view) {
    const canvas = make("canvas", {
        role: "img",
        "aria-label": `${view.title}: ${view.signals.map(({ label }) => label).join(", ")}`,
    });
    fill.append(canvas);
    const traces = view.signals.map(({ name, rate_hz, kind }) => studio.taps.watch(name, kind === "event" && rate_hz > 4000));
    const plot = { view, traces }; // during a pause, copies
    plot.curves = view.signals.map(() => new Points());
    let drawn = null; // samples that the drawing has; null where it has to be drawn again
    const again = () => (drawn = null);
    const surface = new Surface(canvas, again);
    const ends = [onTheme(again), mostFrames(draw)];
    if (traces.includes(null)) say("At most sixteen ports can be shown: remove a scope");
    function draw() {
        const { span_s, isPaused } = studio.scopeWindow();
        const now = traces.reduce((sum, trace) => sum + (trace?.written ?? 0), 0) + span_s / 1000;
        if (isPaused) plot.traces = plot.traces === traces ? traces.map((trace) => trace?.copy() ?? null) : plot.traces;
        else plot.traces = traces;
        if (drawn !== null && (now === drawn || isPaused)) return;
        const context = surface.begin();
        if (!context) return;
        drawn = now;
        if (!isPaused || plot.end_s === undefined) plot.end_s = studio.taps.now_s() - 0.04;
        plot.span_s = span_s;
        plot.ahead_s = (trace) => studio.taps.ahead_s(trace); // each signal by its own driver
        plot.moves = DRAW[view.form](context, surface, plot);
    }
    const picture = { surfaces: [surface], draw: () => (again(), draw()) };
    const end = () => {
        for (const each of ends) each();
        surface.end();
        for (const trace of traces) studio.taps.release(trace);
    };
    return { end, picture, moves: () => drawn !== null && plot.moves };
}

const inkOf = (number) => colours[LANE_INKS[number % LANE_INKS.length]];
const capitalised = (text) => text.charAt(0).toUpperCase() + text.slice(1);
const labelled = (text, unit) => (unit ? `${capitalised(text)} (${unit})` : capitalised(text));
const nameOf = (signals) => (signals.length === 1 ? signals[0].label : (signals[0].quantity ?? "value"));

function still(context, box, text) {
    context.font = FONT;
    context.fillStyle = colours.soft;
    context.textAlign = "center";
    const middle = box.left + box.width / 2;
    const lines = wrapped(context, text, box.width - 12);
    lines.forEach((line, i) => context.fillText(line, middle, box.top + box.height / 2 + 4 + 15 * (i - (lines.length - 1) / 2)));
    context.textAlign = "left";
    return false;
}

function wrapped(context, text, width) {
    const lines = [""];
    for (const word of text.split(" ")) {
        const longer = lines.at(-1) ? `${lines.at(-1)} ${word}` : word;
        if (lines.at(-1) && context.measureText(longer).width > width) lines.push(word);
        else lines[lines.length - 1] = longer;
    }
    return lines;
}

// The label of the vertical axis, then each name beside the mark of its curve, in rows; the rest of their height.
function drawLegend(context, top, width, label, entries, mark) {
    context.font = FONT;
    context.fillStyle = colours.soft;
    context.fillText(label, 8, top + 11);
    let x = Math.max(INSET.left, 16 + context.measureText(label).width);
    let more = 0;
    if (entries.length === 1 && label.toLowerCase().startsWith(entries[0].label.toLowerCase())) return more;
    entries.forEach(({ label: name, number }, place) => {
        const needed = 24 + context.measureText(name).width;
        if (x + needed > width - 4 && x > INSET.left) [x, more] = [INSET.left, more + LINE];
        mark(context, x, top + 7 + more, number, place);
        context.fillStyle = colours.ink;
        context.fillText(name, x + 20, top + 11 + more);
        x += needed + 10;
    });
    return more;
}

function markLine(context, x, y, number, place) {
    context.strokeStyle = inkOf(number);
    context.lineWidth = 2;
    context.setLineDash(DASHES[place % DASHES.length]);
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(x + 16, y);
    context.stroke();
    context.setLineDash([]);
}

// Over time: frames below each other, each with the signals of one quantity.
function drawOverTime(context, surface, plot) {
    const { view, traces, span_s } = plot;
    if (view.signals.length === 0) return still(context, whole(surface), `${STILL} yet: stroke the pad`);
    plot.frames ??= framesOf(view.signals.map((signal, number) => ({ ...signal, number })));
    plot.memory ??= plot.frames.map(() => ({}));
    const room = surface.height - INSET.bottom;
    const shown = plot.frames.slice(0, Math.max(1, Math.floor(room / LEAST_FRAME)));
    const each = room / shown.length;
    const width = surface.width - INSET.left - INSET.right;
    const frames = shown.map((all, row) => {
        const box = { left: INSET.left, top: row * each + 17, width, height: each - 17 - (row < shown.length - 1 ? 6 : 0) };
        const signals = all.filter(({ number }) => traces[number]?.lanes);
        const columns = ({ number, kind }) =>
            columnsOf(traces[number], plot.end_s + plot.ahead_s(traces[number]), span_s, Math.max(1, Math.floor(width)), (values, at) =>
                valueOf(values, at, kind),
            );
        const curves = signals.map(columns);
        return { box, signals, curves, constants: constantsOf(signals, curves), memory: plot.memory[row] };
    });
    const constants = frames.map((frame) => frame.constants);
    if (!constants.includes(null))
        return still(context, whole(surface), `${STILL}: ${constants.filter(Boolean).join(", ") || "no data yet"}`);
    frames.forEach((frame, row) => drawFrame(context, frame, surface.width, row === frames.length - 1 ? span_s : null));
    return true;
}

const whole = ({ width, height }) => ({ left: 0, top: 0, width, height });

// The values of signals that are all constant, as text; null if one moves.
function constantsOf(signals, curves) {
    const ranges = curves.map(({ low, high }) => extentOf([extentOf(low[0]), extentOf(high[0])].filter(Boolean).flat()));
    if (ranges.some((range) => range && !isConstant(range))) return null;
    const value = ({ kind, unit }, range) => (range ? quantity(range[0], unit) : kind === "event" ? "none" : "no data yet");
    return signals.map((signal, i) => `${signal.label} ${value(signal, ranges[i])}`).join(", ");
}

// A frame over time; the last one, with `span_s`, has the times.
function drawFrame(context, { box, signals, curves, constants, memory }, width, span_s) {
    if (constants !== null) return still(context, { ...box, left: 0, width, top: box.top - 10 }, `Constant: ${constants}`);
    const { unit, kind } = signals[0];
    memory.least ??= 1e-9;
    const low = curves.map((curve) => curve.low[0]);
    const range = rangeOf({ low, high: curves.map((curve) => curve.high[0]) }, memory, null, 1, 0.985);
    const scale = scaleOf(unit, Math.max(Math.abs(range[0]), range[1]));
    const below = drawLegend(context, box.top - 16, width, labelled(nameOf(signals), scale.unit), signals, markLine);
    [box.top, box.height] = [box.top + below, Math.max(8, box.height - below)];
    const y = (value) => box.top + (box.height * (range[1] - value)) / (range[1] - range[0]);
    drawAxes(context, box, range, { ...scale, unit: "" }, span_s ? [`−${span_s} s`, "now"] : ["", ""], y);
    context.save();
    context.beginPath();
    context.rect(box.left, box.top - 1, box.width, box.height + 2);
    context.clip();
    for (let i = curves.length - 1; i >= 0; i--) {
        const { number } = signals[i];
        if (kind === "event") drawEvents(context, box, curves[i], y, inkOf(number));
        else drawLane(context, box, curves[i], 0, y, inkOf(number), signals[i].rate_hz < 2000 ? DASHES[i % DASHES.length] : []);
    }
    context.restore();
}

function drawEvents(context, box, { high, first, last }, y, ink) {
    context.fillStyle = ink;
    for (let x = first; x <= last; x++) {
        if (Number.isNaN(high[0][x])) continue;
        const [at, foot] = [y(high[0][x]), y(0)];
        context.fillRect(box.left + x, Math.min(at, foot), 1.5, Math.abs(foot - at));
        context.beginPath();
        context.arc(box.left + x + 0.7, at, 3, 0, 2 * Math.PI);
        context.fill();
    }
}

// Signals against the first: each dot is one moment.
function drawAgainst(context, surface, plot) {
    const [x, ...ys] = plot.view.signals;
    ys.forEach(({ kind }, i) => {
        if (plot.traces[0] && plot.traces[i + 1]) plot.curves[i].takePairs(plot.traces[0], x.kind, plot.traces[i + 1], kind);
    });
    const points = plot.curves.flatMap((curve) => curve.points);
    const [across, up] = [0, 1].map((lane) => extentOf(points.map((point) => point[lane])));
    if (!across || !up) return still(context, whole(surface), "No data yet");
    if (isConstant(across) && isConstant(up)) {
        const both = [
            [x, across],
            [ys[0], up],
        ].map(([{ label, unit }, [value]]) => `${label} ${quantity(value, unit)}`);
        return still(context, whole(surface), `${STILL}: ${both.join(", ")}`);
    }
    [plot.across, plot.up] = [axisRange(across, plot.across), axisRange(up, plot.up)];
    const frame = axesOf(context, surface, plot.across, plot.up, x.unit, ys[0].unit);
    drawLegend(
        context,
        2,
        surface.width,
        labelled(nameOf(ys), frame.y_scale.unit),
        ys.map(({ label }, number) => ({ label, number })),
        (...at) => markDot(context, at[1] + 8, at[2], at[3], 3),
    );
    nameAcross(context, surface, labelled(x.label, frame.x_scale.unit));
    plot.curves.slice(0, ys.length).forEach((curve, number) => drawDots(context, frame, curve, number));
    return true;
}

// Paths seen from above, both axes in one scale.
function drawPath(context, surface, plot) {
    const { signals } = plot.view;
    signals.forEach(({ kind }, i) => plot.traces[i] && plot.curves[i].takePlaces(plot.traces[i], kind));
    const points = plot.curves.flatMap((curve) => curve.points);
    const [across, up] = [0, 1].map((lane) => extentOf(points.map((point) => point[lane])));
    const unit = signals[0].kind === "contact" ? "m" : signals[0].unit;
    if (!across) return still(context, whole(surface), "No contact: press the pad");
    if (isConstant(across) && isConstant(up)) {
        const [x, y] = [across, up].map(([value]) => quantity(value, unit));
        return still(context, whole(surface), `${STILL}: ${signals[0].label} at x ${x}, y ${y}`);
    }
    const box = boxIn(surface);
    plot.ranges = equalRanges(across, up, box.width, box.height, plot.ranges);
    const frame = axesOf(context, surface, plot.ranges.x, plot.ranges.y, unit, unit);
    drawLegend(
        context,
        2,
        surface.width,
        `y (${frame.y_scale.unit})`,
        signals.map(({ label }, number) => ({ label, number })),
        markLine,
    );
    nameAcross(context, surface, `x (${frame.x_scale.unit})`);
    plot.curves.forEach((curve, number) => drawTrack(context, frame, curve, number));
    return true;
}

const DRAW = { time: drawOverTime, xy: drawAgainst, path: drawPath };

const boxIn = (surface) => ({
    left: INSET.left,
    top: INSET.top,
    width: surface.width - INSET.left - INSET.right,
    height: surface.height - INSET.top - INSET.bottom - 12,
});

// Two axes with grid lines and numbers; where each value is.
function axesOf(context, surface, [x_low, x_high], [y_low, y_high], x_unit, y_unit) {
    const box = boxIn(surface);
    const size = (low, high) => Math.max(Math.abs(low), Math.abs(high));
    const [x_scale, y_scale] = [scaleOf(x_unit, size(x_low, x_high)), scaleOf(y_unit, size(y_low, y_high))];
    const x = (value) => box.left + (box.width * (value - x_low)) / (x_high - x_low);
    const y = (value) => box.top + (box.height * (y_high - value)) / (y_high - y_low);
    context.lineWidth = 1;
    context.font = FONT;
    const line = (value, ...ends) => {
        context.strokeStyle = value === 0 ? colours.axis : colours.grid;
        context.beginPath();
        context.moveTo(ends[0], ends[1]);
        context.lineTo(ends[2], ends[3]);
        context.stroke();
        context.fillStyle = colours.soft;
    };
    context.textAlign = "center";
    eachTick(x_low * x_scale.factor, x_high * x_scale.factor, box.width / 52, (value, text) => {
        const at = Math.round(x(value / x_scale.factor)) + 0.5;
        line(value, at, box.top, at, box.top + box.height);
        context.fillText(text, at, box.top + box.height + 14);
    });
    context.textAlign = "right";
    eachTick(y_low * y_scale.factor, y_high * y_scale.factor, box.height / 30, (value, text) => {
        const at = Math.round(y(value / y_scale.factor)) + 0.5;
        line(value, box.left, at, box.left + box.width, at);
        context.fillText(text, box.left - 6, at + 4);
    });
    context.textAlign = "left";
    return { box, x, y, x_scale, y_scale };
}

function eachTick(low, high, count, draw) {
    const marks = ticks(low, high, Math.max(2, Math.min(8, count)));
    const step = marks.length > 1 ? marks[1] - marks[0] : 1;
    for (const mark of marks) draw(mark, tickText(mark, step).replace("-", "−"));
}

function nameAcross(context, surface, text) {
    context.textAlign = "right";
    haloText(context, text, surface.width - INSET.right, surface.height - 3, colours.soft, colours.panel);
    context.textAlign = "left";
}

// A dot; its shape tells curves apart too.
function markDot(context, x, y, number, radius) {
    context.fillStyle = inkOf(number);
    if (number % 3 === 0) return context.fillRect(x - radius / 2, y - radius / 2, radius, radius);
    context.beginPath();
    if (number % 3 === 1) context.arc(x, y, radius * 0.8, 0, 2 * Math.PI);
    else
        for (const [dx, dy] of [
            [0, -1],
            [1, 1],
            [-1, 1],
        ])
            context.lineTo(x + radius * dx, y + radius * dy);
    context.fill();
}

// Points in steps of age, the latest strongest.
function eachAge({ points }, draw) {
    for (let age = 0; age < AGES; age++) {
        const from = Math.floor((points.length * age) / AGES);
        draw(points.slice(Math.max(0, from - 1), Math.floor((points.length * (age + 1)) / AGES)), (age + 1) / AGES);
    }
}

function drawDots(context, { x, y }, curve, number) {
    eachAge(curve, (points, part) => {
        context.globalAlpha = 0.15 + 0.6 * part ** 2;
        for (const [across, up] of points) markDot(context, x(across), y(up), number, 2.4);
    });
    context.globalAlpha = 1;
    const last = curve.points.at(-1);
    if (last && Number.isFinite(last[1])) markDot(context, x(last[0]), y(last[1]), number, 7);
}

function drawTrack(context, { x, y }, curve, number) {
    context.strokeStyle = inkOf(number);
    context.lineWidth = 1.5;
    context.lineJoin = "round";
    context.setLineDash(DASHES[number % DASHES.length]);
    eachAge(curve, (points, part) => {
        context.globalAlpha = 0.2 + 0.8 * part ** 2;
        context.beginPath();
        let isDown = false;
        for (const [across, up] of points) {
            if (Number.isFinite(across)) context[isDown ? "lineTo" : "moveTo"](x(across), y(up));
            isDown = Number.isFinite(across);
        }
        context.stroke();
    });
    context.setLineDash([]);
    context.globalAlpha = 1;
    const last = curve.points.at(-1);
    if (last && Number.isFinite(last[0])) markDot(context, x(last[0]), y(last[1]), number, 7);
}
