// The drawn graph: movement and zoom, selection of nodes, wires to scopes; live-drawing.js shows levels, costs and
// faults.
import { mountBoxes } from "./by-hand.js";
import { find, make, setText } from "./dom.js";
import { LIVE_STYLE, mountLiveDrawing } from "./live-drawing.js";
import { mountNode } from "./node.js";
import { bare } from "./surfaces.js";
import { cleaned } from "./svg.js";
import { mountWires, WIRE_STYLE } from "./wires.js";

const LEAST_SCALE = 0.05;
const MOST_SCALE = 4;
const READABLE_SCALE = 0.78;
const CLICK_PX = 5;
const TWICE_MS = 400; // between the clicks of a double one
const TWICE_PX = 14;
const MARGIN_PX = [28, 64]; // of the drawing around its nodes
// The drawing has a style sheet of its own; in a shadow tree it does not reach the page.
const STYLE = `
:host{display:block;position:absolute;inset:0}
svg{position:absolute;left:0;top:0;transform-origin:0 0;max-width:none!important;overflow:visible;user-select:none}
rect.paper{fill:transparent}
[data-node]{cursor:pointer}[data-node]:hover .box,[data-node]:focus-visible .box,[data-node].chosen .box{stroke-width:3}
[data-node]:focus{outline:none}
[data-port]{pointer-events:none}
.dim{opacity:.2}
.grab{fill:none;stroke:transparent;stroke-width:14;pointer-events:stroke;cursor:copy}
.grab:hover{stroke:var(--accent);stroke-opacity:.28}
${LIVE_STYLE}${WIRE_STYLE}`;

export function mountGraph(studio) {
    const host = find("graph");
    const canvas = make("div");
    const shadow = canvas.attachShadow({ mode: "open" });
    // With ports and settings, or names alone, which can be read where the other cannot; null until a person chooses.
    const view = { x: 0, y: 0, scale: 1, svg: null, size: [1, 1], shown: null, fitted: false, names: null };
    const showNode = mountNode(studio, (node) => choose(view, node));
    studio.showNode = showNode;
    const boxes = mountBoxes(studio);
    let form = null;
    const openForm = async (...place) => {
        form ??= import("./node-form.js").then(({ mountForm }) => mountForm(studio, boxes));
        (await form)(...place);
    };
    view.wires = mountWires(studio, host, view, boxes);
    // The form of a node, or of a device's body, beside it.
    view.edit = studio.editNode = (path, kind = null) => {
        showNode(null);
        const isDevice = studio.hello.kinds.some(({ name, group }) => name === kind && group === "devices");
        const drawn = [...(view.svg?.querySelectorAll("[data-node]") ?? [])].filter((node) => node.getAttribute("data-node") === path);
        const box = (drawn.find((node) => !kind || node.getAttribute("data-kind") === kind) ?? host).querySelector(".box")?.getBoundingClientRect();
        openForm(path, isDevice ? kind : null, box ? [box.right + 8, box.top] : [0, 0]);
    };
    const show = () => {
        if (!studio.graph) return;
        const names = view.names ?? !isReadable(host, sizeOf(studio.graph.drawing));
        const drawing = names ? studio.graph.overview : studio.graph.drawing;
        const shown = `${studio.blind} ${drawing}`;
        if (shown !== view.shown) build(studio, shadow, view, drawing, showNode);
        view.shown = shown;
        setText(find("graph-ports"), names ? "Ports" : "Names");
        if (!view.fitted) fit(host, view);
    };
    host.append(canvas, buttonsOf(host, view, show), searchOf(host, view));
    studio.on("graph", show);
    studio.on("compared", show);
    new ResizeObserver(() => !view.fitted && show()).observe(host);
    followHand(host, view);
    mountLiveDrawing(studio, host, view);
}

function build(studio, shadow, view, drawing, showNode) {
    const svg = cleaned(drawing);
    shadow.replaceChildren(make("style", { text: STYLE }));
    if (!svg) return;
    const box = svg.viewBox.baseVal;
    view.size = [box.width || 1, box.height || 1];
    svg.setAttribute("width", view.size[0]);
    svg.setAttribute("height", view.size[1]);
    svg.removeAttribute("role");
    if (studio.blind) hideSurfaces(svg, studio.graph.surfaces);
    for (const node of svg.querySelectorAll("[data-node]")) {
        const path = node.getAttribute("data-node");
        for (const [name, value] of [
            ["tabindex", "0"],
            ["role", "button"],
            ["aria-label", labelOf(node, path)],
        ])
            node.setAttribute(name, value);
        node.addEventListener(
            "keydown",
            (event) => {
                if (event.key === "Enter" || event.key === " ") showNode(path);
                else if (event.key === "F2") view.edit(path, node.getAttribute("data-kind"));
                else return;
                event.preventDefault();
            },
        );
    }
    // A wire is thin: a wide invisible line takes the clicks.
    for (const wire of svg.querySelectorAll('path[data-port]:not([data-port=""])')) wire.after(grabOf(wire));
    view.wires.dress(svg);
    shadow.append(svg);
    view.svg = svg;
    view.clicked = (target, { timeStamp, clientX, clientY }) => {
        const drawn = target.closest?.("[data-node]");
        const node = drawn?.getAttribute("data-node");
        view.once = node && { node, kind: drawn.getAttribute("data-kind"), timeStamp, clientX, clientY };
        const wire = target.closest?.("[data-wire]")?.getAttribute("data-wire");
        if (wire) studio.addScope(wire);
        else if (node) showNode(node);
        else showNode(null);
    };
    place(view);
}

// What a node is called, with what is written on it.
function labelOf(node, path) {
    const [, kind, ...ports] = [...node.querySelectorAll("text")].map(({ textContent }) => textContent);
    const name = path.split("/").at(-1);
    return kind ? `node ${path}: ${[name, kind, ...ports].join(" ")}` : `node ${path}`;
}

// In a blind comparison the drawing names no surface.
function hideSurfaces(svg, surfaces) {
    const files = surfaces.map(({ path }) => bare(path).split("/").at(-1));
    for (const element of svg.querySelectorAll("text, tspan, title, desc"))
        if (!element.firstElementChild && files.some((file) => element.textContent.includes(file)))
            element.textContent = "hidden while blind";
}

function grabOf(wire) {
    const port = wire.getAttribute("data-port");
    const grab = wire.cloneNode();
    grab.setAttribute("class", "grab");
    grab.setAttribute("data-wire", port);
    grab.removeAttribute("data-port");
    const title = document.createElementNS("http://www.w3.org/2000/svg", "title");
    title.textContent = `${port}: click to put it on a scope`;
    grab.append(title);
    return grab;
}

function choose(view, path) {
    for (const node of view.svg?.querySelectorAll("[data-node]") ?? [])
        node.classList.toggle("chosen", node.getAttribute("data-node") === path);
}

function place(view) {
    if (view.svg) view.svg.style.transform = `translate(${view.x}px, ${view.y}px) scale(${view.scale})`;
}

const wholeScale = (host, [width, height]) => Math.min((host.clientWidth - 8) / width, (host.clientHeight - 8) / height);
const isReadable = (host, size) => wholeScale(host, size) >= READABLE_SCALE;
const sizeOf = (drawing) => drawing.match(/viewBox="0 0 ([\d.]+) ([\d.]+)"/)?.slice(1).map(Number) ?? [1, 1];

// Shows the whole graph if its text is then readable, else its upper left part.
function fit(host, view, whole = false) {
    const [width, height] = [host.clientWidth, host.clientHeight];
    if (!width || !height) return;
    const all = wholeScale(host, view.size);
    const longest = Math.max((width - 8) / view.size[0], (height - 8) / view.size[1]);
    view.scale = whole ? all : Math.min(1.2, Math.max(all, Math.min(READABLE_SCALE, longest)));
    view.x = Math.max(0, (width - view.size[0] * view.scale) / 2);
    view.y = Math.max(0, (height - view.size[1] * view.scale) / 2);
    place(view);
}

function zoom(view, factor, x, y) {
    const scale = Math.max(LEAST_SCALE, Math.min(MOST_SCALE, view.scale * factor));
    view.x = x - ((x - view.x) * scale) / view.scale;
    view.y = y - ((y - view.y) * scale) / view.scale;
    view.scale = scale;
    view.fitted = true;
    place(view);
}

// Finds nodes by a part of their names or kinds: those stay bright; Enter goes to the first.
function searchOf(host, view) {
    const found = (text) =>
        [...(view.svg?.querySelectorAll("[data-node]") ?? [])].filter((node) =>
            ["node", "kind"].some((what) => node.getAttribute(`data-${what}`)?.toLowerCase().includes(text)),
        );
    const search = make("input", {
        type: "search",
        placeholder: "Find a node",
        "aria-label": "Find a node by its name or kind",
        oninput: ({ target }) => {
            const text = target.value.trim().toLowerCase();
            const bright = text ? new Set(found(text)) : null;
            for (const node of view.svg?.querySelectorAll("[data-node]") ?? []) node.classList.toggle("dim", bright?.has(node) === false);
        },
        onkeydown: (event) => {
            event.stopPropagation(); // no key of the drawing
            const text = event.target.value.trim().toLowerCase();
            const first = event.key === "Enter" && text ? found(text)[0]?.querySelector(".box") : null;
            if (!first) return;
            const { x, y, width, height } = first.getBBox();
            view.scale = Math.max(view.scale, 1);
            view.x = host.clientWidth / 2 - (x + MARGIN_PX[0] + width / 2) * view.scale;
            view.y = host.clientHeight / 2 - (y + MARGIN_PX[1] + height / 2) * view.scale;
            view.fitted = true;
            place(view);
        },
    });
    return make("div", { class: "graph-search" }, search);
}

function buttonsOf(host, view, show) {
    const middle = (factor) => () => zoom(view, factor, host.clientWidth / 2, host.clientHeight / 2);
    return make(
        "div",
        { class: "graph-buttons" },
        make("button", { text: "−", "aria-label": "Zoom out", onclick: middle(0.8) }),
        make("button", { text: "+", "aria-label": "Zoom in", onclick: middle(1.25) }),
        make("button", {
            id: "graph-ports",
            title: "Nodes with their ports and settings, or names alone",
            onclick: ({ target }) => {
                view.names = target.textContent === "Names";
                view.fitted = false;
                show();
            },
        }),
        make("button", {
            text: "Fit",
            onclick: () => {
                view.fitted = true;
                fit(host, view, true);
            },
        }),
    );
}

// Drag moves, wheel and two fingers zoom, a press that does not move clicks.
function followHand(host, view) {
    const down = new Map();
    let moved = 0,
        target = null;
    const local = (event) => [
        event.clientX - host.getBoundingClientRect().left,
        event.clientY - host.getBoundingClientRect().top,
    ];
    host.addEventListener("pointerdown", (event) => {
        if (event.target.closest?.("button")) return;
        [moved, target] = [0, event.composedPath()[0]];
        if (down.size === 0 && view.wires.begin(event, target)) return;
        down.set(event.pointerId, local(event));
        host.setPointerCapture(event.pointerId);
    });
    host.addEventListener("pointermove", (event) => {
        const before = down.get(event.pointerId);
        if (!before) return;
        const now = local(event);
        const other = [...down].find(([id]) => id !== event.pointerId)?.[1];
        moved += Math.hypot(now[0] - before[0], now[1] - before[1]);
        down.set(event.pointerId, now);
        if (moved < CLICK_PX) return;
        if (other) {
            const spread = (at) => Math.hypot(at[0] - other[0], at[1] - other[1]) || 1;
            return zoom(view, spread(now) / spread(before), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
        }
        [view.x, view.y, view.fitted] = [view.x + now[0] - before[0], view.y + now[1] - before[1], true];
        place(view);
    });
    host.addEventListener("pointerup", (event) => down.size === 1 && moved < CLICK_PX && view.clicked?.(target, event));
    for (const type of ["pointerup", "pointercancel", "lostpointercapture"])
        host.addEventListener(type, (event) => down.delete(event.pointerId));
    followDouble(host.parentElement, view);
    followWheelAndKeys(host, view, local);
}

// The second click on a node, which may lie under the card that the first has opened.
function followDouble(tab, view) {
    tab.addEventListener(
        "pointerup",
        (event) => {
            const { once } = view;
            view.once = null;
            const isTwice = once && event.timeStamp - once.timeStamp < TWICE_MS && Math.hypot(event.clientX - once.clientX, event.clientY - once.clientY) < TWICE_PX;
            if (!isTwice) return;
            event.stopPropagation();
            const swallow = (click) => click.stopPropagation();
            tab.addEventListener("click", swallow, { capture: true, once: true });
            setTimeout(() => {
                tab.removeEventListener("click", swallow, true);
                view.edit(once.node, once.kind);
            });
        },
        true,
    );
}

function followWheelAndKeys(host, view, local) {
    host.addEventListener(
        "wheel",
        (event) => {
            event.preventDefault();
            zoom(view, 1.0016 ** -event.deltaY, ...local(event));
        },
        { passive: false },
    );
    host.addEventListener("keydown", (event) => {
        const steps = { ArrowLeft: [60, 0], ArrowRight: [-60, 0], ArrowUp: [0, 60], ArrowDown: [0, -60] }[event.key];
        if (event.key === "+" || event.key === "-")
            zoom(view, event.key === "+" ? 1.25 : 0.8, host.clientWidth / 2, host.clientHeight / 2);
        if (!steps) return;
        event.preventDefault();
        [view.x, view.y, view.fitted] = [view.x + steps[0], view.y + steps[1], true];
        place(view);
    });
}
