// The last seconds of one port: a ring of minimum and maximum per interval and component.
const THINNED_HISTORY_S = 24;
const RAW_HISTORY_S = 3;

export class Trace {
    constructor(name, raw) {
        this.name = name;
        this.raw = raw;
        this.users = 0;
        this.clear();
    }

    clear() {
        this.lanes = 0;
        this.interval_s = 0;
        this.capacity = 0;
        this.written = 0; // frames since the start; the ring holds the last `capacity`
        this.end_s = 0; // of the frame after the last
        this.least = this.most = new Float32Array(0);
    }

    get count() {
        return Math.min(this.written, this.capacity);
    }

    // Takes a message of samples; a gap is filled with NaN, which draws as a gap.
    push({ lanes, thinned, count, time_s, interval_s, values }) {
        if (count === 0 || lanes === 0 || !(interval_s > 0)) return;
        const step = time_s - this.end_s;
        const fits = lanes === this.lanes && Math.abs(interval_s / this.interval_s - 1) < 1e-6 && step > -2 * interval_s;
        if (!fits) this.#start(lanes, thinned, interval_s);
        else if (step > 1.5 * interval_s) this.#gap(Math.round(step / interval_s));
        for (let i = 0; i < count; i++) this.#frame(values, i, thinned);
        this.end_s = time_s + count * interval_s;
    }

    // The latest value of a component (the maximum of the last interval); NaN if there is none.
    latest(lane = 0) {
        if (this.written === 0 || lane >= this.lanes) return NaN;
        return this.most[((this.written - 1) % this.capacity) * this.lanes + lane];
    }

    // Place in the ring of the frame that was written `back` frames before the last.
    place(back) {
        return ((this.written - 1 - back) % this.capacity) * this.lanes;
    }

    // Root mean square of the middle of the last `span_s` and the largest absolute value in it, over all components.
    level(span_s) {
        const frames = Math.min(this.count, Math.ceil(span_s / (this.interval_s || 1)));
        let sum = 0,
            peak = 0,
            taken = 0;
        for (let back = 0; back < frames; back++) {
            const at = this.place(back);
            for (let lane = 0; lane < this.lanes; lane++) {
                const low = this.least[at + lane],
                    high = this.most[at + lane];
                if (Number.isNaN(high)) continue;
                peak = Math.max(peak, Math.abs(high));
                if (Number.isNaN(low)) continue; // NaN was beside it
                sum += (low * low + high * high) / 2;
                peak = Math.max(peak, -low);
                taken++;
            }
        }
        return { rms: taken ? Math.sqrt(sum / taken) : 0, peak };
    }

    // A copy of the present state, which later samples do not change.
    copy() {
        const copy = Object.assign(new Trace(this.name, this.raw), this);
        copy.most = this.most.slice();
        copy.least = this.least === this.most ? copy.most : this.least.slice();
        return copy;
    }

    #start(lanes, thinned, interval_s) {
        this.clear();
        this.lanes = lanes;
        this.interval_s = interval_s;
        this.capacity = Math.max(16, Math.ceil((this.raw ? RAW_HISTORY_S : THINNED_HISTORY_S) / interval_s));
        this.most = new Float32Array(this.capacity * lanes);
        this.least = thinned ? new Float32Array(this.capacity * lanes) : this.most;
    }

    #gap(frames) {
        for (let i = 0; i < Math.min(frames, this.capacity); i++) {
            const at = (this.written++ % this.capacity) * this.lanes;
            this.most.fill(NaN, at, at + this.lanes);
            this.least.fill(NaN, at, at + this.lanes);
        }
    }

    #frame(values, i, thinned) {
        const at = (this.written++ % this.capacity) * this.lanes;
        for (let lane = 0; lane < this.lanes; lane++) {
            const from = i * this.lanes + lane;
            this.least[at + lane] = values[thinned ? 2 * from : from];
            this.most[at + lane] = values[thinned ? 2 * from + 1 : from];
        }
    }
}
