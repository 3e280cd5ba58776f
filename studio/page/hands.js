// Converts pointers and keys to hands on the pads: position, force, tilt; sent at once. Inputs without a pad are held in the
// same way.
import { pointers } from "./frames.js";

const REPEAT_MS = 50; // a hand that rests is sent again this often, so that it is not taken for a silent input
const REPEAT_BACK_MS = 16; // and that much in the past, so that events that are under way do not seem older
const LOOK_MS = 10;
const KEY_SPEED_MM_S = 80;
const KEY_SPEED_FAST_MM_S = 240;
const SPEED_WINDOW_MS = 45;
const TRAIL_MS = 1600;
const REACH_MM = 100; // of an input's pad from its middle: the whole range
const INPUT_PAD = { width_mm: 2 * REACH_MM, height_mm: 2 * REACH_MM, force_n: 1 };
const LEAST_ALTITUDE = 0.01; // radians, of a pen that lies

const nameOf = ({ endpoint, channel }) => `${endpoint}.${channel}`;

export class Hands {
    #connection;
    #hands = new Map(); // by who moves it: a pointer's id, "keys", the name of an input, or who shows it and where
    #rests = []; // of each pad: where it was left, and when that was sent

    constructor(connection) {
        this.#connection = connection;
        this.pads = [];
        this.inputs = []; // further numbers that a page can move, { endpoint, channel }, numbered after the pads
        this.force_n = 1; // of whoever cannot press harder: mouse, finger, keys
        this.allowed = () => true;
        this.onpress = null; // called before a person takes a pad or an input
        setInterval(() => this.#repeat(), LOOK_MS);
    }

    // The hands that are down on pads.
    get down() {
        return [...this.#hands.values()].filter(({ pad, samples }) => pad < this.pads.length && samples.length > 0);
    }

    // Whoever holds an input goes on, if that is still there.
    setPads(pads, inputs = []) {
        this.liftAll();
        [this.pads, this.inputs, this.#rests] = [pads, inputs, []];
        for (const [who, hand] of this.#hands) {
            hand.pad = this.#numberOf(who);
            if (hand.pad < 0) this.#hands.delete(who);
        }
    }

    // The number of an input by its name; -1 if there is none.
    #numberOf(name) {
        const at = this.inputs.findIndex((input) => nameOf(input) === name);
        return at < 0 ? -1 : this.pads.length + at;
    }

    // Puts a hand on its pad if that is free, else on the first free one; false if none is free. A pen has its own force, all
    // others have the force of the slider.
    press(who, sample, hasForce = false) {
        if (!this.allowed()) return false;
        const pad = this.#padFor(who, sample.pad);
        if (pad < 0) return false;
        this.onpress?.();
        this.#hands.set(who, { who, pad, hasForce, samples: [], speed_mm_s: 0, sent_ms: 0 });
        this.move(who, [sample]);
        return true;
    }

    // The force at full pressure of the hand's pad, or of the next free pad.
    fullForce(who) {
        return this.pads[this.#padFor(who)]?.force_n ?? 1;
    }

    // The pad of a hand that is down, else the wanted one or the first where no person has a hand; -1 if there is none.
    #padFor(who, wanted) {
        const taken = new Set(this.down.filter(({ isShown }) => !isShown).map((hand) => hand.pad));
        const free = this.pads.map((_, i) => i).filter((i) => !taken.has(i));
        return this.#hands.get(who)?.pad ?? (free.includes(wanted) ? wanted : (free[0] ?? -1));
    }

    // The pad of a pointer that is down.
    padOf(who) {
        return this.#hands.get(who)?.pad;
    }

    // The pads, and the inputs that nobody holds, for simulated hands.
    free() {
        const pads = this.pads.map((pad, number) => ({ number, pad, isInput: false }));
        const inputs = this.inputs.filter((input) => !this.holds(input));
        return [...pads, ...inputs.map((input) => ({ number: this.#numberOf(nameOf(input)), pad: INPUT_PAD, isInput: true }))];
    }

    // Holds an input at numbers from 0 to 1 of its range, until it is released; false if this page may not.
    hold(input, parts) {
        const who = nameOf(input);
        if (!this.allowed() || this.#numberOf(who) < 0) return false;
        if (!this.holds(input)) {
            this.onpress?.();
            this.#hands.set(who, { who, pad: this.#numberOf(who), isInput: true, samples: [], sent_ms: 0 });
        }
        const [x, y = 0.5, z = 0.5] = parts.map((part) => Math.max(0, Math.min(1, part)));
        const at = { x_mm: REACH_MM * (2 * x - 1), y_mm: REACH_MM * (2 * y - 1), tilt_x_deg: 90 * (2 * z - 1), tilt_y_deg: 0 };
        this.move(who, [{ ...at, force_n: 1, time_ms: performance.now() }]);
        return true;
    }

    holds(input) {
        return this.#hands.has(nameOf(input));
    }

    // Hands an input back to the graph.
    release(input) {
        this.lift(nameOf(input));
    }

    // A hand that another than a person moves: it is seen when its samples are due, and not sent.
    show(by, number, samples) {
        const who = `${by} ${number}`;
        if (!this.#hands.has(who)) this.#hands.set(who, { who, by, pad: number, isShown: true, samples: [], ahead: [], speed_mm_s: 0 });
        this.#hands.get(who).ahead.push(...samples);
    }

    hide(by) {
        for (const [who, hand] of this.#hands) if (hand.by === by) this.#hands.delete(who);
    }

    // Takes new samples of a hand, oldest first, and sends them.
    move(who, samples) {
        const hand = this.#hands.get(who);
        if (!hand) return;
        const last_ms = hand.samples.at(-1)?.time_ms ?? -Infinity;
        const fresh = samples.filter((sample) => sample.time_ms > last_ms).map((sample) => this.#inside(hand.pad, sample));
        if (fresh.length === 0) return;
        hand.samples.push(...fresh);
        if (!hand.isShown) this.#send(hand, fresh);
        this.#measure(hand);
    }

    // Hands without a force of their own press with that of the slider, also while they stand still.
    repress() {
        for (const { who, hasForce, isShown, samples } of this.down) {
            if (isShown || hasForce) continue;
            this.move(who, [{ ...samples.at(-1), force_n: this.force_n, time_ms: performance.now() }]);
        }
    }

    lift(who) {
        const hand = this.#hands.get(who);
        if (!hand) return;
        this.#hands.delete(who);
        const last = hand.samples.at(-1);
        if (last && !hand.isShown) this.#send(hand, [{ ...last, force_n: 0, time_ms: performance.now() }]);
    }

    // Lets go of all inputs, without a word: another page has them, or none.
    forgetInputs() {
        for (const [who, { isInput }] of this.#hands) if (isInput) this.#hands.delete(who);
    }

    // Lifts all hands from the pads; inputs stay where they were put.
    liftAll() {
        this.onpress?.();
        for (const [who, { isInput, isShown }] of this.#hands) if (!isInput && !isShown) this.lift(who);
    }

    #inside(number, sample) {
        const pad = this.pads[number];
        if (!pad) return sample;
        const within = (value, most) => Math.max(-most, Math.min(most, value));
        return {
            ...sample,
            x_mm: within(sample.x_mm, pad.width_mm / 2),
            y_mm: within(sample.y_mm, pad.height_mm / 2),
            force_n: Math.max(0, Math.min(sample.force_n, pad.force_n)),
        };
    }

    #send(hand, samples) {
        hand.sent_ms = performance.now();
        this.#connection.sendBinary(pointers(hand.pad, samples, false, this.#connection.graph));
        if (hand.pad < this.pads.length) this.#rests[hand.pad] = { ...samples.at(-1), force_n: 0, sent_ms: hand.sent_ms };
    }

    // Hands that rest, and pads beside them that nobody touches: an actuator that depends on several pads waits for all.
    #repeat() {
        const now_ms = performance.now();
        const isSeen = !globalThis.document?.hidden && this.allowed();
        for (const hand of [...this.#hands.values()]) {
            if (hand.isShown) this.#showDue(hand, now_ms);
            else if (now_ms - hand.sent_ms >= REPEAT_MS && (isSeen || !hand.isInput)) {
                const last = hand.samples.at(-1);
                this.#send(hand, [{ ...last, time_ms: now_ms - REPEAT_BACK_MS }]);
                if (now_ms - last.time_ms > SPEED_WINDOW_MS) hand.speed_mm_s = 0;
            }
        }
        const taken = this.down.filter(({ isShown }) => !isShown).map(({ pad }) => pad);
        if (taken.length === 0) return;
        for (const pad of this.pads.keys()) {
            const rest = this.#rests[pad] ?? { x_mm: 0, y_mm: 0, force_n: 0, tilt_x_deg: 0, tilt_y_deg: 0, sent_ms: 0 };
            if (!taken.includes(pad) && now_ms - rest.sent_ms >= REPEAT_MS)
                this.#send({ pad }, [{ ...rest, time_ms: now_ms - REPEAT_BACK_MS }]);
        }
    }

    #showDue(hand, now_ms) {
        const due = hand.ahead.findIndex(({ time_ms }) => time_ms > now_ms);
        this.move(hand.who, hand.ahead.splice(0, due < 0 ? hand.ahead.length : due));
        if (hand.samples.at(-1)?.force_n === 0) hand.samples = [];
    }

    // Mean speed over the last few hundredths of a second.
    #measure(hand) {
        const end = hand.samples.at(-1);
        while (hand.samples.length > 2 && end.time_ms - hand.samples[0].time_ms > TRAIL_MS) hand.samples.shift();
        let way_mm = 0,
            i = hand.samples.length - 1;
        for (; i > 0 && end.time_ms - hand.samples[i - 1].time_ms < SPEED_WINDOW_MS; i--) {
            const [a, b] = [hand.samples[i - 1], hand.samples[i]];
            way_mm += Math.hypot(b.x_mm - a.x_mm, b.y_mm - a.y_mm);
        }
        const time_ms = end.time_ms - hand.samples[i].time_ms;
        hand.speed_mm_s = time_ms > 0 ? (1000 * way_mm) / time_ms : 0;
    }
}

// Tilt of a pen to the right and towards the user, degrees; some browsers report only altitude and azimuth.
export function tiltOf({ tiltX = 0, tiltY = 0, altitudeAngle = Math.PI / 2, azimuthAngle = 0 }) {
    if (tiltX || tiltY || !(altitudeAngle < Math.PI / 2)) return { tilt_x_deg: tiltX, tilt_y_deg: tiltY };
    const aside = 1 / Math.tan(Math.max(altitudeAngle, LEAST_ALTITUDE));
    const degrees = (part) => (Math.atan(part * aside) * 180) / Math.PI;
    return { tilt_x_deg: degrees(Math.cos(azimuthAngle)), tilt_y_deg: degrees(Math.sin(azimuthAngle)) };
}

// Pointer Events on `element`; `toMm(clientX, clientY)` is the position on the pad.
export function followPointers(element, hands, toMm) {
    const sampleOf = (event, force_n) => ({
        ...toMm(event.clientX, event.clientY, hands.padOf(event.pointerId)),
        time_ms: event.timeStamp,
        force_n,
        ...tiltOf(event),
    });
    const isPen = ({ pointerType }) => pointerType === "pen";
    const forceOf = (event) => (isPen(event) ? event.pressure * hands.fullForce(event.pointerId) : hands.force_n);
    const samplesOf = (event) => {
        const events = event.getCoalescedEvents?.() ?? [];
        return (events.length ? events : [event]).map((each) => sampleOf(each, forceOf(each)));
    };
    const move = (event) => hands.move(event.pointerId, samplesOf(event));
    const lift = (event) => hands.lift(event.pointerId);
    element.addEventListener("pointerdown", (event) => {
        if (event.button !== 0 || event.target.closest("button")) return;
        event.preventDefault();
        element.focus({ preventScroll: true });
        element.setPointerCapture(event.pointerId);
        hands.press(event.pointerId, sampleOf(event, forceOf(event)), isPen(event));
    });
    // pointerrawupdate, if the browser has it, does not wait for the next frame; pointermove brings the rest.
    element.addEventListener("pointerrawupdate", move);
    element.addEventListener("pointermove", move);
    for (const type of ["pointerup", "pointercancel", "lostpointercapture"]) element.addEventListener(type, lift);
    for (const type of ["contextmenu", "dragstart", "selectstart"])
        element.addEventListener(type, (event) => event.preventDefault());
    window.addEventListener("blur", () => hands.liftAll());
    window.addEventListener("pagehide", () => hands.liftAll());
    document.addEventListener("visibilitychange", () => document.hidden && hands.liftAll());
}

// Arrow keys held on `element` move a hand that presses; of several pads a digit chooses one; `changeForce(steps)` is for plus and minus.
export function followKeys(element, hands, changeForce) {
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    const held = new Set();
    const at = { x_mm: 0, y_mm: 0, tilt_x_deg: 0, tilt_y_deg: 0 };
    let fast = false,
        last_ms = 0;
    const pad = () => hands.pads[at.pad] ?? hands.pads[0] ?? { width_mm: 0, height_mm: 0 };
    const step = (now_ms) => {
        if (held.size === 0) return hands.lift("keys");
        const [dx, dy] = [...held].reduce(([x, y], key) => [x + ways[key][0], y + ways[key][1]], [0, 0]);
        const way_mm =
            ((fast ? KEY_SPEED_FAST_MM_S : KEY_SPEED_MM_S) * Math.min(now_ms - last_ms, 50)) / 1000 / (Math.hypot(dx, dy) || 1);
        const { width_mm, height_mm } = pad();
        at.x_mm = Math.max(-width_mm / 2, Math.min(width_mm / 2, at.x_mm + dx * way_mm));
        at.y_mm = Math.max(-height_mm / 2, Math.min(height_mm / 2, at.y_mm + dy * way_mm));
        last_ms = now_ms;
        hands.move("keys", [{ ...at, time_ms: performance.now(), force_n: hands.force_n }]);
        requestAnimationFrame(step);
    };
    element.addEventListener("keydown", (event) => {
        fast = event.shiftKey;
        if (event.key === "+" || event.key === "-") return changeForce(event.key === "+" ? 1 : -1);
        if (event.key > "0" && event.key <= String(hands.pads.length)) at.pad = Number(event.key) - 1;
        if (event.key === "Home") [at.x_mm, at.y_mm] = [0, 0];
        if (!(event.key in ways)) return;
        event.preventDefault();
        if (held.size === 0 && hands.press("keys", { ...at, time_ms: performance.now(), force_n: hands.force_n })) {
            last_ms = performance.now();
            requestAnimationFrame(step);
        }
        held.add(event.key);
    });
    element.addEventListener("keyup", (event) => {
        fast = event.shiftKey;
        held.delete(event.key);
    });
    element.addEventListener("blur", () => held.clear());
}
