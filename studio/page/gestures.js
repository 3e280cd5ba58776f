// Gestures of simulated hands as functions of time, so that every position is that of its own time.
const TURN_S = 1.3;
const SWELL_S = 7.1;
const FORCE_SWELL_S = 4.3;
const TO_AND_FRO_S = 1.6;
const TAP_EVERY_S = 0.5;
const TAP_S = 0.06;
const PRESS_S = 2;
const STROKE_S = 0.8; // from the edge to the middle, and on from there
const STOP_S = 0.5;
const RETURN_S = 0.7;

export const GESTURES = { circles: "Circles", across: "Back and forth", taps: "Taps", press: "Press", stop: "Stroke with a stop" };

const turn = (part) => 2 * Math.PI * part;

// Place from -1 to 1 along each axis, and force relative to the mean, 0 where the hand is lifted, by the time in s.
const PATHS = {
    // Speed and force swell, and cover the whole map.
    circles: (t) => {
        const angle = turn((t + ((0.7 * SWELL_S) / turn(1)) * (1 - Math.cos(turn(t / SWELL_S)))) / TURN_S);
        return { x: 0.6 * Math.cos(angle), y: 0.6 * Math.sin(angle), force: 1 + 0.45 * Math.sin(turn(t / FORCE_SWELL_S)) };
    },
    across: (t) => ({ x: 0.8 * Math.sin(turn(t / TO_AND_FRO_S)), y: 0, force: 1 }),
    taps: (t) => {
        const [number, since_s] = [Math.floor(t / TAP_EVERY_S), t % TAP_EVERY_S];
        const force = since_s < TAP_S ? 1.5 * Math.sin((Math.PI * since_s) / TAP_S) : 0;
        return { x: 0.7 * Math.sin(1.7 * number), y: 0.6 * Math.cos(2.3 * number), force };
    },
    press: (t) => ({ x: 0, y: 0, force: 0.75 * (1 - Math.cos(turn(t / PRESS_S))) }),
    stop: (t) => {
        const at_s = t % (2 * STROKE_S + STOP_S + RETURN_S);
        const [stopped, lifted] = [at_s - STROKE_S, at_s - 2 * STROKE_S - STOP_S];
        if (lifted >= 0) return { x: 0.8 - (1.6 * lifted) / RETURN_S, y: 0, force: 0 };
        const moving_s = stopped < 0 ? at_s : Math.max(STROKE_S, at_s - STOP_S);
        return { x: 0.8 * (moving_s / STROKE_S - 1), y: 0, force: 1 };
    },
};

const STEP_MS = 4;
const AHEAD_MS = 120; // so late may a message be
const PHASE_S = 0.31; // of each further hand

// The hands of `hands`, [{ number, pad, isInput }], in a gesture; `force_n` is the mean force.
export class Stroke {
    #start_ms;
    #sent_ms;
    #lifts = false;

    constructor({ hands, gesture, force_n }, now_ms) {
        Object.assign(this, { hands, gesture, force_n });
        this.#start_ms = now_ms;
        this.#sent_ms = now_ms - STEP_MS;
    }

    // Takes another force or gesture; the hands are lifted on their way to another.
    change({ gesture, force_n }) {
        this.#lifts ||= gesture !== this.gesture;
        Object.assign(this, { gesture, force_n });
    }

    // The samples to send now, ahead of their times, as [{ number, samples }].
    until(now_ms) {
        if (now_ms - this.#sent_ms > 1000) this.#sent_ms = now_ms - STEP_MS; // the page slept
        const times = [];
        while (this.#sent_ms + STEP_MS <= now_ms + AHEAD_MS) times.push((this.#sent_ms += STEP_MS));
        if (times.length === 0) return [];
        const all = this.hands.map((hand, i) => ({ number: hand.number, samples: times.map((time_ms) => this.#sample(hand, i, time_ms)) }));
        if (this.#lifts) for (const { samples } of all.filter((_, i) => !this.hands[i].isInput)) samples[0].force_n = 0;
        this.#lifts = false;
        return all;
    }

    // Lifts all hands, which hands inputs back.
    end() {
        return this.hands.map((hand, i) => ({
            number: hand.number,
            samples: [{ ...this.#sample(hand, i, this.#sent_ms + STEP_MS), force_n: 0 }],
        }));
    }

    #sample({ pad, isInput }, i, time_ms) {
        const { x, y, force } = PATHS[this.gesture]((time_ms - this.#start_ms) / 1000 + i * PHASE_S);
        const half = { x: pad.width_mm / 2, y: pad.height_mm / 2 };
        // A fader follows the press of a gesture that goes nowhere, and is never let go.
        const presses = this.gesture === "taps" || this.gesture === "press";
        const along = isInput && presses ? 0.8 * (2 * Math.min(1, force / 1.5) - 1) : x;
        const across = Math.min(half.x, half.y * 1.25);
        return {
            time_ms,
            x_mm: (this.gesture === "circles" && !isInput ? across : half.x) * along,
            y_mm: half.y * y,
            force_n: isInput ? 1 : Math.min(pad.force_n, this.force_n * force),
            tilt_x_deg: 0,
            tilt_y_deg: 0,
        };
    }
}
