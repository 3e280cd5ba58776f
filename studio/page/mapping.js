// What the columns of a recording hold, where their names do not say it: a table with a picture of each column, in which a person chooses.
// The choice is kept for the next file with the same header.
import { kept, make } from "./dom.js";

const QUANTITIES = {
    time: ["time", ["s", "ms", "us"]],
    force_normal: ["pressing force", ["N", "mN", "kgf"]],
    force_tangential: ["friction force", ["N", "mN", "kgf"]],
    speed: ["speed", ["mm/s", "m/s", "cm/s"]],
    accel: ["vibration", ["m/s2", "g", "mm/s2", "1"]],
    ...axes("accel", "acceleration", ["m/s2", "g", "mm/s2", "1"]),
    ...axes("force", "force", ["N", "mN", "kgf"]),
    ...axes("position", "position", ["mm", "m", "cm"]),
};
// Names that people give, in the order in which they are tried; the choice is the person's.
const GUESSES = [
    [/^(t|time|clock|zeit|stamp|timestamp)\b|time/i, "time"],
    [/acc|vib|imu/i, "accel"],
    [/speed|veloc|^v\b|^v_/i, "speed"],
    [/tang|frict|shear/i, "force_tangential"],
    [/force|press|load|normal|^f\b|^f_|^fz/i, "force_normal"],
];
const MOST_ROWS = 4000;
const POINTS = 160;
const SEPARATORS = [";", "\t", ","];

function axes(name, label, units) {
    return Object.fromEntries(["x", "y", "z"].map((axis) => [`${name}_${axis}`, [`${label} ${axis}`, units]]));
}

// The header of a table and some of its rows as numbers; null if it has none.
export function headOf(csv) {
    const lines = csv.slice(0, 4_000_000).split(/\r?\n/).filter((line) => line.trim() && !line.startsWith("#"));
    const separator = SEPARATORS.find((mark) => lines[0]?.includes(mark)) ?? ",";
    const cells = (line) => line.split(separator).map((cell) => cell.trim().replace(/^"(.*)"$/, "$1"));
    const names = cells(lines[0] ?? "");
    if (names.length < 2 || names.every((name) => name !== "" && Number.isFinite(Number(name)))) return null;
    const decimal = separator === "," ? (cell) => cell : (cell) => cell.replace(",", ".");
    const step = Math.ceil(lines.length / MOST_ROWS);
    const rows = lines.filter((_, i) => i > 0 && (i - 1) % step === 0).map((line) => cells(line).map((cell) => Number.parseFloat(decimal(cell))));
    return { names, columns: names.map((_, i) => rows.map((row) => row[i] ?? NaN)) };
}

// What each column probably holds: every quantity once.
export function guessed(names) {
    const free = new Set(Object.keys(QUANTITIES));
    return names.map((name) => {
        const guess = GUESSES.find(([pattern, quantity]) => pattern.test(name) && free.has(quantity))?.[1] ?? null;
        if (guess) free.delete(guess);
        return guess;
    });
}

// The mapping for a header that was chosen before.
export const keptMapping = (names) => kept.get(`mapping.${names.join()}`, null);

// A table in which a person says what the columns of a recording hold; `done` gets the mapping.
export function mappingForm({ names, columns }, done) {
    const before = keptMapping(names);
    const quantityOf = (name) => Object.entries(before?.columns ?? {}).find(([, column]) => column === name)?.[0];
    const guesses = guessed(names);
    const rows = names.map((name, i) => rowOf(name, columns[i], before ? quantityOf(name) : guesses[i], before?.units));
    const rate = make("input", { type: "number", min: "1", step: "any", value: before?.rate_hz ?? "", "aria-label": "Rows in a second, where no column is the time" });
    const learn = () => {
        const chosen = rows.filter(({ quantity }) => quantity.value);
        const mapping = {
            columns: Object.fromEntries(chosen.map(({ name, quantity }) => [quantity.value, name])),
            units: Object.fromEntries(chosen.map(({ quantity, unit }) => [quantity.value, unit.value])),
            rate_hz: rate.value === "" ? null : Number(rate.value),
        };
        kept.set(`mapping.${names.join()}`, mapping);
        done(mapping);
    };
    const table = make("table", { class: "mapping" }, make("tbody", {}, ...rows.map(({ row }) => row)));
    return make(
        "div",
        {},
        make("p", { class: "soft", text: "What do these columns hold? Needed are a pressing force, a speed or positions, a vibration, and the time or the rate." }),
        table,
        make("label", { class: "soft" }, "Rows in a second, without a time ", rate, " Hz "),
        make("button", { class: "primary", text: "Learn", onclick: learn }),
    );
}

function rowOf(name, values, guess, units = {}) {
    const unit = make("select", { "aria-label": `Unit of ${name}` });
    const option = ([value, [label]]) => make("option", { value, text: label });
    const quantity = make("select", { "aria-label": `What ${name} holds` }, make("option", { value: "", text: "not used" }), ...Object.entries(QUANTITIES).map(option));
    const showUnits = () => {
        const known = QUANTITIES[quantity.value]?.[1] ?? [];
        unit.replaceChildren(...known.map((each) => make("option", { value: each, text: each === "1" ? "not known" : each })));
        unit.value = units[quantity.value] ?? known[0] ?? "";
        unit.hidden = known.length === 0;
    };
    quantity.value = guess ?? "";
    quantity.addEventListener("change", showUnits);
    showUnits();
    const numbers = values.filter(Number.isFinite);
    const [low, high] = numbers.reduce(([low, high], value) => [Math.min(low, value), Math.max(high, value)], [Infinity, -Infinity]);
    const range = numbers.length ? `${Number(low.toPrecision(3))} to ${Number(high.toPrecision(3))}` : "no numbers";
    const cells = [make("th", { scope: "row", text: name }), make("td", {}, pictureOf(numbers, low, high)), make("td", { class: "soft", text: range })];
    const row = make("tr", {}, ...cells, make("td", {}, quantity), make("td", {}, unit));
    return { row, name, quantity, unit };
}

// A column: its least and largest values, a column of pixels each.
function pictureOf(values, low, high) {
    const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    svg.setAttribute("viewBox", `0 0 ${POINTS} 24`);
    svg.setAttribute("aria-hidden", "true");
    const y = (value) => (high > low ? 23 - (22 * (value - low)) / (high - low) : 12).toFixed(1);
    const part = Math.max(1, values.length / POINTS);
    const ends = Array.from({ length: Math.min(POINTS, values.length) }, (_, i) => {
        const here = values.slice(Math.floor(i * part), Math.floor((i + 1) * part));
        return `${i ? "L" : "M"}${i},${y(Math.max(...here))}L${i},${y(Math.min(...here))}`;
    });
    const path = document.createElementNS("http://www.w3.org/2000/svg", "path");
    path.setAttribute("d", ends.join(""));
    svg.append(path);
    return svg;
}
