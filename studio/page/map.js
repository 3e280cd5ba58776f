// The force-speed plane of a texture, with the axes of the reports: its triangles and models, the hand's point in it with the
// weights of the three models, its trail.
import { make } from "./dom.js";
import { mostFrames } from "./frame.js";
import { axesFor, isBeyond, isExtrapolated, locate } from "./locate.js";
import { ticks } from "./numbers.js";
import { colours, FONT, FONT_STRONG, haloText, onTheme, Surface } from "./theme.js";

const INSET = { left: 44, right: 16, top: 26, bottom: 34 };
const TRAIL_MS = 4000;
const TRAIL_STEPS = 12; // of fading
const LIFTED_MS = 120; // between two points of the trail: the hand was away
const BARELY = 0.005; // m/s and N below which there is no vibration and no point
const WIDE = 520; // px: room for the weights as text
const MARGIN = 1.05; // beyond the largest speed and force
const DOTS = {
    measured: ["ink0", 3, "recorded"],
    fitted: ["ink0", 2, "within what was recorded"],
    edge: ["faint", 1.6, "beyond it"],
};

export function mapView(studio, { fill, say }, { map }) {
    const label = "Force over speed with the triangles of models, what was recorded, and the point of the hand";
    const canvases = [make("canvas", { "aria-hidden": "true" }), make("canvas", { role: "img", "aria-label": label })];
    fill.append(...canvases);
    const traces = [map.speed_port, map.force_port].map((port) => port && studio.taps.watch(port));
    const view = { map, traces, trail: [], plot: null, most: axesFor(map, []) };
    const again = () => (view.plot = null); // the ground has to be drawn
    const [ground, surface] = canvases.map((canvas) => new Surface(canvas, again));
    const ends = [onTheme(again), mostFrames((now_ms) => draw(studio, ground, surface, view, say, now_ms))];
    const picture = { surfaces: [ground, surface], draw: () => (again(), draw(studio, ground, surface, view, say, performance.now())) };
    studio.mapPoint = () => view.trail.at(-1) ?? null;
    const end = () => {
        for (const each of ends) each();
        for (const each of [ground, surface]) each.end();
        for (const trace of traces) studio.taps.release(trace);
    };
    return { end, picture, moves: () => view.trail.length > 1 };
}

function draw(studio, ground, surface, view, say, now_ms) {
    const { isPaused } = studio.scopeWindow();
    if (view.plot && isPaused) return;
    now_ms = view.now_ms = isPaused ? (view.now_ms ?? now_ms) : now_ms;
    const [speed, force] = view.traces.map((trace) => trace?.latest() ?? NaN);
    const touching = (studio.runs || isPaused) && force > BARELY && Number.isFinite(speed);
    if (touching && !isPaused) view.trail.push({ speed, force, now_ms });
    while (view.trail.length && now_ms - view.trail[0].now_ms > TRAIL_MS) view.trail.shift();
    const most = axesFor(view.map, view.trail);
    if (most.some((value, axis) => value !== view.most[axis])) Object.assign(view, { most, plot: null });
    view.plot ??= drawGround(ground, view);
    const found = touching ? locate(view.map, speed, force) : null;
    say(touching ? said(view.map, found, speed, force, ground.width > WIDE) : "Touch the pad: the point appears");
    const empty = view.trail.length === 0;
    const context = empty && view.empty ? null : surface.begin(); // nothing is painted while nothing moves
    view.empty = empty;
    if (!context || !view.plot) return;
    context.save();
    context.beginPath();
    context.rect(view.plot.box.left - 8, view.plot.box.top, view.plot.box.width + 8, view.plot.box.height + 8);
    context.clip();
    drawTrail(context, view, now_ms);
    context.restore();
    if (found) drawPoint(context, view, found);
}

// A number padded to the width of the largest, so that the text beside it does not move.
const wide = (text, places) => text.padStart(places, "\u2007");

const said = (map, found, speed, force, isWide) => {
    const weights = found ? found.corners.map(({ weight }) => `${wide((100 * weight).toFixed(0), 3)} %`).join(" · ") : "outside";
    const where = found && isExtrapolated(map, found) ? "extrapolated: " : "";
    return `${where}${wide((1000 * speed).toFixed(0), 4)} mm/s   ${force.toFixed(2)} N${isWide ? `   weights ${weights}` : ""}`;
};

// What was recorded, triangles, models, axes and their labels, drawn once for a map, a size, a range and a theme.
function drawGround(surface, { map, most }) {
    const context = surface.begin();
    if (!context) return null;
    const box = {
        left: INSET.left,
        top: INSET.top,
        width: surface.width - INSET.left - INSET.right,
        height: surface.height - INSET.top - INSET.bottom,
    };
    const plot = {
        box,
        most,
        x: (speed) => box.left + (box.width * speed) / (MARGIN * most[0]),
        y: (force) => box.top + box.height * (1 - force / (MARGIN * most[1])),
    };
    drawAxes(context, plot);
    context.save();
    context.beginPath();
    context.rect(box.left - 3, box.top, box.width + 6, box.height + 3);
    context.clip();
    drawRecorded(context, plot, map);
    drawTriangles(context, plot, map);
    context.restore();
    drawLegend(context, plot, map);
    return plot;
}

// The triangles between models of what was recorded, shaded.
function drawRecorded(context, plot, map) {
    context.beginPath();
    for (const triangle of map.triangles) {
        if (triangle.some((vertex) => isBeyond(map, vertex))) continue;
        outline(
            context,
            plot,
            triangle.map((vertex) => map.points[vertex]),
        );
    }
    context.fillStyle = colours.tint0;
    context.fill();
}

function drawTriangles(context, plot, map) {
    context.lineJoin = "round";
    context.beginPath();
    for (const triangle of map.triangles)
        outline(
            context,
            plot,
            triangle.map((i) => map.points[i]),
        );
    context.globalAlpha = 0.38;
    context.strokeStyle = colours.ink0;
    context.lineWidth = 0.8;
    context.stroke();
    context.globalAlpha = 1;
    map.points.forEach(([speed, force], i) => {
        const [ink, radius] = DOTS[map.kinds[i]];
        context.fillStyle = colours[ink];
        dot(context, plot.x(speed), plot.y(force), radius);
    });
}

function drawLegend(context, { box }, { kinds }) {
    let x = box.left + 8;
    context.font = FONT;
    for (const [kind, [ink, radius, text]] of Object.entries(DOTS)) {
        if (!kinds.includes(kind) || x + 20 + context.measureText(text).width > box.left + box.width) continue;
        context.fillStyle = colours[ink];
        dot(context, x, 12, radius);
        context.fillStyle = colours.soft;
        context.fillText(text, x + 8, 16);
        x += 24 + context.measureText(text).width;
    }
}

function outline(context, plot, corners) {
    corners.forEach(([speed, force], k) => context[k ? "lineTo" : "moveTo"](plot.x(speed), plot.y(force)));
    context.closePath();
}

function drawAxes(context, { box, most, x, y }) {
    context.font = FONT;
    context.fillStyle = colours.soft;
    context.strokeStyle = colours.grid;
    context.lineWidth = 1;
    context.strokeRect(box.left + 0.5, box.top + 0.5, box.width, box.height);
    context.textAlign = "center";
    for (const speed of ticks(0, MARGIN * most[0] * 1000, Math.max(2, box.width / 70)))
        context.fillText(String(Number(speed.toPrecision(3))), x(speed / 1000), box.top + box.height + 16);
    context.textAlign = "right";
    for (const force of ticks(0, MARGIN * most[1], Math.max(2, box.height / 40)))
        context.fillText(String(Number(force.toPrecision(3))), box.left - 8, y(force) + 4);
    context.fillText("Speed (mm/s)", box.left + box.width, box.top + box.height + 30);
    context.save();
    context.translate(12, box.top);
    context.rotate(-Math.PI / 2);
    context.fillText("Normal force (N)", 0, 0);
    context.restore();
    context.textAlign = "left";
}

function drawTrail(context, { trail, plot }, now_ms) {
    const ageOf = (point) => Math.floor((TRAIL_STEPS * (now_ms - point.now_ms)) / TRAIL_MS);
    context.lineJoin = "round";
    context.strokeStyle = colours.ink1;
    context.lineWidth = 2;
    for (let i = trail.length - 1; i > 0;) {
        const age = ageOf(trail[i]);
        context.globalAlpha = 0.85 * (1 - Math.min(1, age / TRAIL_STEPS)) ** 1.5;
        context.beginPath();
        context.moveTo(plot.x(trail[i].speed), plot.y(trail[i].force));
        do {
            i--;
            const lifted = trail[i + 1].now_ms - trail[i].now_ms > LIFTED_MS;
            context[lifted ? "moveTo" : "lineTo"](plot.x(trail[i].speed), plot.y(trail[i].force));
        } while (i > 0 && ageOf(trail[i]) === age);
        context.stroke();
    }
    context.globalAlpha = 1;
}

function drawPoint(context, { map, plot }, found) {
    const { x, y, corners } = found;
    const at = corners.map(({ point }) => [plot.x(point[0]), plot.y(point[1])]);
    context.beginPath();
    outline(
        context,
        plot,
        corners.map(({ point }) => point),
    );
    context.fillStyle = colours.ink1;
    context.globalAlpha = 0.22;
    context.fill();
    context.globalAlpha = 1;
    context.strokeStyle = colours.ink1;
    context.lineWidth = 1.4;
    context.stroke();
    corners.forEach(({ weight }, i) => {
        context.fillStyle = colours.ink1;
        dot(context, ...at[i], 2.5 + 7 * Math.sqrt(weight));
    });
    context.font = FONT_STRONG;
    corners.forEach(({ weight }, i) => labelCorner(context, plot, at, i, weight));
    const [px, py] = [plot.x(x), plot.y(y)];
    context.fillStyle = colours.box;
    dot(context, px, py, 6.5);
    context.fillStyle = colours.ink;
    dot(context, px, py, 4.5);
    if (!isExtrapolated(map, found)) return;
    const left = Math.max(plot.box.left + 4, Math.min(plot.box.left + plot.box.width - 84, px - 36));
    const above = Math.min(...at.map(([, up]) => up)) - 26;
    const top = above > plot.box.top + 12 ? above : Math.max(...at.map(([, up]) => up)) + 36;
    haloText(context, "extrapolated", left, Math.min(top, plot.box.top + plot.box.height - 6), colours.warn, colours.panel);
}

// The weight beside its corner, on the side away from the middle of the triangle.
function labelCorner(context, { box }, at, i, weight) {
    const middle = [0, 1].map((k) => (at[0][k] + at[1][k] + at[2][k]) / 3);
    const [dx, dy] = [at[i][0] - middle[0], at[i][1] - middle[1]];
    const length = Math.hypot(dx, dy) || 1;
    const x = Math.max(box.left + 2, Math.min(box.left + box.width - 32, at[i][0] + (20 * dx) / length - 12));
    const y = Math.max(box.top + 12, Math.min(box.top + box.height - 4, at[i][1] + (18 * dy) / length + 4));
    haloText(context, weight.toFixed(2), x, y, colours.ink, colours.panel);
}

function dot(context, x, y, radius) {
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.fill();
}
