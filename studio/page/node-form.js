// The settings of a node in a form at its place in the drawing, and what it is connected to. The text of the editor is what is shown and
// changed.
import { jumpButton, pendingNote, refusal } from "./by-hand.js";
import { allInputs, connect, inputsOf, kindOf, names, outputsOf } from "./connect.js";
import { make } from "./dom.js";
import { factsOf } from "./node.js";
import { prose } from "./prose.js";
import * as changes from "./text-changes.js";

const SHORT = 60; // letters of a value that a form only names

// Returns a function that opens the form of a node, `device` being the kind of a device's body or null, at a place of the window.
export function mountForm(studio, boxes) {
    let shown = null; // { path, device, at, box, note: { key, element } }
    let isPressed = false; // what is pressed stays until it is let go
    let waits = false;
    const show = () => {
        const had = shown.box?.contains(document.activeElement) ? (document.activeElement.dataset.key ?? "") : null;
        const [isNew, scroll] = [!shown.box, shown.box?.scrollTop ?? 0];
        const say = (note) => shown && ((shown.note = note), follow());
        const form = { studio, ...shown, text: studio.edits.text(), say };
        waits = false;
        shown.box = boxes.open(`Settings of ${shown.path}`, shown.at, ...contentOf(form, boxes.close));
        shown.box.scrollTop = scroll;
        if (isNew || had !== null) {
            const kept = had ? shown.box.querySelector(`[data-key="${CSS.escape(had)}"]`) : isNew && shown.box.querySelector("[data-key]");
            (kept || shown.box).focus({ preventScroll: !isNew });
        }
        shown.box.addEventListener("focusout", () => waits && follow());
    };
    // Once the focus is where a key has led it.
    let timer = 0;
    const follow = () => {
        clearTimeout(timer);
        timer = setTimeout(followNow);
    };
    const followNow = () => {
        if (!shown?.box?.isConnected) return (shown = null);
        const isTyped = shown.box.contains(document.activeElement) && document.activeElement.dataset.isTyped;
        waits = isPressed || Boolean(isTyped);
        if (!waits) show();
    };
    window.addEventListener("pointerdown", ({ target }) => (isPressed = Boolean(shown?.box?.contains(target))), true);
    for (const type of ["pointerup", "pointercancel"])
        window.addEventListener(type, () => ((isPressed = false), waits && follow()), true);
    studio.on("text", follow);
    studio.on("graph", follow);
    return (path, device, at) => {
        if (!studio.edits.may()) return;
        if (studio.blind) return studio.say("warn", "End the blind comparison first: the settings name the surface.");
        shown = { path, device, at, note: null, box: null };
        show();
    };
}

function contentOf(form, close) {
    const { studio, path, device, text } = form;
    const found = device ? changes.deviceAt(text, path, device, studio.graph.endpoints) : changes.nodeAt(text, path);
    const use = found.use?.value;
    const kinds = studio.hello.kinds;
    const kind = device ? kinds.find(({ name }) => name === changes.nameOf(use)) : kindOf(studio, use);
    const header = make(
        "header",
        {},
        make("h3", { class: "clip", text: found.template ? path.split("/")[0] : path }),
        make("span", { class: "soft clip", text: changes.nameOf(use) ?? "" }),
        make("span", { class: "grow" }),
        use && jumpButton(studio, "Text", { from: found.use.from, to: use.to }),
        make("button", { class: "quiet", text: "Close", onclick: close }),
    );
    if (!use) return [header, make("p", { text: `The text of this graph has no \`${path}\` as it stands in the editor.` })];
    Object.assign(form, { node: path.split("/")[0], kind, isDevice: Boolean(device), path: found.template ? null : path });
    const isMoved = device && kind?.name !== device;
    const note = isMoved && make("p", { class: "soft", text: "A pad of this page takes its place here: what it does by itself acts where none does." });
    return [header, note, found.template && insideNote(form, found, path), ...settingsOf(form, use), ...(device ? [] : wiresOf(form))].filter(Boolean);
}

// Of a node inside the use of a template.
function insideNote({ studio, text }, { template, item }, path) {
    const own = changes.templateAt(text, template);
    const where = item ?? own;
    const includes = changes.itemsIn(text, "include").length ? "" : (text.match(/include\s*:\s*(\[[^\]]*\])/)?.[1] ?? "");
    const says = where
        ? ` is written in the template \`${template}\`, which every use of it shares. Below is what this use gives it.`
        : ` comes from the template \`${template}\`, which is not in this text but in a file of \`include\` ${includes}. Below is what this use gives it.`;
    return make("p", { class: "soft" }, ...prose(`\`${path}\`${says} `), where && jumpButton(studio, "Go to the template's text", { from: where.from, to: where.value.to }));
}

function settingsOf(form, use) {
    const { kind } = form;
    const specs = kind?.settings ?? [];
    const inputs = new Set(form.isDevice ? [] : inputsOf(form.studio, form.text, form.node).map(({ name }) => name));
    const others = (use.items ?? []).filter(({ key }) => key && !inputs.has(key) && !specs.some(({ name }) => name === key));
    const rows = [...specs, ...others.map(({ key }) => ({ name: key }))].flatMap((spec) => rowsOf(form, spec, []));
    return rows.length ? [make("h4", { text: "Settings" }), ...rows] : [make("p", { class: "soft", text: "No settings." })];
}

// The structure of the node in a text, or the one at a path of keys in it; null where it is not written.
function structureIn(form, text, keys) {
    const found = form.isDevice ? changes.deviceAt(text, form.path, form.device, form.studio.graph.endpoints) : changes.nodeAt(text, form.node);
    return keys.reduce((value, key) => changes.itemOf(value, key)?.value ?? null, found.use?.value ?? null);
}

// The change that gives the field at a path of keys a value, or takes it out (`null`).
function changeOf(form, keys, source, parts = []) {
    return (text) => {
        const name = keys.at(-1);
        const structure = structureIn(form, text, keys.slice(0, -1));
        if (source === null) return changes.itemOf(structure, name) ? changes.removed(text, structure, name) : [];
        if (structure) return changes.fieldChange(text, structure, name, source);
        // Its structure is not written: it is, with this field alone.
        return keys.length > 1 ? changeOf(form, keys.slice(0, -1), `${parts.at(-1) ?? ""}(${name}: ${source})`, parts.slice(0, -1))(text) : [];
    };
}

// The rows of a setting at a path of keys, with those of its fields.
function rowsOf(form, spec, keys, parts = []) {
    const path = [...keys, spec.name];
    const value = structureIn(form, form.text, path);
    const row = { form, spec, value, keys: path, parts, key: path.join(".") };
    const sort = value ? changes.sortOf(value) : null;
    if (sort === "parameter") return [parameterRow(row)];
    if (sort === "computed") return [textRow(row, "Computed")];
    const part = spec.parts?.find(({ choice }) => (choice ?? "") === (value ? (changes.nameOf(value) ?? "") : (spec.default?.match(/^[A-Za-z]\w*/)?.[0] ?? "")));
    const isList = value?.bracket === "[" || value?.bracket === "{" || (!value && /^[[{]/.test(spec.default ?? ""));
    const isUnknown = !part && (value?.bracket || (spec.parts?.length && !spec.choices?.length));
    if (isList || isUnknown) return [textRow(row)];
    const fields = (part?.fields ?? []).flatMap((field) => rowsOf(form, field, path, [...parts, part.choice]));
    if (spec.choices?.length) return [choiceRow(row), ...nested(fields)];
    if (part) return [labelled(row, make("span", { class: "soft", text: value ? "" : `default ${spec.default}` })), ...nested(fields)];
    return [scalarRow(row)];
}

const nested = (rows) => (rows.length ? [make("div", { class: "nested" }, ...rows)] : []);

function labelled({ form, spec, key, isAbove }, ...cells) {
    const note = form.note?.key === key ? form.note.element : null;
    const unit = make("span", { class: "unit", text: spec.unit ?? "" });
    return make("div", { class: "field", title: spec.doc ? spec.doc + factsOf(spec) : null }, make("span", { class: "name", text: spec.name }), ...cells, isAbove ? null : unit, note);
}

// A value that a form cannot show.
const textRow = ({ form, spec, value, key, ...row }, what = "") => {
    const written = value ? form.text.slice(value.from, value.to).replace(/\s+/g, " ") : `default ${spec.default}`;
    const short = written.length > SHORT ? `${written.slice(0, SHORT)}…` : written;
    const place = value ?? structureIn(form, form.text, []);
    return labelled({ form, spec, key, ...row }, make("span", { class: "written" }, make("code", { class: "mono", text: short }), what && ` ${what}`), jumpButton(form.studio, "Edit in the text", place));
};

// Makes a change and says at its row why, if it was refused.
async function commit({ form, key }, changesOf) {
    const { studio } = form;
    form.say(null);
    const reply = await studio.edits.change(changesOf);
    if (!reply.ok) form.say({ key, element: refusal(reply) });
    else if (reply.isPending) form.say({ key, element: pendingNote(studio) });
    return reply;
}

// The field of a scalar; `set` gets its source, or null where it is emptied.
function fieldOf({ form, spec, value, key }, set) {
    const { studio } = form;
    const label = `${spec.name} of ${form.node}`;
    const sort = sortFor(spec, value);
    const written = value && changes.nameOf(value) !== "None" ? changes.contentOf(value) : null;
    const content = sort === "number" && written !== null ? asField(written) : written;
    const shared = { "aria-label": label, "data-key": key };
    if (sort === "boolean") {
        const box = make("input", { ...shared, type: "checkbox", role: "switch", checked: (content ?? spec.default) === "true" });
        box.addEventListener("change", () => set(String(box.checked)));
        return box;
    }
    const list = spec.is_quantity ? studio.hello.quantities.map(({ name }) => name) : spec.name === "clock" ? changes.itemsIn(form.text, "clocks").map((each) => each.key) : null;
    if (list) return menu(shared, list, content, spec, (chosen) => set(chosen === null ? null : changes.quotedText(chosen)));
    const isNumber = sort === "number";
    const field = make("input", {
        ...shared,
        type: isNumber ? "number" : "text",
        step: isNumber ? "any" : null,
        min: spec.min,
        max: spec.max,
        value: content ?? "",
        placeholder: spec.default?.replace(/^"(.*)"$/, "$1") ?? "",
        spellcheck: "false",
        autocomplete: "off",
        list: !isNumber && spec.name === "surface" ? "surface-paths" : null,
    });
    field.addEventListener("input", () => (field.dataset.isTyped = "1"));
    field.addEventListener("change", () => {
        delete field.dataset.isTyped;
        if (field.value === (content ?? "") && field.validity.valid) return;
        if (isNumber && field.validity.badInput) return (field.value = content ?? "");
        const isEmpty = field.value === "";
        if (isEmpty && spec.required) return (field.value = content ?? "");
        set(isEmpty ? null : isNumber ? field.value : changes.quotedText(field.value));
    });
    return field;
}

// A number as a field of numbers takes it.
const asField = (written) => (/^-?\d+(\.\d+)?(e[+-]?\d+)?$/i.test(written) ? written : String(Number(written.replaceAll("_", ""))));

// What is written decides what a setting is, else what its specification says.
function sortFor({ default: otherwise, unit, min, live }, value) {
    const written = value && changes.sortOf(value);
    if (written && !["name", "other"].includes(written)) return written;
    if (/^(true|false)$/.test(otherwise ?? "")) return "boolean";
    if (/^"/.test(otherwise ?? "")) return "text";
    const isNumber = /^[+-]?[\d.]/.test(otherwise ?? "") || unit || typeof min === "number" || live;
    return isNumber ? "number" : "text";
}

function menu(shared, list, content, spec, set) {
    const options = content !== null && !list.includes(content) ? [content, ...list] : list;
    const empty = spec.required && content !== null ? [] : [make("option", { value: "", text: spec.default ? `default ${spec.default}` : "none" })];
    const field = make("select", shared, ...empty, ...options.map((name) => make("option", { value: name, text: name })));
    field.value = content ?? "";
    field.addEventListener("change", () => set(field.value === "" ? null : field.value));
    return field;
}

function scalarRow(row) {
    const { form, spec, keys, parts } = row;
    const { studio } = form;
    const live = keys.length === 1 && form.path && !form.isDevice ? studio.graph.settings.find(({ node, field }) => node === form.path && field === spec.name) : null;
    const before = live && studio.values.get(live.name);
    const field = fieldOf(row, async (source) => {
        const reply = await commit(row, changeOf(form, keys, source, parts));
        if (live && !reply.isKept) studio.set(live.name, before);
    });
    // A live setting acts while it is turned.
    if (live) field.addEventListener("input", () => field.value !== "" && field.validity.valid && studio.set(live.name, Number(field.value)));
    return labelled(row, field);
}

function choiceRow(row) {
    const { form, spec, value, keys, parts, key } = row;
    const present = value ? changes.nameOf(value) : null;
    const shared = { "aria-label": `${spec.name} of ${form.node}`, "data-key": key };
    const source = (choice) => {
        const part = spec.parts?.find((each) => each.choice === choice);
        return choice !== null && part?.fields.length ? `${choice}()` : choice;
    };
    return labelled(row, menu(shared, spec.choices, present, spec, (choice) => commit(row, changeOf(form, keys, source(choice), parts))));
}

// A setting that a parameter gives: the parameter's own default is changed.
function parameterRow(row) {
    const { form, spec, value } = row;
    const { studio } = form;
    const name = changes.parameterIn(value);
    const item = changes.parameterAt(form.text, name);
    const sort = item?.value && changes.sortOf(item.value);
    if (!["number", "boolean", "text", "name"].includes(sort)) return textRow({ ...row, value: item?.value ?? value }, `parameter ${name}`);
    const set = async (source) => {
        if (source === null) return form.say(null);
        const reply = await commit(row, (text) => {
            const at = changes.parameterAt(text, name)?.value;
            return at ? [{ from: at.from, to: at.to, insert: source }] : [];
        });
        const runs = studio.graph.parameters.find((each) => each.name === name);
        // What was set outside of the text would hide the change.
        if (reply.ok && !reply.isPending && runs && runs.value !== source) await studio.parameter(name, source);
    };
    const choices = spec.choices?.length && !spec.parts?.some(({ fields }) => fields.length) ? spec.choices : null;
    const given = { ...row, value: item.value, spec: { ...spec, required: true } };
    const shared = { "aria-label": `${spec.name} of ${form.node}`, "data-key": row.key };
    const field = choices ? menu(shared, choices, changes.nameOf(item.value), given.spec, set) : fieldOf(given, set);
    return labelled(row, field, make("span", { class: "soft from", text: `parameter ${name}, for all that use it` }));
}

// The inputs with their outputs, and the outputs with where they could lead.
function wiresOf(form) {
    const { studio, text, node } = form;
    const outputs = outputsOf(studio, text);
    const inputs = inputsOf(studio, text, node).map((input) => inputRow(form, input, outputs));
    const own = outputs.filter((output) => output.node === node);
    const targets = own.length ? allInputs(studio, text).filter((input) => !input.isMap) : [];
    return [
        ...(inputs.length ? [make("h4", { text: "Inputs" }), ...inputs] : []),
        ...(own.length ? [make("h4", { text: "Outputs" }), ...own.map((output) => outputRow(form, output, targets))] : []),
    ];
}

function inputRow(form, input, outputs) {
    const { studio, node } = form;
    const row = { form, spec: { name: input.label, doc: input.doc, unit: "" }, key: `input ${input.label}` };
    if (input.isMap) return textRow({ ...row, value: changes.itemOf(structureIn(form, form.text, []), input.name).value }, "");
    const present = outputs.find((output) => names(input.value, output));
    const written = input.value ? form.text.slice(input.value.from, input.value.to) : "";
    const options = outputs.map(({ name, unit }) => make("option", { value: name, text: unit ? `${name} (${unit})` : name }));
    const first = present ? [] : [make("option", { value: "", text: written || "not connected" })];
    const field = make("select", { "aria-label": `${input.label} of ${node}`, "data-key": row.key }, ...first, ...options);
    field.value = present?.name ?? "";
    field.addEventListener("change", () => {
        const output = outputs.find(({ name }) => name === field.value);
        if (output) wire(row, { node, input, output });
    });
    const bridge = input.value ? changes.bridgeOf(form.text, input.value)[0] : null;
    return labelled({ ...row, isAbove: true }, field, bridge && make("code", { class: "mono from", text: written }));
}

function outputRow(form, output, targets) {
    const row = { form, spec: { name: output.name.slice(output.node.length + 1), unit: output.unit }, key: `output ${output.name}` };
    const free = targets.filter(({ value }) => !names(value, output));
    const field = make(
        "select",
        { "aria-label": `Connect ${output.name} to`, "data-key": row.key },
        make("option", { value: "", text: "Connect to…" }),
        ...free.map(({ node, label }, i) => make("option", { value: String(i), text: `${node}: ${label}` })),
    );
    field.addEventListener("change", () => field.value !== "" && wire(row, { node: free[field.value].node, input: free[field.value], output }));
    return labelled({ ...row, isAbove: true }, field);
}

// Connects and says at the row what came of it.
async function wire(row, ends) {
    const { form, key } = row;
    form.say(null);
    const reply = await connect(form.studio, ends);
    const element = wireNote(form.studio, reply, (source) => wire(row, { ...ends, source }));
    form.say(element && { key, element });
}

// What came of a connection: null if it runs, else why not, with the bridges that the engine would take.
export function wireNote(studio, reply, again) {
    if (reply.inText !== undefined) {
        const says = "The connections of this input have names of their own in the text: add yours there. ";
        return make("p", { role: "alert" }, says, reply.inText && jumpButton(studio, "Edit in the text", reply.inText));
    }
    if (reply.ok) return reply.isPending ? pendingNote(studio) : null;
    const offers = (reply.offers ?? []).map(({ label, source }) => make("button", { text: label, onclick: () => again(source) }));
    return refusal(reply, offers.length ? make("p", { class: "offers" }, "The engine takes it so: ", ...offers) : null);
}
