// Which signals a page shows of a graph before a person chooses, and which take the place of those that never move.
const SPECTRAL_FROM_HZ = 200;
const LEAST_CHANGE = 0.01; // part of the largest level by which a signal that moves differs
const FEWEST_SCOPES = 4; // from which on none is guessed
const MOST_SCOPES = 6;

// The signals that matter most, the most telling first: [{ name, why, isGuess }]; a guess is of no known
// use.
export function candidates({ maps, ports, actuators, pads, plots }) {
    const found = new Map();
    const take = (name, why, isGuess = false) => name && !found.has(name) && found.set(name, { name, why, isGuess });
    const [map] = maps;
    const channels = (names) => ports.filter(({ name }) => names.some((channel) => name.endsWith(`.${channel}`)));
    const given = new Set(pads.flatMap((pad) => pad.channels));
    take(map?.speed_port, "speed of the hand");
    take(map?.force_port, "force of the hand");
    take(feltPort(ports)?.name, "vibration");
    for (const actuator of actuators) take(drivenPort(ports, actuator)?.name, `delivered to ${actuator.name}`);
    for (const { name } of channels(["force", "true_load"].filter((channel) => given.has(channel))))
        take(name, "force of the hand");
    for (const { name } of map ? [] : ports.filter(({ name }) => name.endsWith(".speed"))) take(name, "speed of the hand");
    for (const { name } of channels(["position", "true_position"].filter((channel) => given.has(channel))))
        take(name, "place of the hand");
    for (const plot of plots)
        for (const { name } of plot.signals) if (ports.some((port) => port.name === name)) take(name, plot.name);
    for (const { name, quantity } of ports) if (quantity === "acceleration" || quantity === "speed") take(name, quantity, true);
    for (const { name } of ports.toReversed()) take(name, "an output", true);
    return [...found.values()];
}

const feltPort = (ports) => ports.findLast(({ quantity, rate_hz }) => quantity === "acceleration" && rate_hz > SPECTRAL_FROM_HZ);

export const drivenPort = (ports, { name }) => ports.find((port) => port.node === name);

// The scopes that a page begins with: [{ name, view }].
export function firstScopes(graph) {
    const { ports, actuators } = graph;
    const felt = feltPort(ports);
    const driven = actuators.map((actuator) => drivenPort(ports, actuator)).find(Boolean);
    const out = [];
    for (const { name, isGuess } of candidates(graph)) {
        if (isGuess && out.length >= FEWEST_SCOPES) break;
        out.push({ name, view: "time" });
        if (name === felt?.name) out.push({ name, view: "spectrum" });
        if (name === driven?.name) out.push({ name, view: "meter" });
        if (out.length >= MOST_SCOPES) break;
    }
    return out;
}

// Which scopes that the page chose show a signal that never moved, and what each shows instead, of the same quantity if
// there is such a one: [[place, name, isAlike]].
export function replacements(scopes, graph, moves) {
    const shown = new Set(scopes.map(({ name }) => name));
    const free = candidates(graph).filter(({ name }) => moves(name) && !shown.has(name));
    const quantityOf = (name) => graph.ports.find((port) => port.name === name)?.quantity;
    const alike = new Map(); // what took the place of a port
    const out = [];
    scopes.forEach(({ name, isAutomatic }, place) => {
        if (!isAutomatic || moves(name)) return;
        if (alike.has(name)) return out.push([place, alike.get(name), true]);
        if (free.length === 0) return;
        const at = free.findIndex((other) => quantityOf(other.name) === quantityOf(name));
        const [other] = free.splice(Math.max(0, at), 1);
        if (at >= 0) alike.set(name, other.name);
        out.push([place, other.name, at >= 0]);
    });
    return out;
}

// Which ports have moved since the graph began, from the messages `levels`: a constant has one level, RMS and peak alike.
export class Motion {
    #seen = new Map(); // by port: { least, most }

    restart() {
        this.#seen.clear();
    }

    take({ ports }) {
        for (const [name, [rms, peak]] of Object.entries(ports)) {
            const { least = rms, most = peak } = this.#seen.get(name) ?? {};
            this.#seen.set(name, { least: Math.min(least, rms), most: Math.max(most, peak) });
        }
    }

    moves(name) {
        const { least = 0, most = 0 } = this.#seen.get(name) ?? {};
        return most - least > LEAST_CHANGE * most;
    }
}
