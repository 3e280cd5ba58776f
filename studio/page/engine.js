// The engine in this page, where the site has one: its files, its place in the audio thread, and what it needs to begin.
const NAME = "haptograph-site";
const WELL_HEARD_HZ = 32_000; // a context of a lower rate is slow to answer

export class PageEngine {
    #site = null;

    // The engine of an exported page; null if a server runs it.
    static here() {
        const address = document.querySelector(`meta[name="${NAME}"]`)?.content;
        return address ? new PageEngine(new URL(address, location.href)) : null;
    }

    constructor(address) {
        this.address = address;
        this.context = this.node = null;
        this.onchange = () => {};
    }

    // The reason why no engine can run in this page, with a remedy; null if an engine can run.
    get obstacle() {
        if (!isSecureContext)
            return "Browsers run the engine of this page only where it comes by https or from this machine: open its https address, or serve it on this machine and open it at localhost.";
        if (!("audioWorklet" in AudioContext.prototype))
            return "This browser has no AudioWorklet, in which the engine of this page runs: open it in a current Chrome, Firefox or Safari.";
        return null;
    }

    // Browsers let sound begin only when a person presses something.
    get waits() {
        return this.context !== null && this.context.state !== "running";
    }

    start() {
        return this.context.resume();
    }

    // The graphs of the site.
    async graphs() {
        return (await this.#load()).graphs;
    }

    // A new engine for the graph in the address, or for the first graph.
    async open() {
        const { graphs, files, wasm } = await this.#load();
        const wanted = new URLSearchParams(location.search).get("graph");
        const { path, set, rate_hz } = graphs.find(({ name }) => name === wanted) ?? graphs[0];
        const opened = new TextEncoder().encode(JSON.stringify({ graph: path, set }));
        if (!this.context) await this.#openContext(rate_hz);
        this.node?.disconnect();
        const processorOptions = { wasm, files, opened };
        this.node = new AudioWorkletNode(this.context, "engine", {
            numberOfInputs: 0,
            outputChannelCount: [2],
            processorOptions,
        });
        // A node that is not connected does not run.
        const silent = new GainNode(this.context, { gain: 0 });
        this.node.connect(silent).connect(this.context.destination);
        const { port1, port2 } = new MessageChannel();
        this.node.port.postMessage({ link: port1 }, [port1]);
        return { port: port2, wasm, files, opened };
    }

    async #openContext(rate_hz) {
        const sampleRate = rate_hz >= WELL_HEARD_HZ ? rate_hz : undefined;
        this.context = new AudioContext({ sampleRate, latencyHint: "interactive" });
        this.context.onstatechange = () => this.onchange();
        await this.context.audioWorklet.addModule(new URL("engine-worklet.js", import.meta.url));
    }

    #load() {
        this.#site ??= this.#fetch().catch((error) => {
            this.#site = null; // the next time it may be there
            throw error;
        });
        return this.#site;
    }

    async #fetch() {
        const get = async (path) => {
            const response = await fetch(new URL(path, this.address));
            if (!response.ok) throw new Error(`${path}: ${response.status} ${response.statusText}`);
            return response;
        };
        const bytes = async (path) => new Uint8Array(await (await get(path)).arrayBuffer());
        const site = await (await get(this.address)).json();
        const encoder = new TextEncoder();
        const files = site.files.map(async (path) => ({
            path: encoder.encode(path),
            bytes: await bytes(`files/${path.split("/").map(encodeURIComponent).join("/")}`),
        }));
        return { graphs: site.graphs, files: await Promise.all(files), wasm: await bytes(site.engine) };
    }
}
