// A simulated hand: circles whose speed and force swell and fade, so that the whole map is heard.
import { everyFrame } from "./frame.js";

const TURN_S = 1.3;
const SPEED_SWELL_S = 7.1;
const FORCE_SWELL_S = 4.3;
const SAMPLES_PER_FRAME = 4;
const WHO = "demo";

export class DemoHand {
    #hands;
    #angle = 0;
    #time_s = 0;
    #last_ms = 0;

    constructor(hands) {
        this.#hands = hands;
        everyFrame(() => this.#step());
    }

    get running() {
        return this.#hands.down.some((hand) => hand.who === WHO);
    }

    start() {
        this.#last_ms = performance.now();
        return this.#hands.press(WHO, this.#sample(this.#last_ms));
    }

    stop() {
        this.#hands.lift(WHO);
    }

    #sample(time_ms) {
        const { width_mm, height_mm } = this.#hands.pads[0] ?? { width_mm: 0, height_mm: 0 };
        const radius_mm = 0.3 * Math.min(width_mm, height_mm);
        return {
            time_ms,
            x_mm: 1.25 * radius_mm * Math.cos(this.#angle),
            y_mm: radius_mm * Math.sin(this.#angle),
            force_n: this.#hands.force_n * (1 + 0.45 * Math.sin((2 * Math.PI * this.#time_s) / FORCE_SWELL_S)),
            tilt_x_deg: 0,
            tilt_y_deg: 0,
        };
    }

    #step() {
        if (!this.running) return;
        const now_ms = performance.now();
        const step_ms = Math.min(now_ms - this.#last_ms, 100) / SAMPLES_PER_FRAME;
        const samples = [];
        for (let i = 1; i <= SAMPLES_PER_FRAME; i++) {
            this.#time_s += step_ms / 1000;
            const speed = 1 + 0.7 * Math.sin((2 * Math.PI * this.#time_s) / SPEED_SWELL_S);
            this.#angle += (2 * Math.PI * speed * step_ms) / 1000 / TURN_S;
            samples.push(this.#sample(now_ms - (SAMPLES_PER_FRAME - i) * step_ms));
        }
        this.#last_ms = now_ms;
        this.#hands.move(WHO, samples);
    }
}
