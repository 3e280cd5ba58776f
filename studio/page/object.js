// The object that a hand touches, from the front and from above: its shapes, the tool, the proxy and the force.
import { drivenPort } from "./choices.js";
import { make } from "./dom.js";
import { mostFrames } from "./frame.js";
import { quantity, roundUp } from "./numbers.js";
import { arrowHead, closeUp, limitsOf, SIDES, sidesIn } from "./scene.js";
import { colours, FONT, haloText, onTheme, Surface } from "./theme.js";

const LEAST_TOOL = 3.5; // px: radius of the drawn tool
const ARROW = 0.4; // part of a side's height that the largest force takes
const LEAST_FORCE_N = 0.02;
const MOST_TRIANGLES = 200; // that are drawn again at every frame
const HIP = [1, 2, 3]; // components of a contact
const IHIP = [4, 5, 6];
const PENETRATION = 10;

export function objectView(studio, { fill, say }, view) {
    const label = `${view.title} from the front and from above, with the tool and the force on it`;
    const canvases = [make("canvas", { "aria-hidden": "true" }), make("canvas", { role: "img", "aria-label": label })];
    fill.append(...canvases);
    const streams = streamsOf(studio, view);
    let [sides, drawn, shown] = [null, null, null];
    const again = () => ([sides, drawn] = [null, null]);
    const [ground, surface] = canvases.map((canvas) => new Surface(canvas, again));
    const ends = [onTheme(again), mostFrames(draw)];
    function draw() {
        const isSilent = studio.status?.silent.some(({ input }) => input === view.pad.endpoint) ?? true;
        const now = isSilent ? -1 : streams.all.reduce((sum, trace) => sum + (trace?.written ?? 0), 0);
        const { isPaused } = studio.scopeWindow();
        if (drawn !== null && (now === drawn || isPaused)) return;
        sides ??= drawGround(ground, view);
        const context = sides && surface.begin();
        if (!context) return;
        drawn = now;
        if (!isPaused || !shown) shown = isSilent ? { tool: null } : stateOf(streams);
        for (const side of sides) drawSide(context, side, shown, view);
        say(said(shown));
    }
    const picture = { surfaces: [ground, surface], draw: () => (again(), draw()) };
    const end = () => {
        for (const each of ends) each();
        for (const each of [ground, surface]) each.end();
        for (const trace of streams.all) studio.taps.release(trace);
    };
    return { end, picture, moves: () => drawn > 0 && stateOf(streams).tool !== null };
}

// The streams of what is known: the contact or the tool's position, and the force that is delivered or measured.
function streamsOf({ taps }, { pad, contact, ports, actuators }) {
    const of = (channel) => ports.find(({ name }) => name.endsWith(`.${channel}`));
    const place = ["true_position", "position"]
        .filter((channel) => pad.channels.includes(channel))
        .map(of)
        .find(Boolean);
    const delivered = actuators
        .filter(({ endpoint, unit }) => endpoint === pad.endpoint && unit === "N")
        .map((each) => drivenPort(ports, each))
        .find((port) => port?.kind === "3-vector");
    const force = delivered ?? (pad.channels.includes("wrench") ? of("wrench") : null);
    const watch = (port) => (port ? taps.watch(port.name) : null);
    const streams = { contact: watch(contact), place: watch(place), force: watch(force), isMeasured: !delivered };
    return { ...streams, all: [streams.contact, streams.place, streams.force] };
}

const vector = (trace, lanes) => {
    const found = trace ? lanes.map((lane) => trace.latest(lane)) : [];
    return found.length && found.every(Number.isFinite) ? found : null;
};

// What is known now, in mm and N; null where it is not.
function stateOf({ contact, place, force, isMeasured }) {
    const mm = (m) => m && m.map((value) => value * 1e3);
    const touches = contact?.lanes ? contact.latest(0) === 1 : null;
    return {
        tool: mm(vector(place, [0, 1, 2]) ?? vector(contact, HIP)),
        proxy: touches ? mm(vector(contact, IHIP)) : null,
        depth_m: touches ? contact.latest(PENETRATION) : null,
        force: vector(force, [0, 1, 2]),
        isMeasured,
        touches,
    };
}

function said({ tool, force, isMeasured, touches, depth_m }) {
    if (!tool) return "No hand on the pad";
    const size = force && Math.hypot(...force);
    const touch = touches === null ? "" : touches ? "touches" : "free";
    const parts = [depth_m > 0 ? `${quantity(depth_m, "m")} deep` : touch];
    if (size !== null) parts.push(`${size.toFixed(2)} N ${isMeasured ? "on the object" : "on the hand"}`);
    return parts.filter(Boolean).join(" · ");
}

// The shapes and labels, drawn once for a size and a theme.
function drawGround(surface, { pad, actuators }) {
    const context = surface.begin();
    if (!context) return null;
    const peaks = actuators.filter(({ endpoint, unit }) => endpoint === pad.endpoint && unit === "N").map(({ peak }) => peak);
    const most_n = Math.max(...peaks, 0) || pad.force_n;
    const sides = sidesIn(surface.width, surface.height, limitsOf(pad.scene, pad));
    for (const side of sides) {
        side.per_n = (ARROW * side.box.height) / most_n;
        context.save();
        drawShapes(context, side, pad.scene.shapes);
        context.restore();
        drawLabels(context, side);
    }
    return sides;
}

// Clips to the side and draws the shapes in it.
function drawShapes(context, { box, ...side }, shapes) {
    context.beginPath();
    context.rect(box.left, box.top, box.width, box.height);
    context.clip();
    context.fillStyle = colours.box;
    context.fillRect(box.left, box.top, box.width, box.height);
    for (const shape of shapes) DRAW[shape.form](context, { box, ...side }, shape);
}

function outlined(context) {
    context.fillStyle = colours.tint0;
    context.fill();
    context.strokeStyle = colours.ink0;
    context.lineWidth = 1.4;
    context.stroke();
}

// A half space is everything, seen along a direction that meets its plane.
function drawPlane(context, side, { origin_mm, normal }) {
    const { axes, box } = side;
    const [across, up] = axes.map((axis) => normal[axis]);
    context.beginPath();
    if (Math.hypot(across, up) < (1 - 1e-9) * Math.hypot(...normal))
        context.rect(box.left - 2, box.top - 2, box.width + 4, box.height + 4);
    else {
        const [x, y] = side.at(origin_mm);
        const far = 2 * (Math.hypot(box.width, box.height) + Math.hypot(x - box.left, y - box.top));
        const size = Math.hypot(across, up);
        const [dx, dy] = [(far * across) / size, (-far * up) / size];
        for (const [px, py] of [
            [-dy, dx],
            [dy, -dx],
            [dy - dx, -dx - dy],
            [-dy - dx, dx - dy],
        ])
            context.lineTo(x + px, y + py);
        context.closePath();
    }
    outlined(context);
}

function drawSphere(context, side, { centre_mm, diameter_mm }) {
    context.beginPath();
    context.arc(...side.at(centre_mm), (diameter_mm / 2) * side.scale, 0, 2 * Math.PI);
    outlined(context);
}

// Against the clock: a hole in a rectangle.
function cuboid(context, side, { centre_mm, size_mm }) {
    const [x, y] = side.at(centre_mm);
    const [width, height] = side.axes.map((axis) => size_mm[axis] * side.scale);
    context.rect(x + width / 2, y - height / 2, -width, height);
}

function drawBox(context, side, shape) {
    context.beginPath();
    cuboid(context, side, shape);
    outlined(context);
}

// A room is touched from inside: its walls are what is around it.
function drawRoom(context, side, shape) {
    const { left, top, width, height } = side.box;
    context.beginPath();
    context.rect(left - 3, top - 3, width + 6, height + 6);
    cuboid(context, side, shape);
    outlined(context);
}

// The outline of all triangles: their edges first, wide, then their areas over them.
function drawMesh(context, side, { points_mm, triangles }) {
    const at = points_mm.map((point) => side.at(point));
    const each = (paint) => {
        for (const corners of triangles) {
            context.beginPath();
            corners.forEach((corner, i) => context[i ? "lineTo" : "moveTo"](...at[corner]));
            context.closePath();
            paint();
        }
    };
    context.lineJoin = "round";
    context.strokeStyle = colours.ink0;
    context.lineWidth = 3;
    each(() => context.stroke());
    context.strokeStyle = context.fillStyle = colours.tint0;
    context.lineWidth = 0.6;
    each(() => (context.fill(), context.stroke()));
}

const DRAW = { plane: drawPlane, sphere: drawSphere, box: drawBox, room: drawRoom, mesh: drawMesh };

function drawLabels(context, side) {
    const { box, scale, per_n, name, axes } = side;
    context.strokeStyle = colours.grid;
    context.lineWidth = 1;
    context.strokeRect(box.left + 0.5, box.top + 0.5, box.width - 1, box.height - 1);
    context.font = FONT;
    const [across, up] = axes.map((axis) => "xyz"[axis]);
    haloText(context, `${name}: ${across} →, ${up} ↑`, box.left + 6, box.top + 13, colours.soft, colours.box);
    const length_mm = roundUp((0.18 * box.width) / scale);
    const bottom = box.top + box.height - 8;
    bar(context, box.left + 8, bottom, length_mm * scale, `${length_mm} mm`, colours.ink);
    bar(context, box.left + box.width - 8 - per_n, bottom, per_n, "1 N", colours.ink1);
}

function bar(context, x, y, length, text, ink) {
    context.fillStyle = ink;
    context.fillRect(x, y, length, 2);
    context.textAlign = "center";
    haloText(context, text, x + length / 2, y - 4, colours.soft, colours.box);
    context.textAlign = "left";
}

function drawSide(context, side, state, { pad }) {
    if (!state.tool) return;
    const { left, top, width, height } = side.box;
    context.save();
    context.beginPath();
    context.rect(left, top, width, height);
    context.clip();
    drawTool(context, side, state, pad.scene);
    context.restore();
    if (side.name !== SIDES[0].name) return;
    context.font = FONT;
    haloText(context, state.proxy ? "● tool  ○ proxy" : "● tool", left + 6, top + height - 26, colours.soft, colours.box);
    const close = closeUp(side, state.proxy ?? state.tool);
    const triangles = pad.scene.shapes.reduce((sum, shape) => sum + (shape.triangles?.length ?? 0), 0);
    if (!close || triangles > MOST_TRIANGLES) return;
    context.save();
    drawShapes(context, close, pad.scene.shapes);
    drawTool(context, close, state, pad.scene);
    context.strokeStyle = colours.axis;
    context.lineWidth = 2;
    context.strokeRect(close.box.left, close.box.top, close.box.width, close.box.height);
    haloText(context, `× ${close.times.toFixed(0)}`, close.box.left + 5, close.box.top + 13, colours.soft, colours.box);
    context.restore();
}

function drawTool(context, side, { tool, proxy, force, isMeasured }, { tool_mm }) {
    const radius = Math.max(LEAST_TOOL, (tool_mm / 2) * side.scale);
    const [x, y] = side.at(tool);
    context.lineWidth = 1.6;
    context.fillStyle = colours.ink;
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.fill();
    if (proxy) {
        const [px, py] = side.at(proxy);
        context.strokeStyle = colours.ink2;
        context.beginPath();
        context.moveTo(x, y);
        context.lineTo(px, py);
        context.stroke();
        context.beginPath();
        context.arc(px, py, radius, 0, 2 * Math.PI);
        context.stroke();
    }
    if (force && Math.hypot(...force) > LEAST_FORCE_N) drawForce(context, side, [x, y], force, isMeasured);
}

function drawForce(context, side, [x, y], force, isMeasured) {
    const [dx, dy] = [force[side.axes[0]] * side.per_n, -force[side.axes[1]] * side.per_n];
    context.strokeStyle = context.fillStyle = colours.ink1;
    context.lineWidth = 2.2;
    context.setLineDash(isMeasured ? [4, 3] : []);
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(x + dx, y + dy);
    context.stroke();
    context.setLineDash([]);
    context.beginPath();
    for (const corner of arrowHead(x + dx, y + dy, dx, dy)) context.lineTo(...corner);
    context.fill();
}
