// A long session on the page, measured: LAST_S=600 node session.mjs WHERE; WHERE is the address that a running server printed
// or a site's folder. A pen strokes all the time with six scopes open and the sound on; every ten seconds it is lifted for one.
// Nothing is judged but that every gap in the samples is one that the page counts.
import { readdirSync, readFileSync } from "node:fs";
import assert from "node:assert/strict";
import { browser, feltPort, open, pen, problems, served, until } from "./harness.mjs";

const LAST_S = Number(process.env.LAST_S ?? 600);
const SCOPES = 6;
const TURN_S = 11; // ten of a stroke, one without
const STEP_MS = 8;
const TICKS_A_SECOND = 100; // of /proc

// Processor time of all processes whose name begins so, s.
function processor_s(name) {
    let ticks = 0;
    for (const entry of readdirSync("/proc").filter((known) => /^\d+$/.test(known))) {
        try {
            const stat = readFileSync(`/proc/${entry}/stat`, "utf8");
            const [, comm, rest] = stat.match(/\((.*)\) (.*)/);
            const fields = rest.split(" ");
            if (comm.startsWith(name)) ticks += Number(fields[11]) + Number(fields[12]);
        } catch {} // it has ended
    }
    return ticks / TICKS_A_SECOND;
}

const resident_mb = (name) =>
    readdirSync("/proc")
        .filter((known) => /^\d+$/.test(known))
        .reduce((sum, entry) => {
            try {
                const text = readFileSync(`/proc/${entry}/status`, "utf8");
                return text.startsWith(`Name:\t${name}`) ? sum + Number(text.match(/VmRSS:\s+(\d+)/)?.[1] ?? 0) / 1024 : sum;
            } catch {
                return sum;
            }
        }, 0);

const page = await open();
await page.evaluate(() => studio.own());
await until(page, () => studio.status.owner);
await page.evaluate((count) => {
    const fastest = studio.graph.ports.toSorted((a, b) => b.rate_hz - a.rate_hz);
    for (const { name } of fastest) if (studio.scopeCount() < count) studio.addScope(name, "time");
    for (let k = 0; studio.scopeCount() < count; k++) studio.addScope(fastest[k].name, "spectrum");
}, SCOPES);
await page.click("#sound");
await until(page, () => studio.sound.on);
await page.evaluate((port) => {
    const trace = studio.taps.watch(port, true);
    const kept = { frames: 0, perSecond: [], gaps: [], heard_s: [], heap_mb: [], behind_ms: 0, costs: [], pointers_ms: [] };
    let next_s = null;
    studio.connection.on("samples", ({ place, time_s, interval_s, values }) => {
        if (place !== studio.taps.traces.indexOf(trace)) return;
        if (next_s !== null && Math.abs(time_s - next_s) > interval_s / 2) kept.gaps.push({ time_s, missing_s: time_s - next_s });
        next_s = time_s + values.length * interval_s;
    });
    studio.connection.on("status", ({ behind_ms, cost, pointer }) => {
        if (pointer.count) kept.pointers_ms.push(pointer.p50_ms);
        kept.behind_ms = Math.max(kept.behind_ms, behind_ms);
        kept.costs.push(cost);
    });
    const count = () => (kept.frames++, requestAnimationFrame(count));
    count();
    let before = 0;
    setInterval(() => {
        kept.perSecond.push(kept.frames - before);
        before = kept.frames;
        kept.heap_mb.push(performance.memory.usedJSHeapSize / 2 ** 20);
        while (kept.heard_s.length < studio.sound.report.underruns) kept.heard_s.push(kept.perSecond.length);
    }, 1000);
    window.session = kept;
}, await feltPort(page));

const hand = await pen(page);
const names = ["chrom", "haptograph"];
const before_s = names.map(processor_s);
const begun_ms = performance.now();
let pressed = false;
for (let elapsed_s = 0; elapsed_s < LAST_S; elapsed_s = (performance.now() - begun_ms) / 1000) {
    const down = elapsed_s % TURN_S < TURN_S - 1;
    const angle = elapsed_s / 0.15;
    const at = [0.5 + 0.2 * Math.cos(angle), 0.5 + 0.25 * Math.sin(angle)];
    if (down && !pressed) await hand.press(...at, 0.4);
    else if (down) await hand.move(...at, 0.4 + 0.2 * Math.sin(elapsed_s));
    else if (pressed) await hand.lift(...at);
    pressed = down;
    await new Promise((done) => setTimeout(done, STEP_MS));
}
const took_s = (performance.now() - begun_ms) / 1000;
const share = names.map((name, i) => (processor_s(name) - before_s[i]) / took_s);
const { kept, status, report, latency_s, graph } = await page.evaluate(() => ({
    kept: window.session,
    status: studio.status,
    report: studio.sound.report,
    latency_s: studio.sound.latency_s,
    graph: studio.graph.name,
}));
const rates = kept.perSecond.toSorted((a, b) => a - b);
const at = (values, part) => values[Math.min(values.length - 1, Math.floor(part * values.length))];
console.log(`${graph}, ${took_s.toFixed(0)} s, ${SCOPES} scopes of ports at up to 48 kHz`);
console.log(`frames a second: median ${at(rates, 0.5)}, 5th percentile ${at(rates, 0.05)}, least ${rates[0]}`);
console.log(`processor: browser ${(100 * share[0]).toFixed(0)} % of a core, server ${(100 * share[1]).toFixed(1)} %, the engine by itself ${((100 * kept.costs.reduce((sum, cost) => sum + cost, 0)) / kept.costs.length).toFixed(1)} %`);
const missing_s = kept.gaps.reduce((sum, gap) => sum + gap.missing_s, 0);
console.log(`samples: ${kept.gaps.length} gaps, ${missing_s.toFixed(3)} s together; the page counts ${status.lost} lost messages, ${status.late} late wake-ups, at most ${kept.behind_ms.toFixed(1)} ms behind`);
console.log(`sound: ${kept.heard_s.length ? `gaps at ${kept.heard_s.join(", ")} s` : "no gap"}; ${JSON.stringify(report)}, ${(1000 * latency_s).toFixed(1)} ms to the browser's output`);
const late_ms = kept.pointers_ms.toSorted((a, b) => a - b);
console.log(`a pointer's arrival to its tick, medians of statuses, ms: median ${at(late_ms, 0.5)?.toFixed(1)}, 95th percentile ${at(late_ms, 0.95)?.toFixed(1)}`);
const heap = kept.heap_mb;
const least = (from, to) => Math.min(...heap.slice(Math.floor(from * heap.length), Math.ceil(to * heap.length)));
console.log(`memory: page's scripts ${least(0, 0.2).toFixed(1)} MB least in the first fifth, ${least(0.8, 1).toFixed(1)} MB in the last; server ${resident_mb("haptograph").toFixed(0)} MB`);
console.log(`problems: ${problems.length ? problems.join("\n") : "none"}`);
await browser.close();
served?.close();
assert(kept.gaps.length === 0 || status.lost > 0, "samples are missing that the page does not count");
assert.equal(problems.length, 0);
