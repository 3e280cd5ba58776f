// All live settings by node, and the graph's parameters; presets of both in a file.
import { controlRow } from "./control.js";
import { find, make, save, setText } from "./dom.js";
import { inputsSection } from "./inputs.js";
import { bare } from "./surfaces.js";

const PRESET_VERSION = 1;
const HASH = "#preset=";
const MAX_LINK = 16_000;

export function mountControls(studio) {
    let rows = [],
        shape = null;
    studio.on("graph", (graph) => {
        const now = JSON.stringify([
            graph.settings.map(({ value, ...rest }) => rest),
            graph.parameters.map(({ value, ...rest }) => ({ ...rest, isTurned: isTurned({ value, ...rest }) })),
            graph.surfaces.map(({ path }) => path),
            graph.inputs,
        ]);
        if (now !== shape) {
            for (const row of rows) row.dispose();
            rows = rebuild(studio, graph);
            shape = now;
        }
        showParameters(studio);
    });
    studio.on("compared", () => showParameters(studio));
    find("preset-save").addEventListener("click", () => savePreset(studio));
    find("preset-load").addEventListener("change", async (event) => {
        const [file] = event.target.files;
        if (file) await studio.loadPreset(file);
        event.target.value = "";
    });
    find("preset-link").addEventListener("click", () => linkPreset(studio));
    studio.loadPreset = async (file) => takePreset(studio, file.name, await file.text());
    let isLoaded = false;
    const loadOnce = ({ owner }) => {
        if (isLoaded || !owner || !studio.graph) return;
        isLoaded = true;
        loadLink(studio);
    };
    studio.on("status", loadOnce);
    window.addEventListener("hashchange", () => loadLink(studio));
}

function rebuild(studio, graph) {
    const nodes = new Map();
    for (const setting of graph.settings) nodes.set(setting.node, [...(nodes.get(setting.node) ?? []), setting]);
    const rows = [];
    const groups = [...nodes].map(([node, settings]) => {
        const made = settings.map((setting) => controlRow(studio, setting));
        rows.push(...made);
        return make(
            "section",
            { class: "control-group", "aria-label": node },
            make("h3", { text: node }),
            ...made.map((row) => row.element),
        );
    });
    const list = make(
        "datalist",
        { id: "surface-paths" },
        ...graph.surfaces.map(({ path, name }) => make("option", { value: JSON.stringify(bare(path)), text: name })),
    );
    const parameters =
        graph.parameters.length > 0 &&
        make(
            "section",
            { class: "control-group", "aria-label": "Parameters" },
            make("h3", {}, "Parameters", make("span", { class: "soft", text: "of the graph: a change of one loads it again" })),
            ...graph.parameters.map((parameter) => {
                if (choicesOf(parameter)) return choiceRow(studio, parameter);
                if (!isTurned(parameter)) return parameterRow(studio, parameter);
                const row = turnedRow(studio, parameter);
                rows.push(row);
                return row.element;
            }),
            list,
        );
    if (groups.length === 0) groups.push(make("p", { class: "soft", text: "No node of this graph has a live setting." }));
    const inputs = inputsSection(studio);
    if (inputs) rows.push(inputs);
    find("controls").replaceChildren(...[inputs?.element, parameters, ...groups].filter(Boolean));
    return rows;
}

// True for a number; it has the unit and range of the setting that it feeds.
const isTurned = ({ value }) => value.trim() !== "" && Number.isFinite(Number(value));

// A parameter with the row of a setting: the graph is loaded anew when the slider is released.
function turnedRow(studio, parameter) {
    const { name, value, default: otherwise } = parameter;
    const usual = Number.isFinite(Number(otherwise)) ? Number(otherwise) : Number(value);
    const error = make("span", { class: "error", role: "alert", hidden: true });
    const now = () => Number(studio.graph.parameters.find((each) => each.name === name)?.value ?? value);
    const listeners = [];
    const show = () => listeners.forEach((listener) => listener(now()));
    // A held key changes values faster than graphs load: while a graph loads, only the latest value waits.
    let waiting = null;
    let isUnderWay = false;
    const set = async (to) => {
        waiting = to;
        if (isUnderWay) return;
        isUnderWay = true;
        while (waiting !== null) {
            const value = waiting;
            waiting = null;
            const reply = await studio.parameter(name, String(value));
            error.hidden = reply.ok;
            setText(error, reply.ok ? "" : reply.error);
        }
        isUnderWay = false;
        show();
    };
    const follow = (listener) => {
        listeners.push(listener);
        return studio.on("graph", show);
    };
    const whole = parameter.whole || (!parameter.doc && Number.isInteger(usual) && !otherwise.includes("."));
    const setting = { ...parameter, whole, node: "parameter", field: name, value: usual, id: `parameter ${name}` };
    const { element, dispose } = controlRow(studio, setting, { turn: { isLive: false, set, now, follow } });
    element.append(error);
    return { element, dispose };
}

// What a parameter can be, if that is a list; a boolean is a switch.
const choicesOf = ({ value, choices }) => (choices?.includes(value) ? choices : ["true", "false"].includes(value) ? [] : null);

function choiceRow(studio, parameter) {
    const { name, default: otherwise } = parameter;
    const [choices, label] = [choicesOf(parameter), `parameter ${name}`];
    const field = choices.length
        ? make("select", { "aria-label": label }, ...choices.map((choice) => make("option", { value: choice, text: choice })))
        : make("input", { type: "checkbox", role: "switch", "aria-label": label });
    field.dataset.parameter = name;
    const error = make("span", { class: "error", role: "alert", hidden: true });
    field.addEventListener("change", async () => {
        const reply = await studio.parameter(name, choices.length ? field.value : String(field.checked));
        error.hidden = reply.ok;
        setText(error, reply.ok ? "" : reply.error);
        showParameters(studio);
    });
    return make("div", { class: "parameter" }, make("span", { class: "name", text: name, title: `default ${otherwise}` }), field, error);
}

function parameterRow(studio, parameter) {
    const field = make("input", {
        type: "text",
        value: parameter.value,
        spellcheck: "false",
        autocomplete: "off",
        "data-parameter": parameter.name,
        "aria-label": `parameter ${parameter.name}`,
    });
    if (parameter.is_surface) field.setAttribute("list", "surface-paths");
    const error = make("span", { class: "error", role: "alert", hidden: true });
    const apply = async () => {
        const reply = await studio.parameter(parameter.name, field.value);
        error.hidden = reply.ok;
        setText(error, reply.ok ? "" : reply.error);
    };
    field.addEventListener("keydown", (event) => event.key === "Enter" && apply());
    return make(
        "div",
        { class: "parameter" },
        make("span", { class: "name", text: parameter.name, title: `default ${parameter.default}` }),
        field,
        make("button", { text: "Apply", "aria-label": `Apply ${parameter.name}`, onclick: apply }),
        error,
    );
}

// In a blind comparison no field shows the surface that runs.
function showParameters({ graph, blind }) {
    for (const { name, value, is_surface } of graph.parameters) {
        const field = find("controls").querySelector(`[data-parameter="${CSS.escape(name)}"]`);
        if (!field) continue;
        if (field.type === "checkbox") field.checked = value === "true";
        const button = field.parentElement.querySelector("button");
        if (!button) {
            field.value = value;
            continue;
        }
        const isHidden = is_surface && blind;
        field.disabled = button.disabled = isHidden;
        field.placeholder = isHidden ? "hidden while blind" : "";
        if (isHidden) field.value = "";
        else if (document.activeElement !== field) field.value = value;
    }
}

function presetOf(studio) {
    const { name, parameters } = studio.graph;
    return {
        haptograph_preset: PRESET_VERSION,
        graph: name,
        settings: Object.fromEntries(studio.values),
        parameters: Object.fromEntries(parameters.map(({ name: parameter, value }) => [parameter, value])),
        assignments: studio.assignments.sources,
    };
}

function savePreset(studio) {
    const text = `${JSON.stringify(presetOf(studio), null, 2)}\n`;
    save(`${studio.graph.name}-preset.json`, new Blob([text], { type: "application/json" }));
}

// Puts the preset into the page's address, from where it is loaded with the page; of a site also the text that was changed.
function linkPreset(studio) {
    const { graph, connection } = studio;
    const changed = connection.engine && !graph.saved ? { text: graph.text } : {};
    const bytes = new TextEncoder().encode(JSON.stringify({ ...presetOf(studio), ...changed }));
    const text = btoa(String.fromCharCode(...bytes)).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
    if (text.length > MAX_LINK) return studio.say("bad", `The preset is too long for an address (${text.length} letters, at most ${MAX_LINK}): save it to a file`);
    // The token of a studio is nobody else's.
    const address = new URL(location.href);
    address.searchParams.delete("token");
    address.hash = HASH + text;
    find("preset-link").dataset.address = address.href;
    const copied = navigator.clipboard?.writeText(address.href) ?? Promise.reject();
    copied.then(
        () => studio.say("good", "The address with the preset was copied"),
        () => studio.say("note", `Copy the address with the preset: ${address.href}`),
    );
}

// Loads the preset of the page's address, if it has one.
async function loadLink(studio) {
    if (!location.hash.startsWith(HASH)) return;
    const text = location.hash.slice(HASH.length);
    history.replaceState(null, "", location.pathname + location.search); // a reload keeps what was changed since
    const where = "The preset in the page's address";
    if (text.length > MAX_LINK) return studio.say("bad", `${where} has ${text.length} letters, at most ${MAX_LINK}`);
    const letter = text.search(/[^A-Za-z0-9_-]/);
    if (letter >= 0) return studio.say("bad", `${where} has \`${text[letter]}\` at letter ${letter + 1}: it was not copied whole`);
    try {
        const bytes = Uint8Array.from(atob(text.replaceAll("-", "+").replaceAll("_", "/")), (each) => each.charCodeAt(0));
        await takePreset(studio, where, new TextDecoder("utf-8", { fatal: true }).decode(bytes));
    } catch {
        studio.say("bad", `${where} was not copied whole`);
    }
}

// Runs the text of a graph that came with a link; a program's graph is changed by its own editor alone.
async function takeText(studio, text) {
    if (!studio.connection.engine) return ["text: only a site takes the text of a graph from a link"];
    const reply = await studio.connection.request({ type: "apply", text: String(text) });
    return reply.ok ? [] : [`text: ${reply.diagnostics?.[0]?.message ?? reply.error}`];
}

// Takes the text of a preset: parameters first (the graph is loaded anew), then the settings that it has, then assignments.
async function takePreset(studio, name, text) {
    let preset;
    try {
        preset = JSON.parse(text);
    } catch (error) {
        return studio.say("bad", `${name} is not a preset: it is not JSON (${error.message})`);
    }
    const version = preset?.haptograph_preset;
    if (version !== PRESET_VERSION) return studio.say("bad", `${name}: \`haptograph_preset\` is ${JSON.stringify(version) ?? "missing"}, not ${PRESET_VERSION}`);
    const mapOf = (part) => (typeof preset[part] === "object" && preset[part] !== null ? preset[part] : {});
    const failures = [];
    if (preset.text !== undefined) failures.push(...(await takeText(studio, preset.text)));
    for (const [parameter, wanted] of Object.entries(mapOf("parameters"))) {
        const known = studio.graph.parameters.find((each) => each.name === parameter);
        if (!known) failures.push(`parameters, ${parameter}: this graph has no such parameter`);
        else if (typeof wanted !== "string") failures.push(`parameters, ${parameter}: ${JSON.stringify(wanted)} is no text`);
        if (!known || typeof wanted !== "string" || wanted === known.value) continue;
        const reply = await studio.parameter(parameter, wanted);
        if (!reply.ok) failures.push(`parameters, ${parameter}: ${reply.error}`);
    }
    for (const [setting, value] of Object.entries(mapOf("settings"))) {
        if (!studio.values.has(setting)) failures.push(`settings, ${setting}: this graph has no such live setting`);
        else if (!Number.isFinite(value)) failures.push(`settings, ${setting}: ${JSON.stringify(value)} is no number`);
        else studio.set(setting, value);
    }
    failures.push(...studio.assignments.take(mapOf("assignments"), name));
    if (failures.length) studio.say("warn", `${name} was loaded but for ${failures.slice(0, 5).join("; ")}`);
    else studio.say("good", `${name} was loaded.`);
}
