// One live setting, or a parameter of the graph: a slider with its number, generated from its range.
import { make } from "./dom.js";
import { prose } from "./prose.js";

const STEPS = 1000;
const LOG_FROM_RATIO = 100;
const USELESS_RATIO = 1e6; // a range this many times the value is a bound on what is valid, not one to turn through

// The mapping between a slider's position, 0 to 1, and a value; null if the setting has no range.
export function scaleFor({ min, max, value, whole }) {
    if (min === null || max === null || min === undefined || max === undefined || !(max > min)) return null;
    if (min > 0 && max / min > LOG_FROM_RATIO) {
        return {
            to: (x) => rounded(min * (max / min) ** x, whole),
            from: (v) => Math.log(Math.max(v, min) / min) / Math.log(max / min),
        };
    }
    if (max - min > USELESS_RATIO * Math.max(Math.abs(value), 1e-3)) return null;
    return { to: (x) => rounded(min + (max - min) * x, whole), from: (v) => (v - min) / (max - min) };
}

// The range of a slider of a setting that states none to turn through: about its own value, within what is valid.
export function around({ min, max, value, whole }) {
    const [low, high] = value === 0 ? [0, 1] : value > 0 ? [0, 2 * value] : [2 * value, 0];
    return { min: Math.max(low, min ?? -Infinity), max: Math.min(high, max ?? Infinity), value, whole };
}

// As many digits as a slider's position resolves.
const rounded = (value, whole) => (whole ? Math.round(value) : Number(value.toPrecision(4)));

// The access to a live setting: changes apply at once, and the studio holds its value.
const live = (studio, { name, value }) => ({
    isLive: true,
    set: (to) => studio.set(name, to),
    now: () => studio.values.get(name) ?? value,
    follow: (show) => studio.on("value", (changed) => changed.name === name && show(changed.value)),
});

// The row of a setting; `dispose` ends its listening. A value that is not live is set when the slider is released.
export function controlRow(studio, setting, { compact = false, turn = live(studio, setting) } = {}) {
    const scale = scaleFor(setting) ?? scaleFor(around(setting));
    const label = `${setting.node} ${setting.field}`;
    const name = make("span", { class: "name", text: setting.field, title: setting.name });
    const slider = setting.isSwitch ? switchOf(label) : sliderOf(scale, label);
    const number = numberOf(setting, label);
    const show = (value) => {
        if (setting.isSwitch) slider.checked = value > 0;
        else if (scale) {
            slider.value = String(STEPS * Math.max(0, Math.min(1, scale.from(value))));
            slider.setAttribute("aria-valuetext", `${value} ${setting.unit ?? ""}`);
        }
        if (document.activeElement !== number) number.value = asNumber(value, setting.digits);
    };
    const change = (value) => {
        if (!Number.isFinite(value)) return null;
        const within = Math.max(
            setting.min ?? -Infinity,
            Math.min(setting.max ?? Infinity, setting.whole ? Math.round(value) : value),
        );
        return turn.set(within);
    };
    if (setting.isSwitch) slider.addEventListener("change", () => change(Number(slider.checked)));
    else if (scale) {
        const toValue = () => scale.to(slider.value / STEPS);
        slider.addEventListener("input", () => (turn.isLive ? change(toValue()) : show(toValue())));
        if (!turn.isLive) slider.addEventListener("change", () => change(toValue()));
        slider.addEventListener("dblclick", () => change(setting.value));
        slider.title = "Double click: back to the value of the graph";
    }
    number.addEventListener("change", async () => {
        if (number.value !== "") await change(Number(number.value));
        number.value = asNumber(turn.now(), setting.digits);
    });
    const forget = turn.follow(show);
    show(turn.now());
    const unit = make("span", { class: "unit", text: setting.unit ?? "" });
    const doc = compact ? null : make("span", { class: "doc" }, ...prose(setting.doc));
    const row = make("div", { class: "control", title: compact ? setting.doc : null }, name, slider, number, unit);
    const move = (part) => scale && change(scale.to(part));
    const assigned = studio.assignments.add(setting.id ?? setting.name, { label, move }, row);
    row.append(assigned.button, ...(doc ? [doc] : []));
    return { element: row, dispose: () => (forget(), assigned.dispose()) };
}

const switchOf = (label) => make("input", { type: "checkbox", role: "switch", "aria-label": label });

// The text of a value in a field, without digits of rounding.
const asNumber = (value, digits = 6) => String(Number(Number(value).toPrecision(digits)));

function sliderOf(scale, label) {
    if (!scale) return make("span", { class: "no-range" });
    return make("input", { type: "range", min: "0", max: String(STEPS), step: "1", "aria-label": label });
}

function numberOf({ whole, min, max }, label) {
    return make("input", { type: "number", step: whole ? "1" : "any", "aria-label": `${label}, number`, min, max });
}
