// Descriptions of the pads of a graph.
import { digits } from "./numbers.js";

// The orientation of a pad that is not a tablet.
export function laidOn({ endpoint, is_laid, gives_n_per_mm }) {
    if (!is_laid) return null;
    return gives_n_per_mm === null ? `${endpoint}, from above` : `${endpoint}, from above; gives 1 mm at ${digits(gives_n_per_mm)} N`;
}

// The endpoints that the pointer moves, the inputs under Controls, and those that no page moves.
export function whatMoves(graph) {
    const pads = (graph?.pads ?? []).map(({ endpoint, channels }) => `The pointer is ${endpoint}: ${channels.join(", ")}.`);
    const inputs = (graph?.inputs ?? []).map(({ endpoint, channel }) => `${endpoint}.${channel}`);
    if (inputs.length) pads.push(`Controls moves ${inputs.join(", ")}.`);
    return [...pads, ...unmoved(graph)].join(" ");
}

// Endpoints that nobody moves from the page, one sentence each.
export function unmoved(graph) {
    const isReal = (endpoint) => graph.devices?.some(({ name, simulated }) => name === endpoint && !simulated);
    return (graph?.others ?? []).map((endpoint) =>
        isReal(endpoint) ? `${endpoint} is real: a hand moves it, not a pointer.` : `${endpoint} answers what the graph drives.`,
    );
}
