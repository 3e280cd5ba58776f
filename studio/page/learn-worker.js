// Learns one recording, beside the page and the engine, and ends: { wasm, path, bytes } comes, { learned } or { error } goes.
import { Module } from "./module.js";

const decoder = new TextDecoder();

self.onmessage = ({ data: { wasm, path, bytes } }) => {
    let module = null;
    try {
        module = new Module(wasm);
        self.postMessage({ learned: JSON.parse(decoder.decode(module.learn({ path, bytes }))) });
    } catch (error) {
        const why = error instanceof Uint8Array ? error : module?.panic;
        self.postMessage({ error: why?.length ? decoder.decode(why) : String(error) });
    }
    self.close();
};
