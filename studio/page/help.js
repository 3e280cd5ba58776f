// Completion and documentation while one writes a graph, from what the engine says it has.
import { make } from "./dom.js";
import { factsOf } from "./node.js";
import { prose } from "./prose.js";
import { placeOf } from "./ron.js";
import { bare } from "./surfaces.js";

// The completion source of the editor.
export function completions(studio) {
    return (context) => {
        const text = context.state.doc.toString();
        const place = placeOf(text, context.pos);
        if (place.comment || !studio.hello || !studio.graph) return null;
        if (place.string !== null && place.string !== undefined) {
            return { from: place.string, options: inString(studio, text, place), validFor: /^[^"\n]*$/ };
        }
        const word = context.matchBefore(/\w*/);
        if (word.from === word.to && !context.explicit) return null;
        const options = place.key === null ? keys(studio, place) : values(studio, place);
        return options.length ? { from: word.from, options, validFor: /^\w*$/ } : null;
    };
}

// The kind whose round brackets the place is in.
function kindAt(studio, { open }) {
    const last = open.at(-1);
    return last?.bracket === "(" ? (studio.hello.kinds.find(({ name }) => name === last.name) ?? null) : null;
}

function inString(studio, text, place) {
    const kind = kindAt(studio, place);
    const setting = kind?.settings.find(({ name }) => name === place.key);
    if (setting?.choices?.length) return setting.choices.map((label) => ({ label, type: "enum" }));
    if (place.key === "clock" || place.key === "of") {
        return [...text.matchAll(/"(\w+)"\s*:\s*(?:Driver|Derived)\(/g)].map(([, label]) => ({
            label,
            type: "constant",
            detail: "clock",
        }));
    }
    if (place.key === "surface" || studio.graph.parameters.some(({ name, is_surface }) => is_surface && name === place.key)) {
        return studio.graph.surfaces.map(({ path, name }) => ({ label: bare(path), detail: name, type: "text" }));
    }
    return studio.graph.ports.map(({ name, unit, rate_hz }) => ({
        label: name,
        detail: [unit, `${rate_hz} Hz`].filter(Boolean).join(", "),
        type: "variable",
    }));
}

function keys(studio, place) {
    const kind = kindAt(studio, place);
    if (!kind) return [];
    const own = [
        ...kind.inputs.map((item) => [item, "input"]),
        ...kind.settings.map((item) => [item, item.required ? "required" : "setting"]),
    ];
    const option = ([item, detail]) => ({
        label: item.name,
        apply: `${item.name}: `,
        detail,
        type: detail === "input" ? "variable" : "property",
        info: () => about(item.name + factsOf(item), item.doc),
        boost: item.required ? 2 : 0,
    });
    return [...own.map(option), { label: "clock", apply: 'clock: "', detail: "which clock", type: "property" }];
}

function values(studio, place) {
    const kind = kindAt(studio, place);
    const setting = kind?.settings.find(({ name }) => name === place.key);
    if (setting?.choices?.length) return setting.choices.map((label) => ({ label, type: "enum" }));
    if (kind) {
        const parameters = studio.graph.parameters.map(({ name }) => ({
            label: "Param",
            apply: `Param("${name}")`,
            detail: name,
            type: "keyword",
        }));
        const bridge = ({ name, gives }) => ({ label: name, apply: `${name}("`, detail: gives, type: "keyword" });
        return [...studio.hello.bridges.map(bridge), ...parameters];
    }
    return studio.hello.kinds.map(({ name, group, doc }) => ({
        label: name,
        apply: `${name}(`,
        detail: group,
        type: "class",
        info: () => about(name, doc),
    }));
}

function about(title, doc, more = null) {
    return make(
        "div",
        { class: "tip" },
        make("h4", { text: title }),
        make("p", {}, ...prose(doc)),
        more && make("p", { class: "soft", text: more }),
    );
}

// The documentation of what stands at `at`; null where there is none.
export function helpAt(studio, text, at) {
    if (!studio.hello) return null;
    const left = text.slice(0, at).match(/[\w./]*$/)[0].length,
        right = text.slice(at).match(/^[\w./]*/)[0].length;
    const [from, to] = [at - left, at + right];
    const word = text.slice(from, to);
    const place = placeOf(text, from);
    if (!word || place.comment) return null;
    const kind = studio.hello.kinds.find(({ name }) => name === word);
    const owner = kindAt(studio, place);
    const item = owner && [...owner.inputs, ...owner.settings].find(({ name }) => name === word);
    const port = studio.graph?.ports.find(({ name }) => name === word);
    if (kind && place.string === null) return { from, to, element: kindTip(kind) };
    if (item && place.string === null)
        return { from, to, element: about(item.name + factsOf(item), item.doc, `of ${owner.name}`) };
    if (port)
        return {
            from,
            to,
            element: about(
                port.name,
                `${port.quantity}, ${port.kind}`,
                [port.unit, `${port.rate_hz} Hz`].filter(Boolean).join(", "),
            ),
        };
    return null;
}

function kindTip({ name, group, doc, inputs, outputs, settings }) {
    const list = (items) => items.map((item) => item.name).join(", ");
    const parts = [
        ["inputs", inputs],
        ["outputs", outputs],
        ["settings", settings],
    ]
        .filter(([, items]) => items.length)
        .map(([title, items]) => `${title}: ${list(items)}`);
    return about(`${name} (${group})`, doc, parts.join(" — "));
}
