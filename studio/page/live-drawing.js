// Levels, costs and faults in the drawing: an element is changed only if its appearance changes, as each change
// repaints the drawing.
import { make, setText } from "./dom.js";
import { Levels } from "./levels.js";

const SVG = "http://www.w3.org/2000/svg";
const BAR = 3;
const KEY = "Width of a wire: its level against its highest.";
const COSTS = "Bar and %: share of the graph's work.";
const NO_COSTS = "The cost of single nodes is not measured in a page.";

export const LIVE_STYLE = `
.cost{pointer-events:none}.cost rect{fill:var(--ink1)}
.cost text,.mark text{font:600 10px system-ui,sans-serif;fill:var(--ink);paint-order:stroke;stroke:var(--box);stroke-width:3px}
.mark circle{fill:var(--warn)}.mark.fault circle{fill:var(--bad)}
.mark text{fill:var(--box);stroke:none}
.mark.past{opacity:.5}
[data-port].faulty{stroke:var(--bad)!important;stroke-dasharray:6 3}`;

// `view.svg` is the drawing on display, if any.
export function mountLiveDrawing(studio, host, view) {
    const levels = new Levels();
    const key = make("p", { class: "graph-key soft" });
    const live = { levels, parts: null, svg: null };
    host.after(key);
    studio.on("graph", (graph) => levels.restart(graph));
    studio.connection.on("levels", (message) => {
        const now_ms = performance.now();
        levels.take(message, now_ms);
        if (!view.svg || host.clientHeight === 0) return;
        if (live.svg !== view.svg) Object.assign(live, { svg: view.svg, parts: partsOf(view.svg, levels) });
        for (const part of live.parts) part(now_ms);
        setText(key, levels.hasCosts ? `${KEY} ${COSTS}` : studio.hello.host === "page" ? `${KEY} ${NO_COSTS}` : KEY);
    });
    // The card of a node has the same as text.
    studio.nodeNow = (path) => levels.node(path, performance.now());
}

// The functions that update each wire and node of a drawing.
function partsOf(svg, levels) {
    const wires = [...svg.querySelectorAll('path[data-port]:not([data-port=""])')];
    const nodes = [...svg.querySelectorAll("[data-node]")];
    return [...wires.map((wire) => wirePart(wire, levels)), ...nodes.map((node) => nodePart(node, levels)).filter(Boolean)];
}

function wirePart(wire, levels) {
    const port = wire.getAttribute("data-port");
    const grab = wire.nextElementSibling;
    let shown = null;
    // The title is made when the pointer enters.
    grab?.addEventListener("pointerenter", () => {
        grab.querySelector("title").textContent = `${levels.wire(port).text}. Click to put it on a scope`;
    });
    return () => {
        const { width, isFaulty } = levels.wire(port);
        if (shown === `${width} ${isFaulty}`) return;
        shown = `${width} ${isFaulty}`;
        wire.style.strokeWidth = String(width);
        wire.classList.toggle("faulty", isFaulty);
    };
}

function nodePart(node, levels) {
    const path = node.getAttribute("data-node");
    const box = node.querySelector(".box")?.getBBox();
    if (!box?.width) return null;
    const cost = costOf(box);
    const mark = markOf(box);
    let shown = null;
    return (now_ms) => {
        const now = levels.node(path, now_ms);
        const percent = now.cost === null ? 0 : Math.max(1, Math.round(100 * now.cost));
        const next = `${percent} ${now.mark?.kind} ${now.mark?.isRecent}`;
        if (now.mark) setText(mark.title, now.mark.text);
        if (shown === next) return;
        shown = next;
        cost.show(percent);
        mark.show(now.mark);
        if (now.mark) node.append(mark.element);
        if (percent) node.parentNode.append(cost.element); // no part of its name
    };
}

// A bar along the lower edge of a node, and its part as a number.
function costOf({ x, y, width, height }) {
    const bar = draw("rect", { x: x + 1, y: y + height - BAR - 1, height: BAR, rx: 1.5 });
    const text = draw("text", { x: x + width, y: y - 4, "text-anchor": "end" });
    const element = draw("g", { class: "cost" }, bar, text);
    const show = (percent) => {
        if (percent === 0) return element.remove();
        bar.setAttribute("width", String(((width - 2) * percent) / 100));
        setText(text, `${percent} %`);
    };
    return { element, show };
}

// A badge on the corner of a node where a limit acted or NaN appeared.
function markOf({ x, y }) {
    const title = draw("title", {});
    const text = draw("text", { x, y: y + 3.5, "text-anchor": "middle" });
    text.textContent = "!";
    const element = draw("g", { class: "mark" }, title, draw("circle", { cx: x, cy: y, r: 8 }), text);
    const show = (mark) => {
        if (!mark) return element.remove();
        element.classList.toggle("fault", mark.kind === "fault");
        element.classList.toggle("past", !mark.isRecent);
    };
    return { element, title, show };
}

// An element of a drawing.
export function draw(tag, attributes, ...children) {
    const element = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
    element.append(...children);
    return element;
}
