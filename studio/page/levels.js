// The measurements of a running graph: levels of wires, shares of the cost, and places where a limit acted or NaN
// appeared.
import { digits, quantity } from "./numbers.js";

const DECAY = 0.99; // of the loudest that a port was, a message
const RECENT_MS = 2000; // for so long such an event is shown as one that goes on
const QUIET_WIDTH = 1;
const MOST_WIDTH = 5;
const COST_FROM = 0.005; // a part of the cost that is shown
const LIMITS = { peak: "peak", continuous: "heat", slew: "slew" };

export class Levels {
    #described = new Map();
    #ports = new Map(); // by name: { rms, peak, loudest }
    #limits = new Map(); // by node: { counts, held, since_ms }
    #faults = new Map(); // by port: { frames, since_ms }
    #costs = null;
    #origin = null;

    // Begins another graph or a new run: drops the ports that it does not have.
    restart({ levels }) {
        this.#described = new Map(levels.map((level) => [level.name, level]));
        for (const name of this.#ports.keys()) if (!this.#described.has(name)) this.#ports.delete(name);
    }

    // Takes a `levels` message.
    take({ ports, not_finite, limits, costs, origin }, now_ms) {
        for (const name of this.#described.keys()) {
            const [rms, peak] = ports[name] ?? [0, 0];
            const loudest = Math.max(rms, (this.#ports.get(name)?.loudest ?? 0) * DECAY);
            this.#ports.set(name, { rms, peak, loudest });
        }
        this.#limits = new Map(Object.entries(limits).map(([node, counts]) => [node, this.#held(node, counts, now_ms)]));
        const faults = Object.entries(not_finite);
        this.#faults = new Map(faults.map(([port, frames]) => [port, since(this.#faults.get(port), "frames", frames, now_ms)]));
        [this.#costs, this.#origin] = [costs, origin];
    }

    #held(node, counts, now_ms) {
        const held = Math.max(counts.peak, counts.continuous, counts.slew);
        return { ...since(this.#limits.get(node), "held", held, now_ms), counts };
    }

    // True if the costs of single nodes are known.
    get hasCosts() {
        return this.#costs !== null;
    }

    // The wire of a port: its width in pixels, whether it carried NaN or infinity, and its text.
    wire(port) {
        const { rms = 0, peak = 0, loudest = 0 } = this.#ports.get(port) ?? {};
        const { what = "level", unit = "" } = this.#described.get(port) ?? {};
        const part = loudest > 0 ? rms / loudest : 0;
        const width = Math.round(QUIET_WIDTH + (MOST_WIDTH - QUIET_WIDTH) * Math.sqrt(part));
        const frames = this.#faults.get(port)?.frames ?? 0;
        const text = `${port}: ${what} ${quantity(rms, unit)} rms, ${quantity(peak, unit)} peak`;
        return { width, isFaulty: frames > 0, text: frames > 0 ? `${text}; NaN or infinity in ${frames} frames` : text };
    }

    // A node: its share of the cost (null if unknown or negligible), and its mark.
    node(path, now_ms) {
        const part = this.#costs?.[path] ?? 0;
        return { cost: part >= COST_FROM ? part : null, mark: this.#fault(path, now_ms) ?? this.#limit(path, now_ms) };
    }

    // The first of the node's outputs that was NaN or infinite.
    #fault(path, now_ms) {
        const isOfNode = (port) => port.startsWith(`${path}.`) && !port.slice(path.length + 1).includes("/");
        const found = [...this.#faults].find(([port]) => isOfNode(port));
        if (!found && this.#origin !== path) return null;
        const came = found ? `NaN or infinity in ${found[1].frames} frames of ${found[0]}` : "its outputs were NaN or infinite";
        const text = this.#origin === path ? `${came}; it was the first` : came;
        return { kind: "fault", isRecent: found !== undefined && now_ms - found[1].since_ms < RECENT_MS, text };
    }

    #limit(path, now_ms) {
        const limit = this.#limits.get(path);
        if (!limit || limit.held === 0) return null;
        const { counts } = limit;
        const parts = Object.entries(LIMITS).filter(([name]) => counts[name] > 0);
        const share = (ticks) => `${digits((100 * ticks) / Math.max(1, counts.ticks))} %`;
        const text = parts.map(([name, word]) => `${word} ${share(counts[name])}`).join(", ");
        return { kind: "limit", isRecent: now_ms - limit.since_ms < RECENT_MS, text: `limited: ${text} of its ticks` };
    }
}

// A count, and the time of its latest increase; the first value that is not 0 counts as an increase.
function since(before, name, count, now_ms) {
    const grew = before !== undefined && count > before[name];
    return { [name]: count, since_ms: grew || (before === undefined && count > 0) ? now_ms : (before?.since_ms ?? -Infinity) };
}
