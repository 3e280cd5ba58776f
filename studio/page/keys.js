// The keys of a graph file and of its clocks, except those of the kinds of nodes: docs/format.md.
export const GRAPH = {
    format: "The version of the format: 1.",
    about: "What the graph is, in a sentence.",
    seed: "The seed of all random numbers: the same seed, the same samples.",
    parameters: "Values by name that can be set from outside: `Param(\"name\")` reads one.",
    defaults: "Other defaults of parameters, by set of endpoints.",
    include: "Files of templates, relative to this one, or of the library: \"std/texture.ron\".",
    clocks: "The rates at which nodes tick, by name: `Driver(rate_hz: …)` or `Derived(of: …, rate_hz: …)`.",
    nodes: "The nodes by name: `\"name\": Kind(setting: value, input: \"other.output\")`.",
    endpoints: "What the devices are, by set: \"simulated\" unless another is asked for.",
    templates: "Named nodes that can be used as one node.",
};

export const DRIVER = {
    rate_hz: "Ticks a second, Hz: 48000, 59.94 or (1000, 3) for a third of a kilohertz.",
};

export const DERIVED = {
    of: "The clock that it is derived from.",
    rate_hz: "Ticks a second, Hz: an exact ratio of the other clock's.",
};
