// The engine in this page, where the site has one: its files, its place in the audio thread, and what it needs to begin.
import { StudyStore } from "./study-store.js";

const NAME = "haptograph-site";
const KEEPS_AGAIN_MS = 2000;
const WELL_HEARD_HZ = 32_000; // a context of a lower rate is slow to answer

export class PageEngine {
    #site = null;
    #keeping = Promise.resolve();

    // The engine of an exported page; null if a server runs it.
    static here() {
        const address = document.querySelector(`meta[name="${NAME}"]`)?.content;
        return address ? new PageEngine(new URL(address, location.href)) : null;
    }

    constructor(address) {
        this.address = address;
        this.context = this.node = null;
        this.store = null; // of a study's data
        this.onchange = () => {};
        this.onfailure = () => {}; // gets the reason why data could not be kept
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

    // A new engine for the graph in the address, or for the first graph.
    async open() {
        const { study, shown, shipped, wasm, later } = await this.#load();
        const { path, set, rate_hz } = shown;
        if (study) this.store ??= await StudyStore.open(this.address.pathname);
        const encoder = new TextEncoder();
        await this.#keeping; // what is being written is read
        const kept = await this.kept();
        const files = shipped.concat(kept.map(({ path, bytes }) => ({ path: encoder.encode(path), bytes })));
        const opened = encoder.encode(JSON.stringify({ file: path, set }));
        if (!this.context) await this.#openContext(rate_hz);
        this.node?.disconnect();
        this.number = crypto.randomUUID();
        const processorOptions = { wasm, files, opened, study: Boolean(study) };
        this.node = new AudioWorkletNode(this.context, "engine", {
            numberOfInputs: 0,
            outputChannelCount: [2],
            processorOptions,
        });
        // A node that is not connected does not run.
        const silent = new GainNode(this.context, { gain: 0 });
        this.node.connect(silent).connect(this.context.destination);
        if (this.store) this.node.port.onmessage = ({ data }) => data.keep && this.#keep(data);
        const port = this.#linked(0);
        return study ? { port } : { port, wasm, files, opened, later };
    }

    // The files of a study's data.
    async kept() {
        return (await this.store?.files()) ?? [];
    }

    // A port for the page of a study's participant.
    letIn() {
        return this.#linked(1);
    }

    letOut() {
        this.node?.port.postMessage({ leaves: true });
    }

    #linked(page) {
        const { port1, port2 } = new MessageChannel();
        this.node.port.postMessage({ link: port1, page }, [port1]);
        return port2;
    }

    // In their order. What could not be kept is tried again: the participant waits meanwhile.
    #keep(asked) {
        this.#keeping = this.#keeping.then(() => this.#keepNext(asked));
    }

    async #keepNext({ keep, changes }) {
        const decoder = new TextDecoder();
        const files = changes.map(({ path, bytes }) => ({ path: decoder.decode(path), bytes }));
        const { node } = this;
        for (;;) {
            try {
                await this.store.keep(files);
                return node.port.postMessage({ kept: keep });
            } catch (error) {
                this.onfailure(error.message);
                await new Promise((done) => setTimeout(done, KEEPS_AGAIN_MS));
            }
        }
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
        const { graphs, study, engine, whole } = await (await get(this.address)).json();
        const wanted = new URLSearchParams(location.search).get("graph");
        // Of the others nothing is loaded.
        const shown = study ?? graphs.find(({ name }) => name === wanted) ?? graphs[0];
        // A preset in the address may name any.
        if (location.hash.length > 1) shown.files.push(...(shown.beside?.splice(0) ?? []));
        const encoder = new TextEncoder();
        const placeOf = (path) => `files/${path.split("/").map(encodeURIComponent).join("/")}`;
        const shipped = shown.files.map(async (path) => ({ path: encoder.encode(path), bytes: await bytes(placeOf(path)) }));
        // What can wait until somebody wants it: further surfaces, and the module that learns.
        const later = {
            whole: new URL(whole, this.address).href,
            surfaces: (shown.beside ?? []).map((path) => new URL(placeOf(path), this.address).href),
        };
        const [wasm, ...read] = await Promise.all([bytes(engine), ...shipped]);
        return { study, shown, shipped: read, wasm, later };
    }
}
