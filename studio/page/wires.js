// Wires that a hand draws: from the output of a node to the input of another, where it is let go.
import { draw } from "./live-drawing.js";

const REACH_PX = 22; // of a port
const HIT = 9; // radius, in the drawing's units
const HANDLE = 5;

export const WIRE_STYLE = `
.hit{fill:transparent;stroke:none}.handle{fill:var(--box);stroke:var(--edge);stroke-width:1.5}
[data-output]{cursor:crosshair}[data-output]:hover .hit,[data-input].near .hit,[data-node].near .box{fill:var(--accent);fill-opacity:.35}
.drawn{fill:none;stroke:var(--accent);stroke-width:2.5;stroke-dasharray:6 4;pointer-events:none}`;

// `view` is that of the drawing, `boxes` where something opens. Returns { dress, begin }.
export function mountWires(studio, host, view, boxes) {
    let wire = null; // { id, output, line, start }
    const local = ({ clientX, clientY }) => {
        const { left, top } = host.getBoundingClientRect();
        return [(clientX - left - view.x) / view.scale, (clientY - top - view.y) / view.scale];
    };
    const near = (event) => {
        const found = event && targetAt(view.svg, event.clientX, event.clientY);
        for (const each of view.svg.querySelectorAll(".near")) if (each !== found) each.classList.remove("near");
        found?.classList.add("near");
        return found;
    };
    const end = () => {
        wire?.line.remove();
        if (view.svg) near(null);
        wire = null;
    };
    host.addEventListener("pointermove", (event) => {
        if (wire?.id !== event.pointerId) return;
        const [x, y] = local(event);
        const reach = Math.max(20, Math.abs(x - wire.start[0]) / 2);
        wire.line.setAttribute("d", `M${wire.start}C${wire.start[0] + reach},${wire.start[1]} ${x - reach},${y} ${x},${y}`);
        near(event);
    });
    host.addEventListener("pointerup", (event) => {
        if (wire?.id !== event.pointerId) return;
        const [target, output] = [near(event), wire.output];
        end();
        if (target) import("./drop.js").then(({ drop }) => drop(studio, boxes, output, target, [event.clientX, event.clientY]));
    });
    for (const type of ["pointercancel", "lostpointercapture"]) host.addEventListener(type, (event) => wire?.id === event.pointerId && end());
    // True if a wire begins at what is pressed.
    const begin = (event, target) => {
        const from = target.closest?.("[data-output]");
        if (!from || wire || !studio.edits.may()) return false;
        const line = draw("path", { class: "drawn" });
        view.svg.append(line);
        wire = { id: event.pointerId, output: from.getAttribute("data-output"), line, start: local(event) };
        host.setPointerCapture(event.pointerId);
        return true;
    };
    return { begin, dress: (svg) => dress(studio, svg), isDrawn: () => wire !== null };
}

// Makes the ports of a drawing as large as a hand needs them; nodes that are drawn by their names get one place from which a wire begins.
function dress(studio, svg) {
    if (studio.hello.can.edit === false) return;
    const ports = [...svg.querySelectorAll("[data-input], [data-output]")];
    for (const port of ports) {
        const dot = port.querySelector("circle");
        const title = draw("title", {});
        const isOutput = port.hasAttribute("data-output");
        title.textContent = isOutput ? `${port.getAttribute("data-output")}: drag it to an input` : port.getAttribute("data-input");
        port.append(draw("circle", { class: "hit", cx: dot.getAttribute("cx"), cy: dot.getAttribute("cy"), r: HIT }), title);
    }
    if (ports.length) return;
    for (const node of svg.querySelectorAll("[data-node]")) {
        const [path, kind] = ["data-node", "data-kind"].map((name) => node.getAttribute(name));
        const isDevice = studio.hello.kinds.some(({ name, group }) => name === kind && group === "devices");
        const hasOutput = studio.graph.levels.some(({ name }) => name.startsWith(`${path}.`) || name.startsWith(`${path}/`));
        const box = node.querySelector("rect.box, path.box");
        if (isDevice || !hasOutput || !box) continue;
        const [x, y] = rightOf(box);
        const title = draw("title", {});
        title.textContent = `${path}: drag it to another node`;
        const port = draw("g", { "data-output": `${path}.` });
        port.append(draw("circle", { class: "hit", cx: x, cy: y, r: HIT }), draw("circle", { class: "handle", cx: x, cy: y, r: HANDLE }), title);
        node.append(port);
    }
}

// The middle of the right edge of a node that is drawn by its name.
function rightOf(box) {
    const number = (name) => Number(box.getAttribute(name));
    if (box.localName === "rect") return [number("x") + number("width"), number("y") + number("height") / 2];
    const points = [...box.getAttribute("d").matchAll(/(-?[\d.]+)[ ,](-?[\d.]+)/g)].map(([, x, y]) => [Number(x), Number(y)]);
    const [xs, ys] = [0, 1].map((axis) => points.map((point) => point[axis]));
    return [Math.max(...xs), (Math.min(...ys) + Math.max(...ys)) / 2];
}

// The input at a place of the window or within reach of it, else the node there.
function targetAt(svg, x, y) {
    const found = svg.getRootNode().elementsFromPoint(x, y).map((element) => element.closest?.("[data-input]") ?? element.closest?.("[data-node]"));
    const input = found.find((element) => element?.hasAttribute("data-input"));
    if (input) return input;
    const away = (element) => {
        const { left, top, width, height } = element.getBoundingClientRect();
        return Math.hypot(x - left - width / 2, y - top - height / 2);
    };
    const inputs = [...svg.querySelectorAll("[data-input]")].map((element) => [away(element), element]).sort(([a], [b]) => a - b);
    return inputs[0]?.[0] < REACH_PX ? inputs[0][1] : (found.find(Boolean) ?? null);
}
