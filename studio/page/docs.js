// A page of the documentation: graphs that run in it, colours of RON, and boxes that the keyboard scrolls.
import { make } from "./dom.js";

const TOKENS = /(?<comment>\/\/.*|\/\*[^]*?\*\/)|(?<string>"(?:[^"\\]|\\.)*")|(?<number>\b-?\d[\d_.]*(?:e[-+]?\d+)?\b)|(?<type>\b[A-Z]\w*(?=\s*\())/g;

function colour(code) {
    const text = code.textContent;
    const parts = [];
    let at = 0;
    for (const found of text.matchAll(TOKENS)) {
        const [kind] = Object.entries(found.groups).find(([, value]) => value !== undefined);
        parts.push(text.slice(at, found.index), make("span", { class: `ron-${kind}`, text: found[0] }));
        at = found.index + found[0].length;
    }
    code.replaceChildren(...parts, text.slice(at));
}

let shown = null; // the button and the frame of the graph that runs: one at a time

function close() {
    shown?.frame.remove();
    if (shown) shown.button.textContent = "Run it here";
    shown?.button.setAttribute("aria-expanded", "false");
    shown = null;
}

function run(button) {
    const isOpen = shown?.button === button;
    close();
    if (isOpen) return;
    const address = new URL("studio.html", import.meta.url);
    address.search = new URLSearchParams({ graph: button.dataset.graph, embed: "" });
    const frame = make("iframe", { src: address.href, title: `${button.dataset.graph} in the studio`, allow: "autoplay; midi" });
    button.closest(".table, p, ul, ol, pre, main > *").after(frame);
    button.textContent = "Close";
    button.setAttribute("aria-expanded", "true");
    shown = { button, frame };
}

for (const code of document.querySelectorAll("code.language-ron")) colour(code);
for (const table of document.querySelectorAll("table")) {
    const box = make("div", { class: "table" });
    table.replaceWith(box);
    box.append(table);
}
for (const box of document.querySelectorAll("pre, .table"))
    if (box.scrollWidth > box.clientWidth) {
        box.tabIndex = 0;
        box.setAttribute("role", "group");
        box.setAttribute("aria-label", box.matches("pre") ? "Code" : "Table");
    }
for (const button of document.querySelectorAll("button.run")) {
    button.setAttribute("aria-expanded", "false");
    button.addEventListener("click", () => run(button));
}
