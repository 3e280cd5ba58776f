// From a pointer's arrival at the engine to the first sample that it changes, in the time of the run: node latency.mjs SITE [GRAPH]
// Each of many strokes is run twice; the second time one pointer presses harder. What a machine adds is not in it: how long
// an event takes to arrive, and how late the engine is against the clock.
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { pointers } from "../page/frames.js";
import { Module } from "../page/module.js";

const [site, name] = process.argv.slice(2);
const { graphs, engine } = JSON.parse(readFileSync(join(site, "site.json"), "utf8"));
const graph = graphs.find((known) => known.name === name) ?? graphs[0];
const encoder = new TextEncoder();
const wasm = readFileSync(join(site, engine));
const contents = graph.files.map((file) => ({ path: encoder.encode(file), bytes: readFileSync(join(site, "files", file)) }));
const BLOCK = 128;
const SETTLED_S = 1; // of even strokes, after which the engine knows how they come
const PROBES = 20;

function stroke(changed, interval_ms) {
    const module = new Module(wasm);
    for (const file of contents) module.put(file);
    module.open(encoder.encode(JSON.stringify({ file: graph.path, set: graph.set })));
    const rate_hz = module.driver_hz;
    const samples = [];
    let arrived = null; // samples that had been played when the changed pointer came
    for (let k = 0, frame = 0; frame < (SETTLED_S + 0.5) * rate_hz; frame += BLOCK) {
        const now_ms = (1000 * frame) / rate_hz;
        for (; k * interval_ms <= now_ms; k++) {
            const time_ms = k * interval_ms;
            const angle = time_ms / 120;
            if (k === changed) arrived = samples.length;
            const force_n = k === changed ? 1.5 : 1;
            const sample = {
                time_ms,
                x_mm: 30 * Math.cos(angle),
                y_mm: 30 * Math.sin(angle),
                force_n,
                tilt_x_deg: 0,
                tilt_y_deg: 0,
            };
            module.hear({ bytes: new Uint8Array(pointers(0, [sample])), text: false });
        }
        samples.push(...module.process(BLOCK));
        module.publish(10, 0);
        for (const _ of module.messages());
    }
    return { samples, arrived, sound_hz: module.sound_hz };
}

for (const interval_ms of [4, 8, 16]) {
    const plain = stroke(-1, interval_ms);
    const took_ms = [];
    for (let probe = 0; probe < PROBES; probe++) {
        const { samples, arrived, sound_hz } = stroke(Math.floor((1000 * SETTLED_S) / interval_ms) + probe, interval_ms);
        const first = samples.findIndex((value, i) => value !== plain.samples[i]);
        if (first >= 0) took_ms.push((1000 * (first - arrived)) / sound_hz);
    }
    took_ms.sort((a, b) => a - b);
    const [least, middle, most] = [took_ms[0], took_ms[took_ms.length >> 1], took_ms.at(-1)].map((ms) => ms?.toFixed(1));
    console.log(
        `${graph.name}, pointers every ${interval_ms} ms: first changed sample after ${middle} ms (${least} to ${most}, ${took_ms.length} pointers)`,
    );
}
