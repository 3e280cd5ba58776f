// What the scenarios of the page share: a Chromium, pages in it, hands on the pad, and studios of their own for what changes
// files or drives a device.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { cpSync, existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";
import { serve } from "./serve.mjs";

const [where, folder] = process.argv.slice(2);
assert(where, "give the address that the studio printed, or a site's folder");
export const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
export const served = where.startsWith("http") ? null : await serve(where);
// Of the studio; a site's own is that of its gallery.
export const address = served ? `${served.address}studio.html` : where;
if (folder) mkdirSync(folder, { recursive: true });
// The repository, and the program that was built in it.
export const HOME = process.env.HAPTOGRAPH_HOME ?? fileURLToPath(new URL("../..", import.meta.url));
export const PROGRAM = process.env.HAPTOGRAPH ?? join(HOME, "target/release/haptograph");
// A name that leads here but is not this machine to a browser.
export const FAR_NAME = "studio.test";
export const browser = await chromium.launch({
    executablePath: process.env.CHROMIUM ?? ["/usr/bin/chromium-headless-shell", "/usr/bin/chromium"].find(existsSync),
    args: ["--autoplay-policy=no-user-gesture-required", `--host-resolver-rules=MAP ${FAR_NAME} 127.0.0.1`],
});
const LEAST_MOVES = 50;
export const PATIENCE_MS = 15_000;
export const problems = [];
const AS_WIDE = { viewport: { width: 1440, height: 900 } };
export const AS_PHONE = { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true, deviceScaleFactor: 2 };

// A page at `at`, where the scenario does not go on to say otherwise once the engine has spoken. What `expected` matches is
// no problem.
export async function open({ at = address, expected = null, isReady = ready, ...options } = {}) {
    const context = await browser.newContext({ ...AS_WIDE, ...options });
    const page = await context.newPage();
    const problem = (text) => expected?.test(text) || problems.push(text);
    page.on("console", (message) => ["error", "warning"].includes(message.type()) && problem(message.text()));
    page.on("pageerror", (error) => problem(error.stack || error.message));
    page.on(
        "request",
        (request) =>
            new URL(request.url()).host === new URL(at).host ||
            !/^(http|ws)/.test(request.url()) ||
            problem(`a request left the origin: ${request.url()}`),
    );
    await page.goto(at);
    await isReady(page).catch((error) => {
        throw new Error([error.message, ...problems].join("\n"));
    });
    return page;
}

export async function ready(page) {
    await page.waitForFunction(() => window.studio?.hello && studio.graph && studio.status, null, { timeout: PATIENCE_MS });
    // A site loads it when its tab is shown.
    await page.evaluate(() => studio.loadEditor?.().then(() => null));
}

// Waits until `look` is true in the page.
export const until = (page, look, given = null, timeout = PATIENCE_MS) => page.waitForFunction(look, given, { timeout });

export const picture = async (page, name) => folder && page.screenshot({ path: `${folder}/${name}.png` });

export const tests = [];
export const test = (name, run, lane = "page") => tests.push([name, run, lane]);
// Of a page that shares its engine with others.
export const serverTest = (name, run) => served || test(name, run);
export const siteTest = (name, run) => served && test(name, run);
// Of a studio that the scenario opens itself. One that measures no time runs beside the others.
export const besideTest = (name, run) => programTest(name, run, "beside");
export const programTest = (name, run, lane = "own") => {
    if (served) return;
    if (existsSync(PROGRAM)) test(name, run, lane);
    else console.log(`skipped ${name}: there is no ${PROGRAM}`);
};

// A studio of `graph` in a folder of its own with a copy of the graphs; `files` are further texts by path. `end` ends it. With
// another `command` what that serves, at so many addresses.
export async function studioOf(graph, { files = {}, more = [], command = ["studio"], count = 1, root = null } = {}) {
    root ??= mkdtempSync(join(tmpdir(), "haptograph-studio-"));
    cpSync(join(HOME, "graphs"), join(root, "graphs"), { recursive: true });
    for (const [path, text] of Object.entries(files)) writeFileSync(join(root, path), text);
    const program = spawn(PROGRAM, [...command, graph, "--no-open", ...more], { cwd: root, stdio: ["ignore", "pipe", "pipe"] });
    let said = "";
    const addresses = await new Promise((done, failed) => {
        const take = (bytes) => {
            said += bytes;
            const found = said.match(/http:\/\/\S+/g) ?? [];
            if (found.length >= count + (more.some((option) => option.startsWith("--lan")) ? 1 : 0)) done(found);
        };
        program.stdout.on("data", take);
        program.stderr.on("data", take);
        program.on("exit", () => failed(new Error(`the studio ended: ${said}`)));
    });
    const end = (signal = "SIGINT", keeps = false) =>
        new Promise((done) => {
            program.removeAllListeners("exit");
            program.on("exit", () => (keeps || rmSync(root, { recursive: true, force: true }), done()));
            program.kill(signal);
        });
    return { root, address: addresses[0], addresses, end };
}

// A pen by DevTools' own input events, so that pressure, tilt ({ tiltX, tiltY } in degrees) and kind arrive as from a tablet.
export async function pen(page) {
    const session = await page.context().newCDPSession(page);
    const send = (type, x, y, force, tilt = {}) =>
        session.send("Input.dispatchMouseEvent", {
            type,
            x,
            y,
            force,
            ...tilt,
            button: type === "mouseMoved" ? "none" : "left",
            buttons: type === "mouseReleased" ? 0 : 1,
            clickCount: 1,
            pointerType: "pen",
        });
    const at = await padPlace(page);
    return {
        press: (x, y, force, tilt) => send("mousePressed", ...at(x, y), force, tilt),
        move: (x, y, force, tilt) => send("mouseMoved", ...at(x, y), force, tilt),
        lift: (x, y) => send("mouseReleased", ...at(x, y), 0),
    };
}

// A finger on a page that was opened with `hasTouch`.
export async function finger(page) {
    const session = await page.context().newCDPSession(page);
    const at = await padPlace(page);
    const send = (type, ...points) =>
        session.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([x, y]) => ({ x, y })) });
    return {
        press: (x, y) => send("touchStart", at(x, y)),
        move: (x, y) => send("touchMove", at(x, y)),
        lift: () => send("touchEnd"),
    };
}

// Several fingers at once; each of `places` is where one is, by its number. Without any all are lifted.
export async function fingers(page) {
    const session = await page.context().newCDPSession(page);
    const at = await padPlace(page);
    let count = 0;
    return async (places) => {
        const points = Object.entries(places).map(([id, [x, y]]) => {
            const [left, top] = at(x, y);
            return { x: left, y: top, id: Number(id) };
        });
        const type = points.length === 0 ? "touchEnd" : points.length > count ? "touchStart" : "touchMove";
        count = points.length;
        await session.send("Input.dispatchTouchEvent", { type, touchPoints: points });
    };
}

// From parts of the surface's picture to places on the page.
async function padPlace(page) {
    const box = await page.locator("#pad-swatch").boundingBox();
    return (x, y) => [box.x + x * box.width, box.y + y * box.height];
}

// Circles on the pad for at least `time_ms` and `LEAST_MOVES`, calling `look` on the way.
export async function stroke(page, force, time_ms, look = () => {}, hand = null) {
    hand ??= await pen(page);
    await hand.press(0.7, 0.5, force);
    const start_ms = performance.now();
    for (let moves = 0, part = 0; part < 1; moves++) {
        const elapsed_ms = performance.now() - start_ms;
        part = Math.min(elapsed_ms / time_ms, moves / LEAST_MOVES);
        const angle = elapsed_ms / 150;
        await hand.move(0.5 + 0.2 * Math.cos(angle), 0.5 + 0.25 * Math.sin(angle), force);
        await look(part);
    }
    await hand.lift(0.5, 0.5);
}

export const latest = (page, name, lane = 0) =>
    page.evaluate(
        ([port, of]) => studio.taps.traces.find((trace) => trace.name === port)?.latest(of) ?? null,
        [name, lane],
    );
export const level = (page, name, span_s) =>
    page.evaluate(
        ([port, span]) => studio.taps.traces.find((trace) => trace.name === port)?.level(span).rms ?? null,
        [name, span_s],
    );

// The port of what is felt.
export const feltPort = (page) =>
    page.evaluate(
        () => studio.graph.ports.findLast(({ quantity, rate_hz }) => quantity === "acceleration" && rate_hz > 1000)?.name,
    );

// Switches the simulated hand.
export async function demo(page, on) {
    if ((await page.getAttribute("#demo", "aria-pressed")) !== String(on)) await page.click("#demo");
    await until(page, (wanted) => studio.pad.hands.down.length > 0 === wanted, on);
}

// Drops a file on the page, as a person does from the desktop.
export async function drop(page, name, type, text) {
    const transfer = await page.evaluateHandle(
        ([fileName, kind, content]) => {
            const data = new DataTransfer();
            data.items.add(new File([content], fileName, { type: kind }));
            return data;
        },
        [name, type, text],
    );
    await page.dispatchEvent("body", "dragenter", { dataTransfer: transfer });
    assert(await page.isVisible("#drop"), "nothing says that a file can be dropped");
    await page.dispatchEvent("body", "drop", { dataTransfer: transfer });
    assert.equal(await page.isVisible("#drop"), false);
}

// Keeps every sample of a port: of the run that goes on, and of the one before in `studio.lastRun`, as { first, values }
// with the number of its first frame; up to where a page that could not keep up lost some.
export const gather = (page, port) =>
    page.evaluate((name) => {
        const trace = studio.taps.watch(name, true);
        let run = { first: 0, values: [] };
        studio.lastRun = null;
        studio.connection.on("graph", () => {
            if (run.values.length) studio.lastRun = run;
            run = { first: 0, values: [] };
        });
        studio.connection.on("samples", ({ place, time_s, interval_s, values }) => {
            if (place !== studio.taps.traces.indexOf(trace)) return;
            const frame = Math.round(time_s / interval_s);
            if (run.values.length === 0) run.first = frame;
            run.hasGap ||= frame !== run.first + run.values.length;
            if (!run.hasGap) for (const value of values) run.values.push(value);
        });
    }, port);

// Strokes and records that; { recording, run }, the latter as `gather` keeps it.
export async function record(page, force, time_ms) {
    await page.evaluate(() => {
        studio.recorded = null;
        studio.connection.on("recording", ({ recording }) => (studio.recorded = recording));
    });
    await page.click("#record");
    await until(page, () => studio.status.recording_s !== null);
    await stroke(page, force, time_ms);
    await picture(page, "recording");
    await page.click("#record");
    await until(page, () => studio.recorded && studio.status.recording_s === null && studio.runs);
    return page.evaluate(() => ({ recording: studio.recorded, run: studio.lastRun }));
}

// Replays what the page has; the run of it.
export async function replay(page) {
    await page.click("#replay");
    await until(page, () => studio.status.replay > 0);
    await until(page, () => studio.status.replay === null && studio.runs);
    return page.evaluate(() => studio.lastRun);
}

// Two runs of the same recording have the same samples where both were kept.
export function assertSame({ frames }, one, other) {
    const first = Math.max(one.first, other.first);
    const of = (run) => run.values.slice(first - run.first, frames - run.first);
    const count = Math.min(of(one).length, of(other).length);
    const [a, b] = [one, other].map((run) => of(run).slice(0, count));
    const power = a.reduce((sum, value) => sum + value * value, 0);
    assert(count > 0.9 * frames && power > 1e-3, `${count} samples of ${frames} frames, power ${power}`);
    const at = a.findIndex((value, i) => value !== b[i]);
    assert.equal(at, -1, `sample ${at} of ${count} differs: ${a[at]} and ${b[at]}`);
}

// Runs all scenarios on one page; how many failed. A stroke takes the time that it takes: where a machine was busy for a
// moment, a scenario has a second try.
export async function runAll() {
    let failed = 0;
    const again = [];
    const only = process.env.ONLY; // a part of the names of those to be run
    const page = await open();
    await page.evaluate(() => studio.own());
    await until(page, () => studio.status.owner);
    const attempt = async (on, name, run) => {
        const begun_ms = performance.now();
        try {
            await run(on);
            console.log(`ok      ${name} (${((performance.now() - begun_ms) / 1000).toFixed(1)} s)`);
            return true;
        } catch (error) {
            if (on) await picture(on, `failed-${again.length + 1}`);
            console.log(`FAILED  ${name}\n        ${String(error.stack).split("\n").slice(0, 7).join("\n        ")}`);
            return false;
        }
    };
    const runLane = async (wanted, on) => {
        for (const [name, run, lane] of tests) {
            if (lane !== wanted || (only && !name.includes(only))) continue;
            if (!(await attempt(on, name, run))) again.push([name, run]);
        }
    };
    await runLane("page", page);
    // It would go on to draw.
    await page.context().close();
    await Promise.all([runLane("own"), runLane("beside")]);
    for (const [name, run] of again) {
        console.log(`once more: ${name}`);
        const fresh = await open();
        await fresh.evaluate(() => studio.own());
        await until(fresh, () => studio.status.owner);
        if (!(await attempt(fresh, name, run))) failed++;
        await fresh.context().close();
    }
    if (problems.length) console.log(`FAILED  no console error, no request elsewhere\n        ${problems.join("\n        ")}`);
    else console.log("ok      no console error, no request elsewhere");
    await browser.close();
    served?.close();
    return failed + problems.length;
}
