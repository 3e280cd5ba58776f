// All live settings by node, and the graph's parameters; presets of both in a file.
import { controlRow } from "./control.js";
import { find, make, save, setText } from "./dom.js";
import { bare } from "./surfaces.js";

const PRESET_VERSION = 1;

export function mountControls(studio) {
    let rows = [],
        shape = null;
    studio.on("graph", (graph) => {
        const now = JSON.stringify([
            graph.settings.map(({ value, ...rest }) => rest),
            graph.parameters.map(({ value, ...rest }) => ({ ...rest, isTurned: isTurned({ value, ...rest }) })),
            graph.surfaces.map(({ path }) => path),
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
    studio.loadPreset = (file) => loadPreset(studio, file);
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
            make("h3", {}, "Parameters", make("span", { class: "soft", text: "of the graph; it is loaded anew with each" })),
            ...graph.parameters.map((parameter) => {
                if (!isTurned(parameter)) return parameterRow(studio, parameter);
                const row = turnedRow(studio, parameter);
                rows.push(row);
                return row.element;
            }),
            list,
        );
    if (groups.length === 0) groups.push(make("p", { class: "soft", text: "No node of this graph has a live setting." }));
    find("controls").replaceChildren(...[parameters, ...groups].filter(Boolean));
    return rows;
}

// True for a number that feeds a setting; it has the setting's unit and range.
const isTurned = ({ value, doc }) => Boolean(doc) && value.trim() !== "" && Number.isFinite(Number(value));

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
    const setting = { ...parameter, node: "parameter", field: name, value: usual };
    const { element, dispose } = controlRow(studio, setting, { turn: { isLive: false, set, now, follow } });
    element.append(error);
    return { element, dispose };
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
        const isHidden = is_surface && blind;
        const button = field.parentElement.querySelector("button");
        field.disabled = button.disabled = isHidden;
        field.placeholder = isHidden ? "hidden while blind" : "";
        if (isHidden) field.value = "";
        else if (document.activeElement !== field) field.value = value;
    }
}

function savePreset(studio) {
    const { name, parameters } = studio.graph;
    const preset = {
        haptograph_preset: PRESET_VERSION,
        graph: name,
        settings: Object.fromEntries(studio.values),
        parameters: Object.fromEntries(parameters.map(({ name: parameter, value }) => [parameter, value])),
    };
    save(`${name}-preset.json`, new Blob([`${JSON.stringify(preset, null, 2)}\n`], { type: "application/json" }));
}

// Parameters first (the graph is loaded anew), then the settings that it has.
async function loadPreset(studio, file) {
    let preset;
    try {
        preset = JSON.parse(await file.text());
    } catch {
        return studio.say("bad", `${file.name} is not a preset: it is not JSON.`);
    }
    if (preset?.haptograph_preset !== PRESET_VERSION) return studio.say("bad", `${file.name} is not a preset of this version.`);
    const failures = [];
    for (const { name, value } of studio.graph.parameters) {
        const wanted = preset.parameters?.[name];
        if (typeof wanted !== "string" || wanted === value) continue;
        const reply = await studio.parameter(name, wanted);
        if (!reply.ok) failures.push(`${name}: ${reply.error}`);
    }
    for (const [name, value] of Object.entries(preset.settings ?? {})) {
        if (typeof value === "number" && studio.values.has(name)) studio.set(name, value);
        else failures.push(`${name}: this graph has no such live setting`);
    }
    if (failures.length) studio.say("warn", `${file.name} was loaded but for ${failures.join("; ")}`);
    else studio.say("good", `${file.name} was loaded.`);
}
