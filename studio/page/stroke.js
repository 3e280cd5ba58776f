// The path of a simulated hand: circles of varying speed and force, which cover the whole map.
const TURN_S = 1.3;
const SPEED_SWELL_S = 7.1;
const FORCE_SWELL_S = 4.3;
const LARGEST_MS = 8; // between samples where the one who asks was late
const LONGEST_MS = 100;

export class Stroke {
    #angle = 0;
    #time_s = 0;
    #last_ms;

    // On a pad ({ width_mm, height_mm }) from `now_ms`; `force_n` is the mean.
    constructor(pad, force_n, now_ms) {
        this.pad = pad;
        this.force_n = force_n;
        this.#last_ms = now_ms;
    }

    // The samples since the last call, at even intervals.
    until(now_ms) {
        const step_ms = Math.min(now_ms - this.#last_ms, LONGEST_MS);
        const count = Math.ceil(step_ms / LARGEST_MS);
        this.#last_ms = now_ms;
        return Array.from({ length: count }, (_, i) => {
            const part_s = step_ms / count / 1000;
            this.#time_s += part_s;
            const speed = 1 + 0.7 * Math.sin((2 * Math.PI * this.#time_s) / SPEED_SWELL_S);
            this.#angle += (2 * Math.PI * speed * part_s) / TURN_S;
            return this.sample(now_ms - (count - 1 - i) * part_s * 1000);
        });
    }

    // The hand's sample, with the time `time_ms`.
    sample(time_ms) {
        const radius_mm = 0.3 * Math.min(this.pad.width_mm, this.pad.height_mm);
        return {
            time_ms,
            x_mm: 1.25 * radius_mm * Math.cos(this.#angle),
            y_mm: radius_mm * Math.sin(this.#angle),
            force_n: Math.min(
                this.pad.force_n,
                this.force_n * (1 + 0.45 * Math.sin((2 * Math.PI * this.#time_s) / FORCE_SWELL_S)),
            ),
            tilt_x_deg: 0,
            tilt_y_deg: 0,
        };
    }
}
