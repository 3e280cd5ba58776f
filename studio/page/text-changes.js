// The smallest changes of a graph's text for what a hand does in its drawing: [{ from, to, insert }], all of them places in the
// text as it was. Nothing here knows the page or the engine.
import { commentsOf, treeOf, unquoted } from "./ron.js";

const BRIDGED_BY = new Set(["Delay", "Ring"]); // whose connection is the field `from`

// Text as a RON string.
export const quotedText = (text) => JSON.stringify(text);

export const itemOf = (value, key) => value?.items?.find((item) => item.key === key) ?? null;

const valueOf = (value, key) => itemOf(value, key)?.value ?? null;

// Where a node of the drawing stands in the text: { value, item, template, use }. Of one in the use of a template of the text `value`
// is the template's own node; of one whose template is in another file it is null, and `use` is what the text has.
export function nodeAt(text, path) {
    const graph = treeOf(text);
    const [first, ...rest] = path.split("/");
    const use = itemOf(valueOf(graph, "nodes"), first);
    let item = use,
        template = null;
    for (const name of rest) {
        template = item?.value?.name ?? template;
        item = itemOf(valueOf(valueOf(valueOf(graph, "templates"), item?.value?.name), "nodes"), name);
    }
    return { item, value: item?.value ?? null, template: rest.length ? template : null, use };
}

// A template of the text itself; null if it is in another file.
export const templateAt = (text, name) => itemOf(valueOf(treeOf(text), "templates"), name);

// Where a device stands: of that kind, else in the set of endpoints that runs, where a pad may take its place.
export function deviceAt(text, name, kind, set) {
    const sets = valueOf(treeOf(text), "endpoints")?.items ?? [];
    const ordered = [...sets.filter(({ key }) => key === set), ...sets.filter(({ key }) => key !== set)];
    const items = ordered.map(({ value }) => itemOf(value, name)).filter(Boolean);
    const item = items.find(({ value }) => nameOf(value) === kind) ?? items[0] ?? null;
    return { item, value: item?.value ?? null, template: null, use: item };
}

// The items of a part of the graph, such as "nodes" and "clocks".
export const itemsIn = (text, part) => (valueOf(treeOf(text), part)?.items ?? []).filter(({ key }) => key !== null);

// The name of a structure, or of a bare name.
export const nameOf = (value) => value?.name || (/^[A-Za-z_]\w*$/.test(value?.text ?? "") ? value.text : null);

// A value without the `Some` around it.
const within = (value) => (value?.name === "Some" && value.items.length === 1 ? value.items[0].value : value);

// What a value is for a form: "number", "boolean", "text", "name", "parameter", "computed", or "other".
export function sortOf(value) {
    const inner = within(value);
    if (inner?.name === "Param" && inner.items[0]?.value?.text) return "parameter";
    if (["Expr", "Setting", "Input"].includes(inner?.name)) return "computed";
    if (!inner || inner.bracket) return "other";
    if (inner.text === "true" || inner.text === "false") return "boolean";
    if (/^r?#*"/.test(inner.text)) return "text";
    return /^[+-]?[\d.]/.test(inner.text) ? "number" : "name";
}

// The parameter that a value names.
export const parameterIn = (value) => (sortOf(value) === "parameter" ? unquoted(within(value).items[0].value.text) : null);

// The default of a parameter in the text; null if it has none.
export const parameterAt = (text, name) => itemOf(valueOf(treeOf(text), "parameters"), name);

// What a scalar holds, without quotes.
export const contentOf = (value) => (sortOf(value) === "text" ? unquoted(within(value).text) : (within(value)?.text ?? null));

const replaced = ({ from, to }, insert) => [{ from, to, insert }];

// Gives a field of a structure a value (`source`), which replaces what it has, but for a `Some` around it.
export function fieldChange(text, structure, name, source) {
    const value = valueOf(structure, name);
    if (value) return replaced(within(value), source);
    return added(text, structure, `${name}: ${source}`);
}

// Puts `source` after the last item of a structure, list or map, in the way in which its items are written.
export function added(text, structure, source) {
    if (!structure.bracket) return [{ from: structure.to, to: structure.to, insert: `(${source})` }];
    const last = structure.items.at(-1);
    if (!last?.value) return [{ from: structure.open + 1, to: structure.open + 1, insert: source }];
    const end = last.comma === null ? last.value.to : last.comma + 1;
    const line = text.lastIndexOf("\n", last.from - 1) + 1;
    const indent = text.slice(line, last.from);
    const after = (text.indexOf("\n", end) + 1 || text.length + 1) - 1;
    const isAlone = indent.trim() === "" && line > 0 && after < structure.close;
    const isInComment = commentsOf(text).some(([from, to]) => from < after && after < to);
    if (isAlone && !isInComment) {
        const comma = last.comma === null ? [{ from: end, to: end, insert: "," }] : [];
        return [...comma, { from: after, to: after, insert: `\n${indent}${source},` }];
    }
    return [{ from: end, to: end, insert: last.comma === null ? `, ${source}` : ` ${source},` }];
}

// Takes a field out of a structure, so that it has its default.
export function removed(text, structure, name) {
    const place = structure.items.findIndex(({ key }) => key === name);
    const { from, value, comma } = structure.items[place];
    const before = structure.items[place - 1];
    const isAfterComma = comma === null && before && text.slice(before.comma + 1, from).trim() === "";
    if (isAfterComma) return [{ from: before.comma, to: value.to, insert: "" }];
    const end = comma === null ? value.to : comma + 1;
    const spaces = text.slice(end).match(/^[ \t]*/)[0].length;
    const line = text.lastIndexOf("\n", from - 1) + 1;
    const isLine = text.slice(line, from).trim() === "" && /^(\n|$)/.test(text.slice(end + spaces));
    if (isLine) return [{ from: line, to: Math.min(text.length, end + spaces + 1), insert: "" }];
    return [{ from, to: end + spaces, insert: "" }];
}

// The connections that a value holds: [{ key, value }]; of a list and a map one for each item.
export function connectionsIn(value) {
    if (!value) return [];
    const isSeveral = value.bracket === "[" || value.bracket === "{";
    return isSeveral ? value.items.filter((item) => item.value).map(({ key, value: each }) => ({ key, value: each })) : [{ key: null, value }];
}

// The string in a connection, within its bridges; null where it is none, such as `Input("force")`.
export function referenceIn(value) {
    if (sortOf(value) === "text") return value;
    const inner = BRIDGED_BY.has(value?.name) ? valueOf(value, "from") : value?.items?.length === 1 && value.items[0].key === null ? value.items[0].value : null;
    return inner && !["Param", "Input", "Setting", "Expr"].includes(value.name) ? referenceIn(inner) : null;
}

// The outermost bridge of a connection, as written before and after the string; [] without one.
export const bridgeOf = (text, value) => {
    const inner = referenceIn(value);
    return inner && inner !== value ? [text.slice(value.from, inner.from), text.slice(inner.to, value.to)] : [];
};

// Connects an input of a node to an output. `slot` is the place in a list or a map, or null to add to it; `wrapped` is the connection
// with another bridge than the present one, in whose place it comes. null if a hand cannot: in a map, whose items have names.
export function connection(text, node, { name, slot = null, isSeveral = false }, output, wrapped = null) {
    const given = valueOf(node, name);
    const source = wrapped ?? quotedText(output);
    if (!given) return added(text, node, `${name}: ${isSeveral ? `[${source}]` : source}`);
    if (given.bracket === "{" && slot === null) return null;
    if (given.bracket === "[" && slot === null) return added(text, given, source);
    const present = connectionsIn(given)[slot ?? 0]?.value;
    if (!present) return null;
    if (wrapped) return replaced(present, wrapped);
    const reference = referenceIn(present);
    return replaced(reference ?? present, source);
}

// The input that the drawing names at a node: { name, slot }. It names a connection with a name by that, the others by their port, in
// their order.
export function inputAt(node, inputs, shown, place) {
    if (inputs.some(({ name }) => name === shown)) {
        const given = valueOf(node, shown);
        return { name: shown, slot: connectionsIn(given).length > place && given ? place : null };
    }
    for (const { name } of inputs) {
        const given = valueOf(node, name);
        const slot = connectionsIn(given).findIndex(({ key }) => key === shown);
        if (slot >= 0) return { name, slot };
        const names = valueOf(node, "names")?.items?.findIndex(({ value }) => contentOf(value) === shown) ?? -1;
        if (given?.bracket === "[" && names >= 0) return { name, slot: names };
    }
    return null;
}

// The text with changes made.
export function changed(text, changes) {
    return [...changes].sort((a, b) => b.from - a.from).reduce((all, { from, to, insert }) => all.slice(0, from) + insert + all.slice(to), text);
}
