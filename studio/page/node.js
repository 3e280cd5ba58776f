// The card of the chosen node: its documentation, its live settings, its ports, and its other settings.
import { controlRow } from "./control.js";
import { find, make, setText } from "./dom.js";
import { prose } from "./prose.js";

// Returns a function that shows the card of the node at a path, or hides the card.
export function mountNode(studio, chosen) {
    const card = find("node");
    let rows = [],
        shown = null;
    const show = (path) => {
        for (const row of rows) row.dispose();
        rows = [];
        shown = path;
        chosen(path);
        card.hidden = !path;
        if (!path) return;
        const settings = studio.graph.settings.filter(({ node }) => node === path);
        rows = settings.map((setting) => controlRow(studio, setting, { compact: true }));
        card.replaceChildren(...contentOf(studio, path, rows, () => show(null)));
        card.scrollTop = 0;
    };
    studio.on("graph", () => shown && show(drawn(shown) ? shown : null));
    return show;
}

const element = (path) => find("graph").firstElementChild?.shadowRoot?.querySelector(`[data-node="${CSS.escape(path)}"]`);
const drawn = (path) => element(path) !== null;

// The kind of a node, from the drawing, else from its first port.
function kindOf(studio, path) {
    const kinds = studio.hello.kinds;
    const node = element(path);
    const words = [
        node?.getAttribute("data-kind"),
        ...[...(node?.querySelectorAll("text") ?? [])].map((text) => text.textContent),
    ];
    const name = words.find((word) => kinds.some((kind) => kind.name === word));
    return kinds.find((kind) => kind.name === name) ?? null;
}

function contentOf(studio, path, rows, close) {
    const kind = kindOf(studio, path);
    const ports = studio.graph.ports.filter(({ node }) => node === path);
    const header = make(
        "header",
        {},
        make("h3", { class: "clip", text: path }),
        make("span", { class: "soft clip", text: kind?.name ?? "" }),
        make("span", { class: "grow" }),
        studio.edits.may() && make("button", { text: "Edit", title: "Change its settings here. Also: double click, F2", onclick: () => studio.editNode(path) }),
        make("button", { class: "quiet", text: "Close", onclick: close }),
    );
    return [
        header,
        kind && make("p", {}, ...prose(kind.doc)),
        nowOf(studio, path),
        rows.length > 0 && make("h4", { text: "Live" }),
        ...rows.map((row) => row.element),
        ports.length > 0 && make("h4", { text: "Outputs" }),
        ...ports.map((port) => portRow(studio, port)),
        ...described("Inputs", kind?.inputs),
        ...described("Settings", kind?.settings),
    ].filter(Boolean);
}

// Updates cost and faults while the card is open.
function nowOf(studio, path) {
    const line = make("p", { class: "soft" });
    const end = studio.connection.on("levels", () => {
        if (!line.isConnected) return end();
        const { cost, mark } = studio.nodeNow(path);
        const parts = [cost && `${Math.max(1, Math.round(100 * cost))} % of the graph's work`, mark?.text].filter(Boolean);
        setText(line, parts.join("; "));
    });
    return line;
}

function portRow(studio, port) {
    const name = port.name.slice(port.node.length + 1);
    return make(
        "div",
        { class: "port" },
        make("span", { class: "mono clip", text: name, title: port.name }),
        make("span", { class: "soft clip", text: [port.unit, port.rate_hz && `${port.rate_hz} Hz`].filter(Boolean).join(", ") }),
        make("span", { class: "grow" }),
        make("button", { text: "Scope", "aria-label": `Put ${port.name} on a scope`, onclick: () => studio.addScope(port.name) }),
    );
}

function described(title, items) {
    if (!items?.length) return [];
    return [
        make("h4", { text: title }),
        make(
            "dl",
            {},
            ...items.flatMap((item) => [make("dt", { text: item.name + factsOf(item) }), make("dd", {}, ...prose(item.doc))]),
        ),
    ];
}

// Unit, range and default of a setting, as far as it has them.
export function factsOf({ unit, min, max, default: otherwise, required, live }) {
    const range = min !== null && min !== undefined && max !== null && max !== undefined ? `${min} to ${max}` : null;
    const facts = [
        [range, unit].filter(Boolean).join(" "),
        required ? "required" : null,
        otherwise ? `default ${otherwise}` : null,
        live ? "live" : null,
    ].filter(Boolean);
    return facts.length ? ` (${facts.join(", ")})` : "";
}
