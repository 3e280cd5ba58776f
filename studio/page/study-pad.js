// The participant's pad: a plain field of the pad's proportions, and where the hand is.
import { find, setText } from "./dom.js";
import { everyFrame } from "./frame.js";
import { followKeys, followPointers, Hands } from "./hands.js";
import { colours, Surface } from "./theme.js";

const MARGIN = 6;
const MOST_N = 5; // of the slider

export function mountStudyPad(connection, mayTouch) {
    const hands = new Hands(connection);
    hands.allowed = mayTouch;
    const element = find("pad");
    const place = { left: 0, top: 0, scale: 1, width_mm: 160, height_mm: 100 };
    const canvas = new Surface(find("pad-canvas"), () => layOut());
    const layOut = () => {
        const { width_mm, height_mm } = hands.pads[0] ?? place;
        const scale = Math.max(0.1, Math.min((canvas.width - MARGIN) / width_mm, (canvas.height - MARGIN) / height_mm));
        const [left, top] = [(canvas.width - width_mm * scale) / 2, (canvas.height - height_mm * scale) / 2];
        Object.assign(place, { scale, width_mm, height_mm, left, top });
    };
    const toMm = (clientX, clientY) => {
        const box = element.getBoundingClientRect();
        return {
            x_mm: (clientX - box.left - place.left) / place.scale - place.width_mm / 2,
            y_mm: place.height_mm / 2 - (clientY - box.top - place.top) / place.scale,
        };
    };
    const slider = find("force");
    const press = (force_n) => {
        hands.force_n = Math.max(0.02, Math.min(hands.pads[0]?.force_n ?? MOST_N, force_n));
        slider.value = String(1000 * Math.sqrt(hands.force_n / MOST_N));
        slider.setAttribute("aria-valuetext", `${hands.force_n.toFixed(2)} N`);
        hands.repress();
    };
    slider.addEventListener("input", () => press(MOST_N * (slider.value / 1000) ** 2));
    const change = (steps) => press(hands.force_n * 1.12 ** steps);
    followPointers(element, hands, toMm);
    followKeys(element, hands, change);
    // Whoever has a pen presses with it.
    element.addEventListener("pointerdown", ({ pointerType }) => (find("pad-tools").dataset.pen = String(pointerType === "pen")));
    press(1);
    everyFrame(() => draw(canvas, hands, place));
    const setPads = (pads) => {
        if (JSON.stringify(pads) === JSON.stringify(hands.pads)) return;
        hands.setPads(pads);
        layOut();
    };
    return { hands, setPads, label: (text) => setText(find("force-label"), text) };
}

function draw(canvas, hands, { left, top, scale, width_mm, height_mm }) {
    const context = canvas.begin();
    if (!context) return;
    context.fillStyle = colours.panel;
    context.strokeStyle = colours.frame;
    context.lineWidth = 1.5;
    context.beginPath();
    context.roundRect(left, top, width_mm * scale, height_mm * scale, 10);
    context.fill();
    context.stroke();
    for (const { samples } of hands.down) {
        const last = samples.at(-1);
        if (!last) continue;
        context.beginPath();
        context.arc(
            left + (last.x_mm + width_mm / 2) * scale,
            top + (height_mm / 2 - last.y_mm) * scale,
            7 + 30 * Math.sqrt(last.force_n / MOST_N),
            0,
            2 * Math.PI,
        );
        context.fillStyle = colours.tint0;
        context.strokeStyle = colours.accent;
        context.lineWidth = 2.5;
        context.fill();
        context.stroke();
    }
}
