// The force-speed plane of a texture: its triangles, the hand's point in it with the weights of the three models, its trail.
import { find, make, setText } from "./dom.js";
import { mostFrames } from "./frame.js";
import { locate } from "./locate.js";
import { colours, FONT, FONT_STRONG, haloText, onTheme, Surface } from "./theme.js";

const INSET = { left: 44, right: 16, top: 12, bottom: 34 };
const TRAIL_MS = 4000;
const TRAIL_STEPS = 12; // of fading
const LIFTED_MS = 120; // between two points of the trail: the hand was away
const EDGE_PIECES = 10; // an edge is straight in speed and force, so it bends on root axes
const BARELY = 0.005; // m/s and N below which there is no vibration and no point

export function mountMap(studio) {
    const view = { map: null, traces: null, trail: [], plot: null }; // plot: null where the ground has to be drawn
    const again = () => (view.plot = null);
    const ground = new Surface(find("map-ground"), again);
    const surface = new Surface(find("map"), again);
    onTheme(again);
    const choice = find("map-choice");
    const choose = (index) => {
        const map = studio.graph?.maps[index] ?? null;
        const same = view.map && map && view.map.speed_port === map.speed_port && view.map.force_port === map.force_port;
        if (!same) {
            for (const trace of view.traces ?? []) studio.taps.release(trace);
            view.traces = map && [map.speed_port, map.force_port].map((port) => port && studio.taps.watch(port));
            view.trail = [];
        }
        view.map = map;
        again();
    };
    choice.addEventListener("change", () => choose(choice.selectedIndex));
    studio.on("graph", ({ maps }) => {
        const index = Math.max(
            0,
            maps.findIndex((map) => map.node === view.map?.node),
        );
        choice.replaceChildren(...maps.map((map) => make("option", { text: map.node })));
        choice.hidden = maps.length < 2;
        choice.selectedIndex = index;
        choose(index);
    });
    mostFrames((now_ms) => draw(studio, ground, surface, view, now_ms));
    studio.mapPoint = () => view.trail.at(-1) ?? null;
}

function draw(studio, ground, surface, view, now_ms) {
    if (!view.map) {
        surface.begin();
        ground.begin();
        setText(find("map-text"), studio.graph ? "This graph has no texture" : "");
        return;
    }
    view.plot ??= drawGround(ground, view.map);
    const [speed, force] = (view.traces ?? []).map((trace) => trace?.latest() ?? NaN);
    const touching = studio.connection.open && force > BARELY && Number.isFinite(speed);
    if (touching) view.trail.push({ speed, force, now_ms });
    while (view.trail.length && now_ms - view.trail[0].now_ms > TRAIL_MS) view.trail.shift();
    const found = touching ? locate(view.map, speed, force) : null;
    setText(find("map-text"), touching ? said(found, speed, force) : "Touch the pad: the point appears");
    const empty = view.trail.length === 0;
    const context = empty && view.empty ? null : surface.begin(); // nothing is painted while nothing moves
    view.empty = empty;
    if (!context || !view.plot) return;
    drawTrail(context, view, now_ms);
    if (found) drawPoint(context, view, found);
}

// A number padded to the width of the largest, so that the text beside it does not move.
const wide = (text, places) => text.padStart(places, "\u2007");

const said = (found, speed, force) => {
    const weights = found ? found.corners.map(({ weight }) => `${wide((100 * weight).toFixed(0), 3)} %`).join(" · ") : "outside";
    const where = found?.clamped ? "beyond the map: " : "";
    return `${where}${wide((1000 * speed).toFixed(0), 4)} mm/s   ${force.toFixed(2)} N   weights ${weights}`;
};

// Triangles, axes and their labels, drawn once for a map, a size and a theme.
function drawGround(surface, map) {
    const context = surface.begin();
    if (!context) return null;
    const most = map.points.reduce(([s, f], [a, b]) => [Math.max(s, a), Math.max(f, b)], [1e-3, 1e-3]);
    const box = {
        left: INSET.left,
        top: INSET.top,
        width: surface.width - INSET.left - INSET.right,
        height: surface.height - INSET.top - INSET.bottom,
    };
    const plot = {
        box,
        most,
        x: (speed) => box.left + box.width * root(speed / most[0]),
        y: (force) => box.top + box.height * (1 - root(force / most[1])),
    };
    drawAxes(context, plot);
    context.lineJoin = "round";
    context.beginPath();
    for (const triangle of map.triangles)
        outline(
            context,
            plot,
            triangle.map((i) => map.points[i]),
        );
    context.fillStyle = colours.tint0;
    context.globalAlpha = 0.55;
    context.fill();
    context.globalAlpha = 0.38;
    context.strokeStyle = colours.ink0;
    context.lineWidth = 0.8;
    context.stroke();
    context.globalAlpha = 0.75;
    context.fillStyle = colours.ink0;
    for (const [speed, force] of map.points) dot(context, plot.x(speed), plot.y(force), 1.6);
    context.globalAlpha = 1;
    return plot;
}

// Square-root axes: they give room to small speeds and forces, which are the most frequent.
const root = (part) => Math.sqrt(Math.max(0, Math.min(part, 1.02)));

function outline(context, plot, corners) {
    corners.forEach((from, k) => {
        const to = corners[(k + 1) % corners.length];
        for (let i = 0; i < EDGE_PIECES; i++) {
            const part = (1 - Math.cos((Math.PI * i) / EDGE_PIECES)) / 2; // closer at both ends, where it may bend most
            const [speed, force] = [0, 1].map((axis) => from[axis] + (to[axis] - from[axis]) * part);
            context[k + i ? "lineTo" : "moveTo"](plot.x(speed), plot.y(force));
        }
    });
    context.closePath();
}

// Round values whose places are at least `gap` apart.
function apart(most, toPlace, gap) {
    const out = [0];
    for (let power = 1e-3; power < most; power *= 10) {
        for (const value of [power, 2 * power, 5 * power])
            if (value <= most && Math.abs(toPlace(value) - toPlace(out.at(-1))) >= gap) out.push(value);
    }
    return out;
}

function drawAxes(context, { box, most, x, y }) {
    context.font = FONT;
    context.fillStyle = colours.soft;
    context.textAlign = "center";
    for (const speed of apart(most[0] * 1000, (value) => x(value / 1000), 46))
        context.fillText(String(Number(speed.toPrecision(2))), x(speed / 1000), box.top + box.height + 16);
    context.textAlign = "right";
    for (const force of apart(most[1], y, 26)) context.fillText(String(Number(force.toPrecision(2))), box.left - 8, y(force) + 4);
    context.fillText("speed, mm/s", box.left + box.width, box.top + box.height + 30);
    context.save();
    context.translate(12, box.top);
    context.rotate(-Math.PI / 2);
    context.fillText("force, N", 0, 0);
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

function drawPoint(context, { plot }, { x, y, corners }) {
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
