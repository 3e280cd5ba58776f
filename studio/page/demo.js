// A simulated hand: circles whose speed and force swell and fade, so that the whole map is heard.
const TURN_S = 1.3;
const SPEED_SWELL_S = 7.1;
const FORCE_SWELL_S = 4.3;
const EVERY_MS = 5; // as a pen tablet reports; one sample a message, so that each is at its place in time
const LARGEST_MS = 8; // between samples where the page was late
const LONGEST_STEP_MS = 100;
const WHO = "demo";

export class DemoHand {
    #hands;
    #angle = 0;
    #time_s = 0;
    #last_ms = 0;
    #timer = 0;

    constructor(hands) {
        this.#hands = hands;
    }

    get running() {
        return this.#hands.down.some((hand) => hand.who === WHO);
    }

    start() {
        clearInterval(this.#timer);
        this.#last_ms = performance.now();
        if (this.#hands.press(WHO, this.#sample(this.#last_ms))) this.#timer = setInterval(() => this.#step(), EVERY_MS);
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
        if (!this.running) return clearInterval(this.#timer);
        const now_ms = performance.now();
        const step_ms = Math.min(now_ms - this.#last_ms, LONGEST_STEP_MS);
        this.#last_ms = now_ms;
        const count = Math.ceil(step_ms / LARGEST_MS);
        const samples = [];
        for (let i = 1; i <= count; i++) {
            const part_s = step_ms / count / 1000;
            this.#time_s += part_s;
            const speed = 1 + 0.7 * Math.sin((2 * Math.PI * this.#time_s) / SPEED_SWELL_S);
            this.#angle += (2 * Math.PI * speed * part_s) / TURN_S;
            samples.push(this.#sample(now_ms - (count - i) * part_s * 1000));
        }
        this.#hands.move(WHO, samples);
    }
}
