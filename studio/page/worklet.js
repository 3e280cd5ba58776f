// Plays binary 3: a ring that messages fill and that is played at the card's rate; its fill is controlled.
const HEAD_BYTES = 16; // of binary 3, before the samples
const RING_S = 2;
const FIRST_TARGET_S = 0.06;
const LEAST_TARGET_S = 0.012;
const MOST_TARGET_S = 0.2;
const WIDER_S = 0.01; // after an underrun
const NARROWER_S = 0.001; // after each CALM_S in which more than this was always left:
const SPARE_S = 0.02;
const CALM_S = 10;
const FORGET = 0.01 / 1800; // how fast what was left least is forgotten, s per s: a rare delay must not be heard again and again
const TOO_MUCH_S = 0.12; // above the target: what is older is left out
const BEND = 0.004; // most that the rate is bent to steer the fill
const FADE_S = 0.004;
const REPORT_S = 0.2;

class Player extends AudioWorkletProcessor {
    constructor({ processorOptions: { rate_hz } }) {
        super();
        this.rate_hz = rate_hz;
        this.size = 2 ** Math.ceil(Math.log2(rate_hz * RING_S));
        this.ring = new Float32Array(this.size);
        this.target_s = FIRST_TARGET_S;
        this.fade = 1 / (FADE_S * sampleRate);
        this.restart();
        this.port.onmessage = ({ data }) => {
            if (data.restart) this.restart();
            if (data.source) data.source.onmessage = (message) => this.take(new Float32Array(message.data, HEAD_BYTES));
        };
    }

    restart() {
        this.write = 0; // samples so far
        this.read = 0; // place between samples
        this.gain = 0;
        this.last = 0;
        this.filling = true;
        this.fill_s = this.target_s;
        this.least_s = this.target_s; // that was left
        this.underruns = 0;
        this.calm_s = this.report_s = this.peak = 0;
    }

    take(values) {
        for (let i = 0; i < values.length; i++) this.ring[this.write++ & (this.size - 1)] = values[i];
        if (this.write - this.read > this.size - 8) this.read = this.write - this.target_s * this.rate_hz;
    }

    // With another target another fill would have been left.
    aim(target_s) {
        this.least_s += target_s - this.target_s;
        this.target_s = target_s;
    }

    // Cubic interpolation between the samples around the place.
    sample() {
        const at = Math.floor(this.read),
            t = this.read - at,
            mask = this.size - 1;
        const a = this.ring[(at - 1) & mask],
            b = this.ring[at & mask],
            c = this.ring[(at + 1) & mask],
            d = this.ring[(at + 2) & mask];
        return b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a)));
    }

    process(_, [[out, ...others]]) {
        const have_s = (this.write - this.read) / this.rate_hz;
        this.fill_s += 0.02 * (have_s - this.fill_s);
        if (!this.filling) this.least_s = Math.min(Math.max(0, have_s), this.least_s + (FORGET * out.length) / sampleRate);
        if (this.filling && have_s >= this.target_s) this.filling = false;
        if (!this.filling && have_s > this.target_s + TOO_MUCH_S && this.gain === 0)
            this.read = this.write - this.target_s * this.rate_hz;
        const late = have_s > this.target_s + TOO_MUCH_S;
        const bend = Math.max(-BEND, Math.min(BEND, (this.fill_s - this.target_s) * 0.15));
        const step = (this.rate_hz / sampleRate) * (1 + bend);
        for (let i = 0; i < out.length; i++) out[i] = this.next(step, late);
        for (const other of others) other.set(out);
        this.account(out.length / sampleRate);
        return true;
    }

    // One sample; if there is none, or too many, the sound fades out and in.
    next(step, late) {
        const ready = this.write - this.read > 3;
        if (!ready && !this.filling) {
            this.filling = true;
            this.underruns++;
            this.calm_s = 0;
            this.aim(Math.min(MOST_TARGET_S, this.target_s + WIDER_S));
        }
        const wanted = this.filling || late ? 0 : 1;
        this.gain = wanted ? Math.min(1, this.gain + this.fade) : Math.max(0, this.gain - this.fade);
        if (ready && !this.filling) {
            this.last = this.sample();
            this.read += step;
        }
        const value = this.last * this.gain;
        this.peak = Math.max(this.peak, Math.abs(value));
        return value;
    }

    account(block_s) {
        this.calm_s += block_s;
        this.report_s += block_s;
        if (this.calm_s > CALM_S && !this.filling) {
            this.calm_s = 0;
            if (this.least_s > SPARE_S) this.aim(Math.max(LEAST_TARGET_S, this.target_s - NARROWER_S));
        }
        if (this.report_s < REPORT_S) return;
        this.port.postMessage({
            fill_s: Math.max(0, this.fill_s),
            target_s: this.target_s,
            underruns: this.underruns,
            peak: this.peak,
            playing: !this.filling,
        });
        this.report_s = this.peak = 0;
    }
}
registerProcessor("player", Player);
