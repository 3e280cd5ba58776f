// Keeps the last seconds of its input, and sends them when it is asked.
class Keeper extends AudioWorkletProcessor {
    constructor({ processorOptions: { kept_s } }) {
        super();
        this.ring = new Float32Array(Math.ceil(kept_s * sampleRate));
        this.written = 0;
        this.port.onmessage = () => this.port.postMessage(this.last());
    }

    // The samples in their order, as many as there are.
    last() {
        const { ring, written } = this;
        if (written < ring.length) return ring.slice(0, written);
        const at = written % ring.length;
        const samples = new Float32Array(ring.length);
        samples.set(ring.subarray(at));
        samples.set(ring.subarray(0, at), ring.length - at);
        return samples;
    }

    process([[samples]], [[out]]) {
        for (let i = 0; i < out.length; i++) this.ring[this.written++ % this.ring.length] = samples?.[i] ?? 0;
        return true;
    }
}

registerProcessor("keeper", Keeper);
