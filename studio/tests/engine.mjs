// The engine as WebAssembly, without a browser: node engine.mjs SITE TRANSCRIPT [GRAPH...]
// SITE is an exported folder, TRANSCRIPT the native program of the same calls (cargo build --release -p haptograph-wasm
// --example transcript); each graph of the site has to give the native samples. GRAPH names others than all.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { Module } from "../page/module.js";
import { pointers } from "../page/frames.js";

const [site, transcript, ...chosen] = process.argv.slice(2);
assert(transcript, "give the site's folder and the program");
const BLOCK = 128; // frames that an audio thread asks for
const SECONDS = 4;
const MOST_APART = 1e-9; // of the largest sample
const encoder = new TextEncoder();
const { graphs, engine } = JSON.parse(readFileSync(join(site, "site.json"), "utf8"));
const wasm = readFileSync(join(site, engine));
assert.deepEqual(WebAssembly.Module.imports(new WebAssembly.Module(wasm)), [], "the module imports something");

function open({ path, set, files, beside }) {
    const module = new Module(wasm);
    for (const file of [...files, ...beside]) module.put({ path: encoder.encode(file), bytes: readFileSync(join(site, "files", file)) });
    try {
        module.open(encoder.encode(JSON.stringify({ file: path, set })));
    } catch (why) {
        throw new Error(why instanceof Uint8Array ? new TextDecoder().decode(why) : `${why}`);
    }
    return module;
}

// What a hand does and an audio thread asks for: circles with a swelling force, a turn of a setting, a lift, a stroke again.
function* calls(rate_hz) {
    for (let frame = 0; frame < SECONDS * rate_hz; frame += BLOCK) {
        const time_s = frame / rate_hz;
        const angle = 12 * time_s;
        const lifted = time_s > 2 && time_s < 2.5;
        const sample = {
            time_ms: time_s * 1000,
            x_mm: 30 * Math.cos(angle),
            y_mm: 20 * Math.sin(angle),
            force_n: lifted ? 0 : 1 + 0.5 * Math.sin(3 * time_s),
            tilt_x_deg: 0,
            tilt_y_deg: 0,
        };
        yield { bytes: new Uint8Array(pointers(0, [sample])), text: false };
        yield { frames: BLOCK };
    }
}

// As the native program reads them.
function written(all) {
    const parts = all.map(({ frames, bytes, text }) => {
        const head = Buffer.alloc(8);
        head.writeUInt32LE(bytes ? (text ? 2 : 1) : 0, 0);
        head.writeUInt32LE(bytes ? bytes.length : frames, 4);
        return bytes ? Buffer.concat([head, bytes]) : head;
    });
    return Buffer.concat(parts);
}

function played(module, all) {
    const samples = [];
    for (const call of all) {
        if (call.bytes) module.hear(call);
        else {
            samples.push(...module.process(call.frames));
            module.publish(10, 0);
            for (const _ of module.messages());
        }
    }
    return samples;
}

let failed = 0;
for (const graph of graphs.filter(({ name }) => chosen.length === 0 || chosen.includes(name))) {
    try {
        const module = open(graph);
        const all = [...calls(module.driver_hz)];
        const begun_ms = performance.now();
        const here = played(module, all.slice(0, all.length / 2));
        const memory_bytes = module.memory_bytes;
        here.push(...played(module, all.slice(all.length / 2)));
        const took_s = (performance.now() - begun_ms) / 1000;
        assert.equal(module.memory_bytes, memory_bytes, "the memory grows while it runs");
        const native = spawnSync(transcript, [join(site, "files", graph.path)], { input: written(all), maxBuffer: 2 ** 30 });
        assert.equal(native.status, 0, String(native.stderr));
        const there = new Float64Array(
            native.stdout.buffer.slice(native.stdout.byteOffset, native.stdout.byteOffset + native.stdout.length),
        );
        assert.equal(here.length, there.length, "as many samples");
        let largest = 0,
            apart = 0,
            same = 0;
        for (let i = 0; i < there.length; i++) {
            largest = Math.max(largest, Math.abs(there[i]));
            apart = Math.max(apart, Math.abs(here[i] - there[i]));
            same += here[i] === there[i];
        }
        assert(module.sound_hz === 0 || there.length > 0, "nothing was played");
        assert(apart <= MOST_APART * Math.max(largest, Number.MIN_VALUE), `apart by ${apart}, the largest is ${largest}`);
        const part = there.length ? ((100 * same) / there.length).toFixed(1) : "-";
        console.log(
            `ok      ${graph.name}: ${there.length} samples up to ${largest.toFixed(3)}, apart by ${(apart / (largest || 1)).toExponential(1)} of that, ${part} % the same bits; ${(SECONDS / took_s).toFixed(0)} times as fast as needed`,
        );
    } catch (error) {
        failed++;
        console.log(`FAILED  ${graph.name}: ${error.message}`);
    }
}

// In the audio thread: what is heard falls to silence before an edit is loaded, rises after it, and is what it was elsewhere.
async function assertEditIsSoft({ path, set, files }) {
    const QUANTUM = 128;
    let Engine;
    class AudioWorkletProcessor {
        port = { postMessage() {} };
    }
    Object.assign(globalThis, { AudioWorkletProcessor, registerProcessor: (_, kind) => (Engine = kind), sampleRate: 48000 });
    await import("../page/engine-worklet.js");
    const run = (edited) => {
        const all = files.map((file) => ({ path: encoder.encode(file), bytes: readFileSync(join(site, "files", file)) }));
        const engine = new Engine({
            processorOptions: { wasm, files: all, opened: encoder.encode(JSON.stringify({ file: path, set })) },
        });
        const link = { replies: 0, postMessage: ({ bytes, text }) => (link.replies += text && /"type":"reply"/.test(decode(bytes))) };
        engine.join(link, 0);
        const heard = [];
        const sent = [...calls(engine.module.driver_hz)].filter(({ bytes }) => bytes);
        for (let quantum = 0; quantum < 500; quantum++) {
            if (quantum % 3 === 0) link.onmessage({ data: sent[quantum] });
            if (quantum === 250 && edited) {
                const text = `// again\n${readFileSync(join(site, "files", path), "utf8")}`;
                const message = encoder.encode(JSON.stringify({ type: "apply", request: 1, text }));
                link.onmessage({ data: { bytes: message, text: true, edits: true } });
            }
            const out = new Float32Array(QUANTUM);
            assert(engine.process([], [[out]]), "the engine ended");
            heard.push(...out);
        }
        assert.equal(link.replies, edited ? 1 : 0);
        return heard;
    };
    const [plain, edited] = [run(false), run(true)];
    const first = edited.findIndex((value, i) => value !== plain[i]);
    const last = edited.findLastIndex((value, i) => value !== plain[i]);
    assert(first >= 250 * QUANTUM && last - first < 0.03 * 48000, `it differs from ${first} to ${last}`);
    const part = edited.slice(first, last + 1).map((value, i) => (plain[first + i] === 0 ? 0 : value / plain[first + i]));
    assert(part.every((gain, i) => gain >= 0 && Math.abs(gain - (i ? part[i - 1] : 1)) < 0.01 || plain[first + i] === 0), "a step");
    const lowest = part.findLastIndex((gain, i) => gain === 0 && plain[first + i] !== 0);
    assert(lowest >= 0, "it was never silent");
    console.log(`ok      an edit is soft: ${(((last - first) / 48000) * 1000).toFixed(1)} ms from sound to sound, less the loading`);
}

const decode = (bytes) => new TextDecoder().decode(bytes);
await assertEditIsSoft(graphs.find(({ name }) => name === "texturepad") ?? graphs[0]);
process.exit(failed ? 1 : 0);
