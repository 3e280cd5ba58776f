// Numbers as text, axes and their ticks.
const PREFIXABLE = new Set(["m", "m/s", "A", "V", "W", "s", "N", "N m"]);

// For an axis up to `most` in an SI unit: the factor to multiply by and the unit's name then.
export function scaleOf(unit, most) {
    if (PREFIXABLE.has(unit) && most > 0) {
        if (most < 3e-4) return { factor: 1e6, unit: `µ${unit}` };
        if (most < (unit === "N" ? 0.1 : 1)) return { factor: 1e3, unit: `m${unit}` };
    }
    return { factor: 1, unit };
}

// Three significant digits, without an exponent where that reads well.
export function digits(value) {
    if (!Number.isFinite(value)) return "–";
    const size = Math.abs(value);
    if (size === 0) return "0";
    if (size >= 1e5 || size < 1e-3) return value.toExponential(1).replace("e+", "e");
    return value.toFixed(Math.max(0, Math.min(4, 2 - Math.floor(Math.log10(size)))));
}

// A value in its unit: "12.5 mA".
export function quantity(value, unit) {
    const scale = scaleOf(unit, Math.abs(value));
    return `${digits(value * scale.factor)} ${scale.unit}`.trim();
}

// The least of 1, 2, 5 times a power of ten that is no less than `value`.
export function roundUp(value) {
    if (!(value > 0)) return 1;
    const power = 10 ** Math.floor(Math.log10(value));
    const rest = value / power;
    return power * (rest <= 1 ? 1 : rest <= 2 ? 2 : rest <= 5 ? 5 : 10);
}

// Round values from `low` to `high`, about `count` of them.
export function ticks(low, high, count) {
    const step = roundUp((high - low) / Math.max(count, 1));
    const out = [];
    for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9; i++) out.push(i * step);
    return out;
}

// A tick's label: no more digits than its step needs.
export function tickText(value, step) {
    if (step < 1e-4 || step >= 1e6) return value === 0 ? "0" : value.toExponential(0);
    const places = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    return (Math.abs(value) < step * 1e-6 ? 0 : value).toFixed(places);
}
