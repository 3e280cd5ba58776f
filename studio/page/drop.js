// What a wire is let go on is connected. Where the drawing shows no ports, or several fit, a person chooses them there.
import { connect, inputsOf, kindOf, outputsOf } from "./connect.js";
import { make } from "./dom.js";
import { wireNote } from "./node-form.js";
import { inputAt, nodeAt } from "./text-changes.js";

const split = (port) => [port.slice(0, port.lastIndexOf(".")), port.slice(port.lastIndexOf(".") + 1)];

// Connects an output of the drawing to what a wire was dropped on.
export function drop(studio, boxes, from, target, at) {
    const text = studio.edits.text();
    const [source, port] = split(from);
    const isOf = (output) => (port ? output.port === from : output.node === source || output.port.startsWith(`${source}/`) || output.port.startsWith(`${source}.`));
    const outputs = outputsOf(studio, text).filter(isOf);
    if (outputs.length === 0) return say(boxes, at, noOutput(studio, from));
    const node = target.closest("[data-node]").getAttribute("data-node");
    if (!nodeAt(text, node.split("/")[0]).value) return say(boxes, at, `The text has no node \`${node}\`: wires lead to nodes.`);
    const inputs = inputsFor(studio, text, node, target);
    if (inputs.length === 0) return say(boxes, at, `\`${node}\` has no input that a wire can lead to.`);
    const ends = { node: node.split("/")[0], outputs, inputs };
    if (outputs.length === 1 && inputs.length === 1) return join(studio, boxes, at, { ...ends, output: outputs[0], input: inputs[0] });
    choose(studio, boxes, at, ends);
}

const noOutput = (studio, from) =>
    from.includes("/")
        ? `\`${from}\` is inside a template: from outside only what the template names as its outputs can be connected${studio.graph.template_outputs.length ? `: ${studio.graph.template_outputs.map(({ name }) => name).join(", ")}` : ""}.`
        : `The text as it stands has no output \`${from}\`.`;

// The inputs that are meant by what a wire was dropped on: one, or those of the node among which to choose.
function inputsFor(studio, text, node, target) {
    const [first, ...inner] = node.split("/");
    const all = inputsOf(studio, text, first).filter((input) => !input.isMap);
    if (inner.length || !target.hasAttribute("data-input")) return all;
    const [, shown] = split(target.getAttribute("data-input"));
    const alike = [...target.closest("[data-node]").querySelectorAll("[data-input]")].filter((each) => each.getAttribute("data-input") === target.getAttribute("data-input"));
    const { value } = nodeAt(text, first);
    const meant = inputAt(value, kindOf(studio, value)?.inputs ?? [], shown, alike.indexOf(target));
    return meant ? all.filter(({ name, slot }) => name === meant.name && slot === meant.slot) : all;
}

const say = (boxes, at, text) => boxes.open("A wire", at, make("p", { role: "alert", text }), make("button", { class: "quiet", text: "Close", onclick: boxes.close })).focus();

async function join(studio, boxes, at, ends) {
    const { node, input, output, source = null } = ends;
    const reply = await connect(studio, { node, input, output, source });
    const note = wireNote(studio, reply, (wrapped) => join(studio, boxes, at, { ...ends, source: wrapped }));
    if (!note) return boxes.close();
    const title = make("h3", { text: `${output.name} to ${node}, ${input.label}` });
    boxes.open("A wire", at, title, note, make("button", { class: "quiet", text: "Close", onclick: boxes.close })).focus();
}

// Which output and which input, where several fit.
function choose(studio, boxes, at, { node, outputs, inputs }) {
    const menu = (label, options, name) => make("select", { "aria-label": label }, ...options.map((option, i) => make("option", { value: String(i), text: name(option) })));
    const from = menu("Output", outputs, ({ name }) => name);
    const to = menu("Input", inputs, ({ label }) => label);
    const connectIt = () => join(studio, boxes, at, { node, output: outputs[from.value], input: inputs[to.value] });
    boxes.open(
        "A wire",
        at,
        make("h3", { text: `A wire to ${node}` }),
        make("label", { class: "field" }, make("span", { class: "name", text: "Output" }), from),
        make("label", { class: "field" }, make("span", { class: "name", text: "Input" }), to),
        make("div", { class: "offers" }, make("button", { class: "primary", text: "Connect", onclick: connectIt }), make("button", { class: "quiet", text: "Close", onclick: boxes.close })),
    );
    (outputs.length > 1 ? from : to).focus();
}
