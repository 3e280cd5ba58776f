// Descriptions of the pads of a graph.
import { digits } from "./numbers.js";

// The orientation of a pad that is not a tablet.
export function laidOn({ endpoint, is_laid, gives_n_per_mm }) {
    if (!is_laid) return null;
    return gives_n_per_mm === null ? `${endpoint}, from above` : `${endpoint}, from above; gives 1 mm at ${digits(gives_n_per_mm)} N`;
}

// The endpoints that the pointer moves, and the simulated ones.
export function whatMoves(graph) {
    const pads = (graph?.pads ?? []).map(({ endpoint, channels }) => `The pointer is ${endpoint}: ${channels.join(", ")}.`);
    return [...pads, ...simulatedAlone(graph)].join(" ");
}

// Endpoints that no pointer can be, one sentence each.
export function simulatedAlone(graph) {
    const isReal = (endpoint) => graph.devices?.some(({ name, simulated }) => name === endpoint && !simulated);
    return (graph?.others ?? []).map(({ endpoint, lacks }) => {
        if (isReal(endpoint)) return `${endpoint} is real: a hand moves it, not a pointer.`;
        const why = lacks.length ? `a pad gives no ${lacks.join(", ")}` : "what it touches is not known";
        return `${endpoint} stays simulated: ${why}.`;
    });
}
