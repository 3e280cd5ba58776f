// A scope as a meter against the actuator's limit, and as a number.
import { digits, quantity, roundUp, scaleOf } from "./numbers.js";
import { colours, FONT } from "./theme.js";

const SPAN_S = 0.3;
const PEAK_HOLD_MS = 1500;
const BIG = "600 26px system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', sans-serif";

// Level and peak as bars; where the port belongs to an actuator, against its limits and with its heat.
export function drawMeter(context, surface, { trace, memory, limits, port, now_ms, actuator, paused, isStopped }) {
    const { rms, peak } = isStopped ? { rms: 0, peak: 0 } : trace.level(SPAN_S);
    if (!(peak < memory.held) || now_ms - (memory.held_ms ?? 0) > PEAK_HOLD_MS) [memory.held, memory.held_ms] = [peak, now_ms];
    memory.full = Math.max(roundUp(peak), (memory.full ?? 0) * (paused ? 1 : 0.995));
    const full = limits?.peak ?? memory.full;
    const rows = [
        ["level", rms, limits?.continuous, full],
        ["peak", peak, null, full],
        ...(actuator ? [["heat", actuator.heat, 1, 1]] : []),
    ];
    const height = Math.min(26, (surface.height - 22) / rows.length);
    const box = { left: 52, width: surface.width - 52 - 86 };
    rows.forEach(([name, value, mark, most], i) => {
        const y = 8 + i * height;
        const text = name === "heat" ? `${(100 * value).toFixed(0)} %` : quantity(value, port.unit);
        drawBar(context, box, y, height - 9, name, value / most, mark ? mark / most : null, text);
    });
    const held = box.left + box.width * Math.min(1, memory.held / full);
    context.fillStyle = memory.held >= full * 0.999 && limits ? colours.bad : colours.ink;
    context.fillRect(held - 1.5, 6 + height, 3, height - 5);
    context.fillStyle = colours.soft;
    context.font = FONT;
    const below = limits
        ? `limit ${quantity(limits.peak, port.unit)} peak, ${quantity(limits.continuous, port.unit)} continuous`
        : `full bar ${quantity(full, port.unit)}`;
    context.fillText(below, 10, surface.height - 6);
}

function drawBar(context, box, y, height, name, part, mark, text) {
    const width = box.width * Math.max(0, Math.min(1, part));
    context.fillStyle = colours.soft;
    context.font = FONT;
    context.fillText(name, 10, y + height / 2 + 4);
    const bar = (to, colour) => {
        context.fillStyle = colour;
        context.beginPath();
        context.roundRect(box.left, y, to, height, Math.min(4, to / 2));
        context.fill();
    };
    bar(box.width, colours.tint6);
    bar(width, part > 0.98 ? colours.bad : part > (mark ?? 0.8) ? colours.ink1 : colours.ink2);
    if (mark && mark < 1) {
        context.fillStyle = colours.bad;
        context.fillRect(box.left + box.width * mark - 1, y - 2, 2, height + 4);
    }
    context.fillStyle = colours.ink;
    context.fillText(text, box.left + box.width + 10, y + height / 2 + 4);
}

// The latest value, large; with several components, one on each line.
export function drawNumber(context, surface, { trace, port }) {
    const rows = Math.max(1, trace.lanes);
    const size = Math.min(30, (surface.height - 14) / rows - 4);
    context.textBaseline = "middle";
    for (let lane = 0; lane < rows; lane++) {
        const value = trace.latest(lane);
        const scale = scaleOf(port.unit, Math.abs(value));
        const y = ((lane + 0.5) * (surface.height - 8)) / rows;
        context.font = BIG.replace("26px", `${size}px`);
        context.fillStyle = colours.ink;
        context.textAlign = "right";
        const x = Math.min(surface.width * 0.58, 190);
        context.fillText(digits(value * scale.factor), x, y);
        context.font = FONT;
        context.fillStyle = colours.soft;
        context.textAlign = "left";
        context.fillText(`${scale.unit}  ${port.lanes[lane] ?? ""}`, x + 8, y + size / 6);
    }
    context.textBaseline = "alphabetic";
}
