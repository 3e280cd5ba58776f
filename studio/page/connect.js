// Connections that a hand makes: what an input and an output are called in the text, the change that connects them, and what the engine
// would take where it refuses that.
import { changed, connection, connectionsIn, contentOf, itemOf, itemsIn, nameOf, nodeAt, quotedText, referenceIn, templateAt } from "./text-changes.js";

const CROSSES_CLOCKS = ["E0405", "E0406", "E0407"];
const RING_MS = 12;

export const kindOf = ({ hello }, value) => hello.kinds.find(({ name, group }) => name === nameOf(value) && group !== "devices") ?? null;

// The outputs that an input of the graph can name: [{ name, node, unit, port }], `port` being what the drawing names.
export function outputsOf(studio, text) {
    const ofNode = ({ key: node, value }) =>
        (kindOf(studio, value)?.outputs ?? []).flatMap(({ name, unit, named_by }) => {
            const ports = named_by ? (itemOf(value, named_by)?.value?.items ?? []).map((each) => contentOf(each.value)) : [name];
            return ports.map((port) => ({ name: `${node}.${port}`, node, unit, port: `${node}.${port}` }));
        });
    const inside = studio.graph.template_outputs.filter(({ name }) => !name.includes("/"));
    return [
        ...itemsIn(text, "nodes").flatMap(ofNode),
        ...inside.map(({ name, port }) => ({ name, node: name.slice(0, name.lastIndexOf(".")), unit: "", port })),
    ];
}

// The inputs of a node of the text: [{ name, slot, label, isSeveral, isMap, value }], `slot` null for one more connection. Those of the use of
// a template are what it connects, and what the template names if it is in the text.
export function inputsOf(studio, text, node) {
    const { value } = nodeAt(text, node);
    const kind = kindOf(studio, value);
    if (!kind) return inputsOfUse(studio, text, value);
    return kind.inputs.flatMap(({ name, several, doc, unit }) => {
        const given = itemOf(value, name)?.value;
        const facts = { name, isSeveral: several, doc, unit };
        const present = connectionsIn(given).map(({ key, value: each }, slot) => {
            const label = key === null ? (several ? `${name} ${slot + 1}` : name) : `${name} ${key}`;
            return { ...facts, slot, label, value: each };
        });
        if (!several) return present.length ? present : [{ ...facts, slot: null, label: name, value: null }];
        return [...present, { ...facts, slot: null, label: `${name}, one more`, value: null, isMap: given?.bracket === "{" }];
    });
}

function inputsOfUse(studio, text, use) {
    const known = new Set(outputsOf(studio, text).flatMap(({ name, node }) => [name, node]));
    const declared = namedBy(text, nameOf(use));
    const isInput = ({ key, value }) => key !== "clock" && (declared.includes(key) || known.has(contentOf(referenceIn(value))));
    const items = (use?.items ?? []).filter(isInput).map(({ key, value }) => ({ name: key, slot: 0, label: key, value }));
    const others = declared.filter((name) => !itemOf(use, name)).map((name) => ({ name, slot: null, label: name, value: null }));
    return [...items, ...others];
}

// The inputs of a template of the text.
function namedBy(text, template) {
    const inputs = itemOf(templateAt(text, template)?.value, "inputs")?.value;
    return (inputs?.items ?? []).map(({ value }) => contentOf(value)).filter(Boolean);
}

// Every input of the text's nodes, for a list: [{ node, ...input }].
export const allInputs = (studio, text) => itemsIn(text, "nodes").flatMap(({ key: node }) => inputsOf(studio, text, node).map((input) => ({ node, ...input })));

// An output as short as it can be named.
function shortest(studio, text, { name, node }) {
    const outputs = outputsOf(studio, text).filter((each) => each.node === node);
    return outputs.length === 1 ? node : name;
}

// True if a connection names an output already.
export const names = (value, { name, node }) => {
    const written = value && contentOf(referenceIn(value));
    return written === name || written === node;
};

// Connects; the reply as of `edits.change`, with `offers` ([{ label, source }]) where it crosses clocks, and `inText` where a hand cannot.
export async function connect(studio, { node, input, output, source = null }) {
    const { edits, connection: engine } = studio;
    const text = edits.text();
    const written = shortest(studio, text, output);
    const changesOf = (wrapped) => (now) => {
        const { value } = nodeAt(now, node);
        return (value && connection(now, value, input, written, wrapped)) ?? [];
    };
    const { value } = nodeAt(text, node);
    if (!value || connection(text, value, input, written) === null) return { ok: false, isKept: false, inText: value };
    const accepts = async (wrapped) => (await engine.request({ type: "check", text: changed(text, changesOf(wrapped)(text)) })).ok;
    // A bridge stays where it is needed.
    const present = connectionsIn(itemOf(value, input.name)?.value)[input.slot ?? 0]?.value;
    const isBridged = !source && present && input.slot !== null && referenceIn(present) !== present && present.name !== "Delay";
    const plain = quotedText(written);
    const wrapped = source ?? (isBridged && !edits.isPending() && (await accepts(plain)) ? plain : null);
    const reply = await edits.change(changesOf(wrapped));
    if (reply.isKept || !reply.diagnostics?.some(({ code }) => CROSSES_CLOCKS.includes(code))) return reply;
    const forms = [
        { label: "Without a bridge", source: plain },
        ...studio.hello.bridges.map(({ name, gives }) => ({ label: `${name}(…): ${gives}`, source: `${name}(${plain})` })),
        { label: `Ring(…): between drivers, ${RING_MS} ms late`, source: `Ring(from: ${plain}, latency_ms: ${RING_MS})` },
    ];
    const offers = [];
    for (const form of forms) if (await accepts(form.source)) offers.push(form);
    return { ...reply, offers };
}
