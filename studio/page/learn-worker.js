// Learns one recording, or exports sound, in a worker of its own, and ends: receives { wasm, recording, reads, listens, exports },
// sends { learned } or { error }.
import { Module } from "./module.js";

const decoder = new TextDecoder();

self.onmessage = ({ data: { wasm, recording, reads, listens, exports } }) => {
    let module = null;
    try {
        module = new Module(wasm);
        const answer = () => (listens ? module.listen(recording, listens) : module.learn(recording, reads));
        self.postMessage({ learned: JSON.parse(decoder.decode(exports ? module.export(exports) : answer())) });
    } catch (error) {
        const why = error instanceof Uint8Array ? error : module?.panic;
        self.postMessage({ error: why?.length ? decoder.decode(why) : String(error) });
    }
    self.close();
};
