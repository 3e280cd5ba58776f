// What the columns of a recording hold, where their names do not say it: a table with a picture of each column, in which a person chooses,
// and what reading it then finds. Which quantities and units there are, and what a column probably holds, is the engine's to say. The
// choice is kept for the next file with the same header.
import { kept, make } from "./dom.js";
import { prose } from "./prose.js";

const LABELS = { accel: "vibration", force_normal: "pressing force", force_tangential: "friction force" };
const MOST_ROWS = 4000;
const POINTS = 160;
const FASTEST_M_S = 3; // of a hand: a larger number is of another unit
const SEPARATORS = [";", "\t", ","];

// The header of a table and some of its rows as numbers; null if it has none.
export function headOf(csv) {
    const lines = csv.slice(0, 4_000_000).split(/\r?\n/).filter((line) => line.trim() && !line.startsWith("#"));
    const separator = SEPARATORS.find((mark) => lines[0]?.includes(mark)) ?? ",";
    const cells = (line) => line.split(separator).map((cell) => cell.trim().replace(/^"(.*)"$/, "$1"));
    const names = cells(lines[0] ?? "");
    if (names.length < 2 || names.every((name) => name !== "" && Number.isFinite(Number(name)))) return null;
    const decimal = separator === "," ? (cell) => cell : (cell) => cell.replace(",", ".");
    const step = Math.ceil(lines.length / MOST_ROWS);
    const all = csv.split("\n").reduce((sum, line) => sum + (line.trim() !== "" && !line.startsWith("#")), -1);
    const rows = lines.filter((_, i) => i > 0 && (i - 1) % step === 0).map((line) => cells(line).map((cell) => Number.parseFloat(decimal(cell))));
    return { names, all, columns: names.map((_, i) => rows.map((row) => row[i] ?? NaN)) };
}

const labelOf = (quantity) => LABELS[quantity] ?? quantity.replace("accel", "acceleration").replaceAll("_", " ");

// A unit as it is printed: "m_s2" as m/s2, "n_mm" as N mm.
const unitText = (unit) =>
    unit === "1"
        ? "not known"
        : unit
              .replace(/_s(2?)$/, "/s$1")
              .replace(/^(m?)n(?=$|_)/, "$1N")
              .replace("_", " ");

// The mapping for a header that was chosen before.
export const keptMapping = (names) => kept.get(`mapping.${names.join()}`, null);

// A table in which a person says what the columns of a recording hold; `read` gives what the engine finds with a mapping, `done` gets
// the mapping. One that `isRead` could be read without.
export async function mappingForm({ names, columns, all }, read, done, isRead = false) {
    const before = keptMapping(names);
    const { quantities, columns: guesses } = (await read(before ?? {})) ?? { quantities: [], columns: [] };
    const quantityOf = (name) => Object.entries(before?.columns ?? {}).find(([, column]) => column === name)?.[0];
    const guess = (name) => guesses.find((each) => each.name === name)?.quantity;
    const rows = names.map((name, i) => rowOf(name, columns[i], quantities, before ? quantityOf(name) : guess(name), before?.units));
    const rate = make("input", { type: "number", min: "1", step: "any", value: before?.rate_hz ?? "", "aria-label": "Sampling rate in hertz, where no column is the time" });
    const length = make("span");
    const mappingNow = () => {
        const chosen = rows.filter(({ quantity }) => quantity.value);
        // A unit that nobody chose is that of the file, where it was read before.
        const hasUnit = ({ unit }) => unit.value !== "" && !(isRead && unit.dataset.assumed);
        return {
            columns: Object.fromEntries(chosen.map(({ name, quantity }) => [quantity.value, name])),
            units: Object.fromEntries(chosen.filter(hasUnit).map(({ quantity, unit }) => [quantity.value, unit.value])),
            rate_hz: rate.value === "" ? null : Number(rate.value),
        };
    };
    const learn = () => {
        kept.set(`mapping.${names.join()}`, mappingNow());
        done(mappingNow());
    };
    const findings = make("ul", { class: "findings", "aria-label": "What reading it finds" });
    const look = inTurns(async () => showFindings(findings, await read(mappingNow())));
    const table = make("table", { class: "mapping" }, make("tbody", {}, ...rows.map(({ row }) => row)));
    const form = make(
        "div",
        {},
        make("p", { class: "soft", text: "Needed are a pressing force, a speed or positions, a vibration, and the time or the sampling rate." }),
        table,
        make("label", { class: "soft" }, "Sampling rate, where no column is the time ", rate, " Hz ", length),
        findings,
        make("p", { class: "mapping-learn" }, make("button", { class: "primary", text: "Learn", onclick: learn })),
    );
    // A wrong rate is seen by the length that it gives.
    const showLength = () => (length.textContent = rate.value > 0 ? `${all} rows are ${Number((all / rate.value).toPrecision(3))} s` : "");
    rate.addEventListener("input", showLength);
    form.addEventListener("change", look);
    showLength();
    look();
    return form;
}

// Runs `work` again after what goes on, once, however often it is asked meanwhile.
function inTurns(work) {
    let [goesOn, again] = [false, false];
    return async () => {
        again = true;
        if (goesOn) return;
        goesOn = true;
        while (again) {
            again = false;
            await work();
        }
        goesOn = false;
    };
}

// The page has a menu where the command has a flag.
const spoken = (text) =>
    text
        .replace(/(?:; )?(?:add|give it with|or give the unit with) --unit (\w+)=([^\s,;]+)/g, (_, quantity, unit) => ` choose the unit ${unit} of the ${labelOf(quantity)} above`)
        .replace(/;? ?(?:Name the columns: )?--.*$/s, "")
        .replace(/[,;:\s]+$/, "");

// What would be repaired, with its consequences; that there is nothing is said, too.
function showFindings(list, read) {
    if (!read) return list.replaceChildren();
    const line = (kind, text, consequence) =>
        make("li", { class: kind }, ...prose(spoken(text)), consequence && make("span", { class: "soft", text: ` – ${consequence}` }));
    const repairs = read.findings.filter(({ is_repair }) => is_repair);
    const others = read.findings.filter(({ is_repair }) => !is_repair);
    const first = read.error
        ? [line("error", `Cannot be read so: ${read.error}`)]
        : repairs.length
          ? repairs.map(({ says, consequence }) => line("repair", `Would be repaired: ${says}`, consequence))
          : others.length
            ? []
            : [line("good", "Nothing to repair.")];
    list.replaceChildren(...first, ...others.map(({ says, consequence }) => line("repair", says, consequence)));
}

// True if a column's name ends in a unit: "acc [g]", "v/(cm/s)", "speed_mm_s".
const isIn = (name, unit) => new RegExp(`.[^a-z0-9]${unit.replaceAll("_", "[^a-z0-9]*")}[^a-z0-9]*$`, "i").test(name.replace("²", "2").replace("^", "").replace(/[µμ]/g, "u"));

function rowOf(name, values, quantities, guess, units = {}) {
    const unit = make("select", { "aria-label": `Unit of ${name}` });
    const option = ({ name: value }) => make("option", { value, text: labelOf(value) });
    const quantity = make("select", { "aria-label": `What ${name} holds` }, make("option", { value: "", text: "not used" }), ...quantities.map(option));
    const showUnits = () => {
        const known = quantities.find((each) => each.name === quantity.value)?.units ?? [];
        const chosen = units[quantity.value]?.toLowerCase().replace("/", "_") ?? known.find((each) => isIn(name, each));
        const likely = chosen ?? (quantity.value === "speed" && high < FASTEST_M_S ? "m_s" : known[0]);
        const text = (each) => (each === likely && !chosen && known.length > 1 ? `${unitText(each)}, assumed` : unitText(each));
        unit.replaceChildren(...known.map((each) => make("option", { value: each, text: text(each) })));
        unit.value = likely ?? "";
        unit.dataset.assumed = chosen ? "" : "assumed";
        unit.hidden = known.length === 0;
    };
    const numbers = values.filter(Number.isFinite);
    const [low, high] = numbers.reduce(([low, high], value) => [Math.min(low, value), Math.max(high, value)], [Infinity, -Infinity]);
    quantity.value = guess ?? "";
    quantity.addEventListener("change", showUnits);
    unit.addEventListener("change", () => (unit.dataset.assumed = ""));
    showUnits();
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
