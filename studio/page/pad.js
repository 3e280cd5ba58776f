// The pad: a picture of the surface, the hands on it, and the force of those that cannot press.
import { photoName, pictureOf, showHalves } from "./compare.js";
import { DemoHand } from "./demo.js";
import { find, kept, make, setText } from "./dom.js";
import { everyFrame } from "./frame.js";
import { GESTURES } from "./gestures.js";
import { followKeys, followPointers, Hands } from "./hands.js";
import { digits } from "./numbers.js";
import { laidOn, whatMoves } from "./pads.js";
import { colours, FONT, FONT_STRONG, haloText, Surface } from "./theme.js";

const MARGIN = 14;
const LEAST_FULL_N = 0.1;
const MOST_FULL_N = 20;
const GRID_MM = 10;
const TRAIL_MS = 1600;
const TRAIL_STEPS = 10; // of fading
const WIDEST = 9; // pixels that the strongest vibration adds to the trail
const FELT_S = 0.06;
const FELT_FROM_HZ = 1000;
// On a picture of a surface the colours are the same by day and night.
const HAND_INKS = ["#c2500c", "#1c5ba0", "#0f6d57", "#8f3f8a"];
const HALO = "#ffffff";
const VEIL = "linear-gradient(rgb(250 248 244 / .25), rgb(250 248 244 / .25))"; // over a drawn swatch, so that the hand is seen
const MARK = "#1c242c";

export function mountPad(studio) {
    const hands = new Hands(studio.connection);
    // Of the pads side by side; the size is that of one.
    const place = { left: 0, top: 0, scale: 1, width_mm: 100, height_mm: 60, names: [""] };
    const element = find("pad");
    const grid = new Surface(find("pad-grid"), () => drawGrid(grid, place));
    const canvas = new Surface(find("pad-canvas"), () => layOut(canvas, grid, hands, place));
    hands.allowed = () => studio.mayTouch();
    // `held` is the pad of a hand that is down: it does not leave it.
    const toMm = (clientX, clientY, held) => {
        const box = element.getBoundingClientRect();
        const x_mm = (clientX - box.left - place.left) / place.scale;
        const pad = held ?? Math.max(0, Math.min(place.names.length - 1, Math.floor(x_mm / place.width_mm)));
        return {
            pad,
            x_mm: x_mm - (pad + 0.5) * place.width_mm,
            y_mm: place.height_mm / 2 - (clientY - box.top - place.top) / place.scale,
        };
    };
    followPointers(element, hands, toMm);
    const force = mountForce(studio, hands, element);
    followKeys(element, hands, force.change);
    const demo = mountDemo(studio, hands);
    const calibration = mountCalibration(() => takePads(studio.graph));
    const takePads = (graph) => {
        const pads = calibration.calibrated(graph.pads);
        if (JSON.stringify([pads, graph.inputs]) === JSON.stringify([hands.pads, hands.inputs])) return;
        hands.setPads(pads, graph.inputs);
        force.show();
    };
    studio.on("graph", (graph) => {
        takePads(graph);
        layOut(canvas, grid, hands, place);
        showSwatch(studio);
    });
    studio.on("compared", () => showSwatch(studio));
    mountPhoto(studio);
    const strength = followVibration(studio);
    everyFrame((now_ms) => {
        const now = strength();
        for (const { samples } of hands.down)
            for (let i = samples.length - 1; i >= 0 && samples[i].strength === undefined; i--) samples[i].strength = now;
        draw(canvas, hands, place, now_ms, demo.running);
    });
    return { hands, demo };
}

// Strength of the vibration now, relative to the recent maximum, 0 to 1: of the last acceleration in the graph, or of
// an actuator's command.
function followVibration(studio) {
    let trace = null,
        most = 0;
    studio.on("graph", ({ ports, actuators }) => {
        const port =
            ports.findLast(({ quantity, rate_hz }) => quantity === "acceleration" && rate_hz >= FELT_FROM_HZ) ??
            ports.find(({ node }) => actuators.some(({ name }) => name === node));
        if (trace?.name === port?.name) return;
        studio.taps.release(trace);
        [trace, most] = [port ? studio.taps.watch(port.name) : null, 0];
    });
    return () => {
        const { rms } = trace?.level(FELT_S) ?? { rms: 0 };
        most = Math.max(rms, most * 0.9995);
        return most > 0 ? rms / most : 0;
    };
}

// The largest rectangle of the pads' proportions, side by side.
function layOut(canvas, grid, hands, place) {
    const most = (side) => Math.max(...hands.pads.map((pad) => pad[side]));
    const [width_mm, height_mm] = hands.pads.length ? [most("width_mm"), most("height_mm")] : [160, 100];
    const names = hands.pads.length ? hands.pads.map(({ endpoint }) => endpoint) : [""];
    const all_mm = names.length * width_mm;
    const scale = Math.max(0.1, Math.min((canvas.width - 2 * MARGIN) / all_mm, (canvas.height - 2 * MARGIN) / height_mm));
    const [width, height] = [all_mm * scale, height_mm * scale];
    find("main").style.setProperty("--aspect", String(height_mm / all_mm));
    const [left, top] = [(canvas.width - width) / 2, (canvas.height - height) / 2];
    Object.assign(place, { scale, width_mm, height_mm, left, top, names });
    Object.assign(find("pad-swatch").style, {
        left: `${place.left}px`,
        top: `${place.top}px`,
        width: `${width}px`,
        height: `${height}px`,
    });
    drawGrid(grid, place);
}

// The force of a pen at full pressure, as no tablet states newtons: the engine's value until the user sets another,
// which is kept. `changed` is called when it changes.
function mountCalibration(changed) {
    const field = find("full-force");
    let said = kept.get("full_force_n", null);
    const show = (force_n) => {
        if (document.activeElement !== field) field.value = force_n > 0 ? String(Number(force_n.toPrecision(4))) : "";
    };
    const calibrated = (pads) => {
        const most = Math.min(...pads.map(({ most_force_n }) => most_force_n ?? MOST_FULL_N));
        const own = pads[0]?.force_n ?? 0;
        [field.min, field.max, field.disabled] = [String(LEAST_FULL_N), String(most), pads.length === 0];
        const force_n = Number.isFinite(said) && said !== null ? Math.max(LEAST_FULL_N, Math.min(most, said)) : own;
        show(force_n);
        return pads.map((pad) => ({ ...pad, force_n }));
    };
    field.addEventListener("change", () => {
        const value = Number(field.value);
        const within = Math.max(Number(field.min), Math.min(Number(field.max), value));
        said = field.value === "" || !Number.isFinite(value) ? null : within; // empty: the engine's own
        kept.set("full_force_n", said);
        field.value = said === null ? "" : String(said);
        field.blur();
        changed();
    });
    return { calibrated };
}

// The surface that runs, as a picture: a photograph where the user gave one for it, else its swatch.
function showSwatch(studio) {
    showHalves(studio, find("pad-swatch"));
    if (studio.compared) return;
    const surface = studio.currentSurface();
    Object.assign(find("pad-swatch").style, pictureOf(studio, surface, VEIL));
    const pads = studio.graph?.pads ?? [];
    const name = surface?.name ?? pads.map(({ endpoint }) => endpoint).join(" and ");
    setText(find("pad-surface-name"), [name, ...pads.map(laidOn)].filter(Boolean).join(" · "));
    find("pad-surface-name").title = whatMoves(studio.graph);
}

function mountPhoto(studio) {
    studio.usePhoto = (file) => {
        const name = photoName(studio.currentSurface());
        const before = studio.photos.get(name);
        if (before) URL.revokeObjectURL(before);
        studio.photos.set(name, URL.createObjectURL(file));
        studio.emit("photo", name);
    };
    studio.on("photo", () => showSwatch(studio));
    find("photo").addEventListener("change", ({ target }) => {
        if (target.files[0]) studio.usePhoto(target.files[0]);
        target.value = "";
    });
}

// The slider of force: finer for small forces, as the hand is.
function mountForce(studio, hands, element) {
    const slider = find("force");
    const most = () => Math.max(0, ...hands.pads.map(({ force_n }) => force_n)) || 5;
    const show = () => {
        hands.force_n = Math.min(hands.force_n, most());
        slider.value = 1000 * Math.sqrt(hands.force_n / most());
        slider.setAttribute("aria-valuetext", `${digits(hands.force_n)} newtons`);
        setText(find("force-text"), `${hands.force_n.toFixed(2)} N`);
        hands.repress();
        studio.pad?.demo.change();
    };
    const set = (force_n) => {
        hands.force_n = Math.max(0.02, Math.min(most(), force_n));
        show();
    };
    slider.addEventListener("input", () => set(most() * (slider.value / 1000) ** 2));
    const change = (steps) => set(hands.force_n * 1.12 ** steps);
    element.addEventListener(
        "wheel",
        (event) => {
            event.preventDefault();
            change(-Math.sign(event.deltaY));
        },
        { passive: false },
    );
    show();
    return { show, change };
}

function mountDemo(studio, hands) {
    const demo = new DemoHand(hands, studio.connection);
    const [button, choice] = [find("demo"), find("gesture")];
    button.addEventListener("click", () => (demo.running ? demo.stop() : demo.start()));
    choice.replaceChildren(...Object.entries(GESTURES).map(([value, text]) => make("option", { value, text })));
    choice.addEventListener("change", () => {
        demo.gesture = choice.value;
        demo.change();
    });
    everyFrame(() => {
        button.disabled = choice.disabled = !studio.mayTouch() || hands.free().length === 0;
        button.title = hands.free().length > 0 ? "Simulated hands move all pads and the inputs that you do not hold" : "You hold all inputs";
        const pressed = String(demo.running);
        if (button.getAttribute("aria-pressed") === pressed) return;
        button.setAttribute("aria-pressed", pressed);
        setText(button, demo.running ? "Stop stroking" : "Let it stroke");
    });
    return demo;
}

let blank = false;

function draw(canvas, hands, place, now_ms, simulated) {
    const nothing = hands.down.length === 0;
    const context = nothing && blank ? null : canvas.begin(); // nothing is painted while no hand is down
    blank = nothing;
    if (!context) return;
    const is = simulated ? "simulated hand" : hands.down.some(({ by }) => by === "replay") ? "replayed hand" : null;
    if (is) haloText(context, is, place.left + 12, place.top + (place.names.length > 1 ? 40 : 20), MARK, HALO);
    for (const hand of hands.down) drawHand(context, hand, place, hands.pads[hand.pad], now_ms);
}

function drawGrid(surface, place) {
    const context = surface.begin();
    if (!context) return;
    const { top, scale, width_mm, height_mm, names } = place;
    names.forEach((name, i) => drawPad(context, place, place.left + i * width_mm * scale, names.length > 1 && name));
    const [x, y] = [place.left + 14, top + height_mm * scale - 14];
    context.strokeStyle = HALO;
    context.lineWidth = 5;
    bar(context, x, y, GRID_MM * scale);
    context.strokeStyle = MARK;
    context.lineWidth = 2;
    bar(context, x, y, GRID_MM * scale);
    context.font = FONT;
    haloText(context, `${GRID_MM} mm`, x + GRID_MM * scale + 8, y + 4, MARK, HALO);
}

// The grid of one pad, with its name and an edge where there are several.
function drawPad(context, { top, scale, width_mm, height_mm }, left, name) {
    if (name) {
        context.strokeStyle = MARK;
        context.lineWidth = 2;
        context.strokeRect(left + 1, top + 1, width_mm * scale - 2, height_mm * scale - 2);
        context.font = FONT_STRONG;
        haloText(context, name, left + 12, top + 20, MARK, HALO);
    }
    context.lineWidth = 1;
    for (let mm = 0; mm <= width_mm / 2; mm += GRID_MM) {
        for (const x of new Set([mm, -mm])) line(context, left + (width_mm / 2 + x) * scale, top, 0, height_mm * scale, mm);
    }
    for (let mm = 0; mm <= height_mm / 2; mm += GRID_MM) {
        for (const y of new Set([mm, -mm])) line(context, left, top + (height_mm / 2 - y) * scale, width_mm * scale, 0, mm);
    }
}

function line(context, x, y, dx, dy, mm) {
    context.strokeStyle = mm % 50 === 0 ? "rgb(20 28 36 / .22)" : "rgb(20 28 36 / .09)";
    context.beginPath();
    context.moveTo(Math.round(x) + 0.5, Math.round(y) + 0.5);
    context.lineTo(Math.round(x + dx) + 0.5, Math.round(y + dy) + 0.5);
    context.stroke();
}

function bar(context, x, y, width) {
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(x + width, y);
    context.stroke();
}

function drawHand(context, hand, place, pad, now_ms) {
    const ink = HAND_INKS[hand.pad % HAND_INKS.length];
    const px = ({ x_mm, y_mm }) => [
        place.left + (x_mm + (hand.pad + 0.5) * place.width_mm) * place.scale,
        place.top + (place.height_mm / 2 - y_mm) * place.scale,
    ];
    drawTrail(context, hand.samples, px, ink, now_ms);
    const last = hand.samples.at(-1);
    const [x, y] = px(last);
    const radius = 7 + 30 * Math.sqrt(last.force_n / pad.force_n);
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.fillStyle = `color-mix(in srgb, ${ink} 22%, transparent)`;
    context.fill();
    context.lineWidth = 4.5;
    context.strokeStyle = HALO;
    context.stroke();
    context.lineWidth = 2.2;
    context.strokeStyle = ink;
    context.stroke();
    context.beginPath();
    context.arc(x, y, 3, 0, 2 * Math.PI);
    context.fillStyle = ink;
    context.fill();
    drawLabel(context, `${last.force_n.toFixed(2)} N   ${hand.speed_mm_s.toFixed(0)} mm/s`, x, y - radius - 14, place);
}

// The path of the last seconds; its width is the strength of the vibration.
function drawTrail(context, samples, px, ink, now_ms) {
    const newest_ms = now_ms - samples.at(-1).time_ms > TRAIL_MS ? now_ms : samples.at(-1).time_ms;
    const ageOf = ({ time_ms }) => Math.floor((TRAIL_STEPS * (newest_ms - time_ms)) / TRAIL_MS);
    const widthOf = ({ strength }) => Math.round(2 + WIDEST * (strength ?? 0));
    context.lineJoin = context.lineCap = "round";
    for (const [more, colour, opacity] of [
        [2.6, HALO, 0.45],
        [0, ink, 0.95],
    ]) {
        context.strokeStyle = colour;
        for (let i = samples.length - 1; i > 0;) {
            const [age, width] = [ageOf(samples[i]), widthOf(samples[i])];
            if (age >= TRAIL_STEPS) break;
            context.globalAlpha = (1 - age / TRAIL_STEPS) ** 1.5 * opacity;
            context.lineWidth = width + more;
            context.lineCap = age < 2 ? "round" : "butt"; // round ends would show where what fades overlaps
            context.beginPath();
            context.moveTo(...px(samples[i]));
            do context.lineTo(...px(samples[--i]));
            while (i > 0 && ageOf(samples[i]) === age && widthOf(samples[i]) === width);
            context.stroke();
        }
    }
    context.globalAlpha = 1;
}

// Force and speed on a small plate above the pen, or below it at the upper edge.
function drawLabel(context, text, x, y, place) {
    context.font = FONT_STRONG;
    const width = context.measureText(text).width + 18;
    const right = place.left * 2 + place.names.length * place.width_mm * place.scale;
    const left = Math.max(6, Math.min(x - width / 2, right - width - 6));
    const top = y - 13 < 4 ? y + 90 : y - 13;
    context.beginPath();
    context.roundRect(left, top, width, 24, 7);
    context.globalAlpha = 0.92;
    context.fillStyle = colours.box;
    context.fill();
    context.globalAlpha = 1;
    context.lineWidth = 1;
    context.strokeStyle = colours.frame;
    context.stroke();
    context.fillStyle = colours.ink;
    context.fillText(text, left + 9, top + 16);
}
