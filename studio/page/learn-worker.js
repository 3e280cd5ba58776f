// Learns one recording in a worker of its own, and ends: receives { wasm, recording, reads, listens },
// sends { learned } or { error }.
import { Module } from "./module.js";

const decoder = new TextDecoder();

self.onmessage = ({ data: { wasm, recording, reads, listens } }) => {
    let module = null;
    try {
        module = new Module(wasm);
        self.postMessage({ learned: JSON.parse(decoder.decode(listens ? module.listen(recording, listens) : module.learn(recording, reads))) });
    } catch (error) {
        const why = error instanceof Uint8Array ? error : module?.panic;
        self.postMessage({ error: why?.length ? decoder.decode(why) : String(error) });
    }
    self.close();
};
