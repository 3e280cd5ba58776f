// Completion and documentation in the editor, from the engine's catalogue.
import { make } from "./dom.js";
import { DERIVED, DRIVER, GRAPH } from "./keys.js";
import { factsOf } from "./node.js";
import { prose } from "./prose.js";
import { placeOf } from "./ron.js";
import { bare } from "./surfaces.js";

const CLOCKS = {
    Driver: { doc: "A clock with a crystal or timer of its own.", keys: DRIVER },
    Derived: { doc: "A clock that is an exact ratio of another.", keys: DERIVED },
};
const PARAM = "The value of a parameter of the graph.";
const WITHOUT_PORTS = ["about", "clocks", "defaults", "endpoints", "include", "parameters"];

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
        return options.length ? { from: word.from, options: options.map(before(text, context.pos)), validFor: /^\w*$/ } : null;
    };
}

// An option without what follows the place already: an opening bracket or a colon.
function before(text, at) {
    const follows = text.slice(at).match(/^\s*([(:])/)?.[1];
    const cut = (apply) => (follows && apply?.includes(follows) ? apply.slice(0, apply.indexOf(follows)) : apply);
    return (option) => ({ ...option, apply: cut(option.apply) });
}

// The structure whose fields are at the place, as { of, inputs, settings, ... }; null if there is none.
function structureAt(studio, { open }) {
    let structure = null,
        section = null,
        list = null; // the key of the list that goes on
    for (const { bracket, name, key } of open) {
        if (bracket === "[") list = key;
        else if (bracket === "{") [structure, section, list] = [null, key, null];
        else [structure, list] = [inner(studio, structure, section, name, key ?? list), null];
    }
    return open.at(-1)?.bracket === "(" ? structure : null;
}

// The structure that begins with `name(` as the value of `key` in another one.
function inner(studio, structure, section, name, key) {
    if (name === "Graph") return tableOf(name, GRAPH);
    if (section === "clocks" && Object.hasOwn(CLOCKS, name)) return tableOf(name, CLOCKS[name].keys);
    const setting = structure?.settings.find((each) => each.name === key);
    const part = setting?.parts?.find(({ choice }) => (choice ?? "") === name);
    if (part) return { of: name || key, inputs: [], settings: part.fields };
    const kind = studio.hello.kinds.find((each) => each.name === name);
    return kind ? { ...kind, of: name, hasClock: kind.group !== "devices" } : null;
}

const tableOf = (of, table) => ({ of, inputs: [], settings: Object.entries(table).map(([name, doc]) => ({ name, doc })) });

// The part of the graph that the place is in: "nodes", "clocks".
const sectionOf = ({ open, key }) => (open[0]?.name === "Graph" ? (open[1]?.key ?? key) : null);

const settingAt = (structure, { key }) => structure?.settings.find(({ name }) => name === key) ?? null;

const isQuantity = (setting) => setting?.is_quantity ?? setting?.name === "quantity";

const isParameter = ({ open }) => open.at(-1)?.name === "Param";

function inString(studio, text, place) {
    const setting = settingAt(structureAt(studio, place), place);
    const { graph } = studio;
    if (setting?.choices?.length) return setting.choices.map((label) => ({ label, type: "enum" }));
    if (isQuantity(setting)) return quantities(studio, (name) => name);
    if (isParameter(place))
        return graph.parameters.map(({ name, value }) => ({ label: name, detail: bare(value), type: "constant" }));
    if (place.key === "clock" || place.key === "of")
        return clocksOf(text).map(({ name, rate }) => ({ label: name, type: "constant", detail: rate ?? "clock" }));
    if (place.key === "surface" || graph.parameters.some(({ name, is_surface }) => is_surface && name === place.key))
        return graph.surfaces.map(({ path, name }) => ({ label: bare(path), detail: name, type: "text" }));
    const isName = place.key === null && place.open.at(-1)?.bracket === "{";
    if (setting || isName || WITHOUT_PORTS.includes(sectionOf(place))) return [];
    return portsOf(studio, text).map(({ name, detail }) => ({ label: name, detail, type: "variable" }));
}

const quantities = ({ hello }, apply) =>
    (hello.quantities ?? []).map(({ name, unit }) => ({
        label: name,
        apply: apply(name),
        detail: unit || "1",
        type: "constant",
    }));

// The clocks of a text, { name, kind, rate }; the last one of each name.
const clocksOf = (text) =>
    [...text.matchAll(/"([^"\\\n]+)"\s*:\s*(Driver|Derived)\(([^{}]*?)\)\s*[,}/]/g)].map(([, name, kind, fields]) => {
        const rate = fields.match(/rate_hz\s*:\s*([\d._e]+)/)?.[1];
        return { name, kind, rate: rate ? `${rate} Hz` : null };
    });

// The kind of each node that a text has by name.
function nodesOf({ hello }, text) {
    const found = text.matchAll(/"([^"\\\n]+)"\s*:\s*([A-Z]\w*)\(/g);
    const kinds = [...found].map(([, name, kind]) => [name, hello.kinds.find((each) => each.name === kind)]);
    return new Map(kinds.filter(([, kind]) => kind && kind.group !== "devices"));
}

// The names that a setting of a node lists in the text.
function namesIn(text, node, setting) {
    const begin = text.search(new RegExp(`"${node.replace(/\W/g, "\\$&")}"\\s*:\\s*[A-Z]\\w*\\(`));
    const list = text.slice(begin).match(new RegExp(`\\b${setting}\\s*:\\s*\\[([^\\]]*)\\]`))?.[1] ?? "";
    return [...list.matchAll(/"([^"\\\n]+)"/g)].map(([, name]) => name);
}

// The outputs of the running graph, and of the nodes that only the text has.
function portsOf(studio, text) {
    const running = studio.graph.ports.map(({ name, unit, rate_hz }) => [
        name,
        [unit, `${rate_hz} Hz`].filter(Boolean).join(", "),
    ]);
    const written = [...nodesOf(studio, text)].flatMap(([node, { name: kind, outputs }]) =>
        outputs.flatMap(({ name, unit, named_by }) =>
            (named_by ? namesIn(text, node, named_by) : [name]).map((port) => [
                `${node}.${port}`,
                [unit, kind].filter(Boolean).join(", "),
            ]),
        ),
    );
    return [...new Map([...written, ...running])].map(([name, detail]) => ({ name, detail }));
}

function keys(studio, place) {
    const structure = structureAt(studio, place);
    if (!structure) return [];
    const own = [
        ...structure.inputs.map((item) => [item, item.named ? "inputs by name" : "input"]),
        ...structure.settings.map((item) => [
            item,
            [item.required ? "required" : null, item.unit].filter(Boolean).join(", ") || "setting",
        ]),
    ];
    const option = ([item, detail]) => ({
        label: item.name,
        apply: `${item.name}: `,
        detail,
        type: detail === "input" ? "variable" : "property",
        info: () => element(tipOf(item)),
        boost: item.required ? 2 : 0,
    });
    const clock = { label: "clock", apply: 'clock: "', detail: "which clock", type: "property" };
    return [...own.map(option), ...(structure.hasClock ? [clock] : [])];
}

function values(studio, place) {
    const structure = structureAt(studio, place);
    const setting = settingAt(structure, place);
    if (setting?.choices?.length) return setting.choices.map((label) => choice(setting, label));
    const parameters = studio.graph.parameters.map(({ name }) => ({
        label: "Param",
        apply: `Param("${name}")`,
        detail: name,
        type: "keyword",
    }));
    if (isQuantity(setting)) return [...quantities(studio, (name) => `"${name}"`), ...parameters];
    if (structure?.of === "Graph" || (structure && Object.hasOwn(CLOCKS, structure.of))) return [];
    if (setting) {
        const { default: otherwise } = setting;
        const usual = { label: String(otherwise), detail: factsOf({ ...setting, default: null }).trim(), type: "constant" };
        return [...(otherwise ? [usual] : []), ...parameters];
    }
    const bridges = studio.hello.bridges.map(({ name, gives }) => ({
        label: name,
        apply: `${name}("`,
        detail: gives,
        type: "keyword",
    }));
    return structure ? [...bridges, ...parameters] : kinds(studio, sectionOf(place));
}

function choice({ parts, choices }, label) {
    const part = parts?.[choices.indexOf(label)];
    const apply = part?.fields.length ? `${label}(` : label;
    return { label, apply, type: "enum", info: part?.doc ? () => element({ title: label, doc: part.doc }) : null };
}

// The possible values of a field in a part of the graph.
function kinds(studio, section) {
    if (section === "clocks")
        return Object.entries(CLOCKS).map(([name, { doc }]) => ({
            label: name,
            apply: `${name}(`,
            type: "class",
            info: () => element({ title: name, doc }),
        }));
    if (["parameters", "defaults", "include"].includes(section)) return [];
    const all = studio.hello.kinds.filter(
        ({ group }) => !["nodes", "endpoints"].includes(section) || (group === "devices") === (section === "endpoints"),
    );
    return all.flatMap((kind) => {
        const option = { apply: `${kind.name}(`, type: "class", info: () => element({ title: kind.name, doc: kind.doc }) };
        const others = elsewhere(kind.doc).map((label) => ({ ...option, label, detail: kind.name, boost: -1 }));
        return [{ ...option, label: kind.name, detail: kind.group }, ...others];
    });
}

// Names of a kind in other programs, from its description.
const elsewhere = (doc) => doc.match(/Elsewhere: ([^.]*(?:\.\w[^.]*)*)\.$/)?.[1].split(", ") ?? [];

// The documentation of the word at `at`, as { from, to, element }; null if there is none.
export function helpAt(studio, text, at) {
    const help = helpOf(studio, text, at);
    return help && { from: help.from, to: help.to, element: element(help) };
}

// The same as { from, to, title, doc, more }.
export function helpOf(studio, text, at) {
    if (!studio.hello) return null;
    const place = placeOf(text, at);
    if (place.comment) return null;
    const isString = place.string !== null && place.string !== undefined;
    const left = text.slice(0, at).match(/\w*$/)[0].length,
        right = text.slice(at).match(/^\w*/)[0].length;
    const [from, to] = isString ? stringAt(text, place) : [at - left, at + right];
    const word = text.slice(from, to);
    if (!word) return null;
    const tip = isString ? inStringTip(studio, text, place, word) : wordTip(studio, placeOf(text, from), word);
    return tip && { from, to, ...tip };
}

const stringAt = (text, { string, end }) => [string, text[end - 1] === '"' && end > string ? end - 1 : end];

function wordTip(studio, place, word) {
    const { kinds: known, bridges } = studio.hello;
    const structure = structureAt(studio, place);
    const item = structure && [...structure.inputs, ...structure.settings].find(({ name }) => name === word);
    if (item && place.key === null) return { ...tipOf(item), more: `of ${structure.of}` };
    const part = settingAt(structure, place)?.parts?.find((each) => each.choice === word);
    if (part) return { title: word, doc: part.doc, more: listed([["fields", part.fields]]) };
    const kind = known.find(({ name }) => name === word);
    if (kind) return kindTip(kind);
    const bridge = bridges.find(({ name }) => name === word);
    if (bridge) return { title: `${word} (bridge)`, doc: `From one clock to another: it gives ${bridge.gives}.` };
    if (Object.hasOwn(CLOCKS, word)) return { title: `${word} (clock)`, doc: CLOCKS[word].doc };
    return word === "Param" ? { title: word, doc: PARAM } : null;
}

function inStringTip(studio, text, place, word) {
    const section = sectionOf(place);
    const isName = place.key === null && place.open.at(-1)?.bracket === "{";
    if (isQuantity(settingAt(structureAt(studio, place), place))) {
        const quantity = studio.hello.quantities?.find(({ name }) => name === word);
        return quantity ? { title: word, doc: `A quantity, in ${quantity.unit || "plain numbers"}.` } : null;
    }
    if (isParameter(place) || (isName && section === "parameters")) return parameterTip(studio, word);
    if (["clock", "of"].includes(place.key) || (isName && section === "clocks")) {
        const clock = clocksOf(text).find(({ name }) => name === word);
        return clock ? { title: `${word} (${clock.kind})`, doc: CLOCKS[clock.kind].doc, more: clock.rate } : null;
    }
    return portTip(studio, text, word);
}

function parameterTip({ graph }, word) {
    const parameter = graph?.parameters.find(({ name }) => name === word);
    if (!parameter) return null;
    const { value, default: otherwise, doc, unit, min, max } = parameter;
    return {
        title: word + factsOf({ unit, min, max, default: otherwise }),
        doc: doc || "A parameter of the graph.",
        more: `now ${value}`,
    };
}

// An output, by its name, or by its node's name if it is the node's only output.
function portTip(studio, text, word) {
    const nodes = nodesOf(studio, text);
    const dot = word.lastIndexOf(".");
    const kind = nodes.get(word);
    const owner = nodes.get(word.slice(0, dot)) ?? (kind?.outputs.length === 1 ? kind : null);
    const output =
        owner?.outputs.find(({ name }) => name === word.slice(dot + 1)) ??
        owner?.outputs.find(({ named_by }) => named_by) ??
        (dot < 0 ? owner?.outputs[0] : null);
    const port = studio.graph?.ports.find(({ name, node }) => name === word || (node === word && output));
    if (port) {
        const facts = [port.unit, `${port.rate_hz} Hz`].filter(Boolean).join(", ");
        return output
            ? { title: port.name, doc: output.doc, more: [port.quantity, facts].filter(Boolean).join(", ") }
            : { title: port.name, doc: `${port.quantity}, ${port.kind}`, more: facts };
    }
    if (output && dot >= 0) return { ...tipOf(output), more: `of ${owner.name}` };
    return kind ? kindTip(kind) : null;
}

const tipOf = (item) => ({ title: item.name + factsOf(item), doc: item.doc });

const listed = (lists) =>
    lists
        .filter(([, items]) => items.length)
        .map(([title, items]) => `${title}: ${items.map(({ name }) => name).join(", ")}`)
        .join(" — ") || null;

function kindTip({ name, group, doc, inputs, outputs, settings }) {
    const more = listed([
        ["inputs", inputs],
        ["outputs", outputs],
        ["settings", settings],
    ]);
    return { title: `${name} (${group})`, doc, more };
}

function element({ title, doc, more = null }) {
    return make(
        "div",
        { class: "tip" },
        make("h4", { text: title }),
        make("p", {}, ...prose(doc)),
        more && make("p", { class: "soft", text: more }),
    );
}
