// What a person works with: presets, the editor and its file, recordings, surfaces, scopes; and whether what is felt is what
// the surface's models say.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { appendFileSync, mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import {
    assertSame,
    AXE,
    demo,
    drop,
    feltPort,
    fingers,
    gather,
    HOME,
    latest,
    level,
    open,
    pen,
    picture,
    PROGRAM,
    programTest,
    ready,
    record,
    replay,
    served,
    serverTest,
    studioOf,
    stroke,
    test,
    until,
} from "./harness.mjs";

const LEARNING_MS = 180_000;
const SPREAD_DB = 2; // of the level of a noise over a second and a half

test("a preset is saved to a file and brings the settings back", async (page) => {
    await page.evaluate(() => studio.showTab("controls"));
    const [setting, other] = await page.evaluate(() => {
        const found = studio.graph.settings.find(({ min, max }) => min !== null && max !== null) ?? studio.graph.settings[0];
        return [found, found.value * 0.5 + 0.5 * (found.max ?? 2 * found.value)];
    });
    const value = () => page.evaluate((name) => studio.values.get(name), setting.name);
    const before = await value();
    const [download] = await Promise.all([page.waitForEvent("download"), page.click("#preset-save")]);
    const preset = JSON.parse(readFileSync(await download.path(), "utf8"));
    assert.deepEqual([preset.haptograph_preset, preset.settings[setting.name]], [1, before]);
    await page.evaluate(([name, to]) => studio.set(name, to), [setting.name, other]);
    assert.notEqual(await value(), before);
    await page.setInputFiles("#preset-load", {
        name: "mine.json",
        mimeType: "application/json",
        buffer: Buffer.from(JSON.stringify(preset)),
    });
    await until(page, ([name, wanted]) => studio.values.get(name) === wanted, [setting.name, before]);
    await until(page, () => document.getElementById("status-text").textContent.includes("mine.json was loaded"));
});

programTest("a download holds the running text and its surface, and opens elsewhere", async (page) => {
    await page.evaluate(() => (studio.showTab("editor"), studio.loadEditor()));
    const before = await page.evaluate(() => studio.graph.text);
    const changed = `${before.trimEnd()} // mine, ½\n`;
    const other = "surfaces/t2-canvas.ron";
    const { applied, chosen } = await page.evaluate(
        async ([text, other]) => ({
            applied: await studio.connection.request({ type: "apply", text }),
            chosen: await studio.parameter("surface", JSON.stringify(other)),
        }),
        [changed, other],
    );
    assert(applied.ok && chosen.ok, JSON.stringify([applied, chosen]));
    const [download] = await Promise.all([page.waitForEvent("download"), page.click("#editor-download")]);
    const folder = mkdtempSync(join(tmpdir(), "haptograph-bundle-"));
    execFileSync("python3", ["-m", "zipfile", "-e", await download.path(), folder]);
    const readme = readFileSync(join(folder, "texturepad/README.txt"), "utf8");
    const [, graph, set] = readme.match(/haptograph studio (\S+) --set '?([^']*)'?\n/);
    assert.equal(readFileSync(join(folder, "texturepad", graph), "utf8"), changed);
    execFileSync(PROGRAM, ["run", graph, "--set", set, "--for", "0.2", "--out", "out"], { cwd: join(folder, "texturepad") });
    const run = readFileSync(join(folder, "texturepad/out/run.json"), "utf8");
    assert(run.includes("t2-canvas"), run.slice(0, 2000));
    rmSync(folder, { recursive: true });
    await page.evaluate((text) => studio.connection.request({ type: "apply", text }), before);
}, "page");

test("a pause freezes what is seen, and zoom and span act in it", async (page) => {
    await demo(page, true);
    await page.waitForTimeout(1200);
    const seen = () => page.evaluate(() => document.querySelector("#scopes canvas").toDataURL());
    // What waits for every second frame has been drawn by then, however slow the machine is.
    const settled = () =>
        page.evaluate(async () => {
            for (let i = 0; i < 8; i++) await new Promise(requestAnimationFrame);
        });
    await page.click("#scope-pause");
    await settled();
    const before = await seen();
    // What goes on behind it is longer than what a ring holds, as if that time had passed.
    await page.evaluate(() => studio.taps.traces.forEach((trace) => trace.clear()));
    await page.waitForTimeout(500);
    await settled();
    assert.equal(await seen(), before);
    await picture(page, "paused");
    await page.locator("#scopes .scope").first().hover();
    await page.locator('#scopes [aria-label="Larger"]').first().click();
    await settled();
    const larger = await seen();
    assert.notEqual(larger, before);
    await page.locator('#scopes [aria-label="Smaller"]').first().click();
    await settled();
    assert.equal(await seen(), before);
    await page.selectOption("#scope-span", "0.5");
    await settled();
    const late = await seen();
    assert.notEqual(late, before);
    const box = await page.locator("#scopes canvas").first().boundingBox();
    await page.mouse.move(box.x + 0.3 * box.width, box.y + 0.5 * box.height);
    await page.mouse.down();
    await page.mouse.move(box.x + 0.7 * box.width, box.y + 0.5 * box.height);
    await page.mouse.up();
    await settled();
    const dragged = await seen();
    assert.notEqual(dragged, late);
    await picture(page, "paused-earlier");
    await page.focus("#scope-back");
    await page.keyboard.press("Home"); // the earliest that was kept
    await settled();
    assert.notEqual(await seen(), dragged);
    await page.keyboard.press("End");
    await settled();
    assert.equal(await seen(), late);
    await page.setViewportSize({ width: 1300, height: 900 }); // a canvas that is resized is empty until it is drawn
    await settled();
    const empty = await page.evaluate(
        () =>
            [...document.querySelectorAll("#scopes canvas")].filter((canvas) => {
                const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
                return !data.some((value) => value > 0);
            }).length,
    );
    assert.equal(empty, 0, `${empty} views are blank`);
    await page.setViewportSize({ width: 1440, height: 900 });
    await page.selectOption("#scope-span", "2");
    await page.click("#scope-pause");
    await page.waitForTimeout(500);
    await settled();
    assert.notEqual(await seen(), before);
    await demo(page, false);
});

test("a drawer that fails leaves the others drawing", async () => {
    const page = await open({ expected: /for a test/ });
    await page.evaluate(async () => {
        const { everyFrame } = await import(new URL("frame.js", document.baseURI));
        window.drawn = 0;
        everyFrame(() => {
            throw new Error("for a test");
        });
        everyFrame(() => window.drawn++);
    });
    await until(page, () => window.drawn > 10);
    await until(page, () => document.getElementById("status-text").textContent.includes("Reload the page"));
    await page.context().close();
});

test("a surface that the engine refuses is asked for again at the next touch", async (page) => {
    await page.evaluate(() => studio.showTab("surfaces"));
    if (await page.locator("#compare").isHidden()) return;
    await page.evaluate(() => {
        studio.asked = 0;
        studio.parameter = async () => (studio.asked++, { ok: false, error: "refused for a test" });
    });
    await page.click("#compare");
    const [left] = await page.evaluate(() => studio.compared.map(({ path }) => path));
    const hand = await pen(page);
    await hand.press(0.25, 0.5, 0.4);
    await until(page, () => document.getElementById("status-text").textContent.includes("refused for a test"));
    await page.waitForTimeout(300);
    assert.equal(await page.evaluate(() => studio.asked), 1, "it asks at every frame");
    await hand.lift(0.25, 0.5);
    await page.evaluate(() => delete studio.parameter);
    await page.waitForTimeout(100);
    await hand.press(0.25, 0.5, 0.4);
    await until(page, (path) => studio.currentSurface()?.path === path, left);
    await hand.lift(0.25, 0.5);
    await page.click("#compare");
});

// All that a person can read on the page, of a tab: text, values of fields, titles.
const readable = (page) =>
    page.evaluate(() => {
        const parts = [];
        const visible = (element) => element.checkVisibility({ visibilityProperty: true });
        const walk = (root) => {
            for (const element of root.querySelectorAll("*")) {
                if (element.shadowRoot) walk(element.shadowRoot);
                if (!visible(element) || element.closest("select")) continue;
                parts.push(element.title, element.value, element.getAttribute("aria-label"));
                for (const child of element.childNodes) if (child.nodeType === Node.TEXT_NODE) parts.push(child.textContent);
            }
        };
        walk(document);
        return parts.filter((part) => typeof part === "string" && part !== "").join("\n");
    });

test("nothing that can be read says which surface runs while one compares blind", async (page) => {
    await page.evaluate(() => studio.showTab("surfaces"));
    if (await page.locator("#compare").isHidden()) return;
    await page.click("#compare");
    await page.check("#blind");
    const hand = await pen(page);
    const document_title = await page.title();
    const sides = await page.evaluate(() => studio.compared.map(({ path, name }) => ({ path, name })));
    for (const [x, { path, name }] of [
        [0.25, sides[0]],
        [0.75, sides[1]],
    ]) {
        await hand.press(x, 0.5, 0.4);
        await until(page, (wanted) => studio.currentSurface()?.path === wanted, path);
        for (const tab of ["graph", "controls", "surfaces"]) {
            await page.evaluate((shown) => studio.showTab(shown), tab);
            const text = (await readable(page)).replaceAll(/^default .*$/gm, ""); // which is the same whatever runs
            for (const said of [
                path,
                path
                    .split("/")
                    .at(-1)
                    .replace(/\.ron"?$/, ""),
                name,
            ])
                assert(!text.includes(said), `${tab}: ${text.split("\n").find((line) => line.includes(said))}`);
        }
        // Nothing draws a signal, a cost or a picture, but the pad its hands.
        const drawn = await page.evaluate(() => {
            const all = [...document.querySelectorAll("canvas, svg, img, meter, .scope, .view")];
            const seen = all.filter((each) => each.checkVisibility({ visibilityProperty: true }) && !each.closest("#pad, header"));
            const paints = [...document.querySelectorAll("#pad-swatch, .pad-half")].filter((each) => /url/.test(getComputedStyle(each).backgroundImage));
            return [...seen, ...paints].map((each) => `${each.localName}#${each.id}.${each.className}`);
        });
        assert.deepEqual(drawn, []);
        assert.doesNotMatch(await page.textContent("#status-figures"), /processor/);
        assert(!sides.some((side) => document_title.includes(side.name)), document_title);
        await hand.lift(x, 0.5);
    }
    await page.evaluate(() => studio.showTab("graph"));
    await picture(page, "blind-graph");
    await page.evaluate(() => studio.showTab("controls"));
    await picture(page, "blind-controls");
    await page.evaluate(() => studio.showTab("surfaces"));
    await page.uncheck("#blind");
    await page.click("#compare");
    const value = await page.evaluate(() => {
        const { name } = studio.graph.parameters.find(({ is_surface }) => is_surface);
        return document.querySelector(`[data-parameter="${name}"]`).value;
    });
    assert(
        sides.some(({ path }) => value.includes(path.replaceAll('"', ""))),
        value,
    );
});

test("a recording that was kept is replayed after a reload, with the same samples", async (page) => {
    const port = await page.evaluate(() => `${studio.graph.actuators[0].name}.delivered`);
    const afresh = async () => {
        await page.reload();
        await ready(page);
        await page.evaluate(() => studio.own());
        await until(page, () => studio.status.owner);
    };
    await afresh(); // the page of a site comes back with the graph as it was exported
    await gather(page, port);
    const { recording, run } = await record(page, 0.5, 900);
    const [download] = await Promise.all([page.waitForEvent("download"), page.click("#keep")]);
    const text = readFileSync(await download.path(), "utf8");
    assert.deepEqual(JSON.parse(text), recording);
    await afresh();
    assert(await page.isHidden("#replay"), "a recording survived the reload");
    await gather(page, port);
    await drop(page, "mine-strokes.json", "application/json", text);
    assertSame(recording, run, await replay(page));
    await afresh();
});

// The models of a surface file: places in m/s and N, the root of each one's power in m/s2, and the triangles between them.
function modelsOf(path) {
    const text = readFileSync(path, "utf8");
    const vertices = [...text.matchAll(/\(speed_mm_s: ([\d.e-]+), force_n: ([\d.e-]+), filter: \d+, power_m2_s4: ([\d.e-]+)/g)];
    const after = text.slice(text.indexOf("triangles: ["));
    const triangles = [...after.matchAll(/\((\d+), (\d+), (\d+)\)/g)].map((match) => match.slice(1).map(Number));
    const points = vertices.map(([, speed, force, power]) => [Number(speed) / 1000, Number(force), Math.sqrt(Number(power))]);
    assert(points.length > 2 && triangles.length > 0, `${path} has no models`);
    return { points, triangles };
}

// The amplitude that the models give at a speed and a force: between three of them by the triangle's weights.
function amplitudeAt({ points, triangles }, speed, force) {
    const most = [0, 1].map((axis) => Math.max(...points.map((point) => point[axis])));
    const [x, y] = [Math.min(speed, most[0]), Math.min(force, most[1])];
    for (const triangle of triangles) {
        const [a, b, c] = triangle.map((i) => points[i]);
        const area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        const second = ((x - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (y - a[1])) / area;
        const third = ((b[0] - a[0]) * (y - a[1]) - (x - a[0]) * (b[1] - a[1])) / area;
        const weights = [1 - second - third, second, third];
        if (weights.every((weight) => weight >= -1e-6)) return weights.reduce((sum, w, i) => sum + w * [a, b, c][i][2], 0);
    }
    return 0;
}

// The latest values of a port over so long.
const history = (page, name, span_s) =>
    page.evaluate(
        ([port, span]) => {
            const trace = studio.taps.traces.find((each) => each.name === port);
            const count = Math.min(trace.count, Math.round(span / trace.interval_s));
            return Array.from({ length: count }, (_, back) => trace.most[trace.place(count - 1 - back)]);
        },
        [name, span_s],
    );

test("harder and faster strokes vibrate as much more as the surface's models say", async (page) => {
    const port = await feltPort(page);
    const map = await page.evaluate(() => studio.graph.maps[0]);
    const { path } = await page.evaluate(() => studio.currentSurface());
    const models = modelsOf(join(HOME, "graphs", path.replaceAll('"', "")));
    const pad = await page.evaluate(() => studio.graph.pads[0]);
    const SPAN_S = 1.5;
    const [RADIUS_MM, SETTLED_S] = [28, 0.6];
    // Circles of an even speed, and what was felt against what the models give for the speeds and forces that arrived.
    const stroked = async (pressure, speed_mm_s) => {
        const hand = await pen(page);
        const at = (angle) => [
            0.5 + (RADIUS_MM / pad.width_mm) * Math.cos(angle),
            0.5 + (RADIUS_MM / pad.height_mm) * Math.sin(angle),
        ];
        await hand.press(...at(0), pressure);
        const begun_ms = performance.now();
        for (let time_s = 0; time_s < SPAN_S + SETTLED_S; time_s = (performance.now() - begun_ms) / 1000)
            await hand.move(...at((time_s * speed_mm_s) / RADIUS_MM), pressure);
        const rms = await level(page, port, SPAN_S);
        const [speeds, forces] = await Promise.all([map.speed_port, map.force_port].map((name) => history(page, name, SPAN_S)));
        await hand.lift(...at(0));
        const powers = speeds.map((speed, i) => amplitudeAt(models, speed, forces[Math.min(i, forces.length - 1)]) ** 2);
        const wanted = Math.sqrt(powers.reduce((sum, power) => sum + power, 0) / powers.length);
        const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
        return { rms, wanted, speed: mean(speeds), force: mean(forces) };
    };
    const decibels = (ratio) => 20 * Math.log10(ratio);
    const [soft, hard] = [await stroked(0.2, 60), await stroked(0.7, 180)];
    await page.waitForTimeout(600);
    const told = ({ rms, wanted, speed, force }) =>
        `${rms.toFixed(2)} m/s² at ${(1000 * speed).toFixed(0)} mm/s and ${force.toFixed(2)} N, ${wanted.toFixed(2)} by the models`;
    console.log(`        ${told(soft)}; ${told(hard)}`);
    assert(decibels(hard.wanted / soft.wanted) > 6, "the strokes are too much alike");
    for (const { rms, wanted } of [soft, hard])
        assert(Math.abs(decibels(rms / wanted)) < SPREAD_DB, `${decibels(rms / wanted).toFixed(1)} dB beside the models`);
    const apart_db = decibels(hard.rms / soft.rms) - decibels(hard.wanted / soft.wanted);
    assert(Math.abs(apart_db) < SPREAD_DB, `${apart_db.toFixed(1)} dB beside the ratio of the models`);
    assert((await latest(page, map.force_port)) < 0.01);
});

programTest("the editor completes, explains and saves, and not over what somebody else wrote", async () => {
    const own = await studioOf("graphs/texturepad.ron");
    const page = await open({ at: own.address });
    const file = join(own.root, "graphs/texturepad.ron");
    const save = async (remark) => {
        await page.evaluate((text) => studio.editor.dispatch({ changes: { from: 0, insert: text } }), `// ${remark}\n`);
        await page.focus(".cm-content");
        await page.keyboard.press("Control+s");
        await until(page, () => /^(Saved|Not saved)/.test(document.getElementById("editor-state").textContent));
        return page.textContent("#editor-state");
    };
    try {
        await page.evaluate(() => studio.showTab("editor"));
        // Hover on a kind of node.
        await page.evaluate(() => {
            const at = studio.editor.state.doc.toString().indexOf("SpeedEstimator(");
            studio.editor.dispatch({ selection: { anchor: at }, scrollIntoView: true });
        });
        await page.waitForTimeout(300);
        const word = page.locator(".cm-line span", { hasText: /^SpeedEstimator$/ }).first();
        await word.hover();
        await page.waitForSelector(".cm-tooltip .tip h4", { timeout: 5000 });
        assert.match(await page.textContent(".cm-tooltip .tip"), /SpeedEstimator.*inputs:/s);
        await picture(page, "hover");
        // Completion inside of it.
        await page.evaluate(() => {
            const text = studio.editor.state.doc.toString();
            const at = text.indexOf("SpeedEstimator(") + "SpeedEstimator(".length;
            studio.editor.dispatch({ selection: { anchor: at } });
        });
        await page.focus(".cm-content");
        await page.keyboard.type("cut");
        await page.waitForSelector(".cm-tooltip-autocomplete li", { timeout: 5000 });
        assert.match(await page.textContent(".cm-tooltip-autocomplete"), /cutoff_hz/);
        await picture(page, "completion");
        await page.keyboard.press("Escape"); // of the list, no STOP
        await page.waitForSelector(".cm-tooltip-autocomplete", { state: "detached" });
        assert.equal(await page.evaluate(() => studio.status.state), "running");
        await page.click("#editor-revert");
        // The file.
        assert.match(await save("saved by the page"), /^Saved to/);
        assert(readFileSync(file, "utf8").startsWith("// saved by the page\n"));
        appendFileSync(file, "// somebody else\n");
        assert.match(await save("over it"), /^Not saved/);
        assert(readFileSync(file, "utf8").endsWith("// somebody else\n"));
        assert(!readFileSync(file, "utf8").includes("over it"));
        // Both are changed: a person chooses.
        await page.waitForSelector("#disk:not([hidden])");
        assert.match(await save("again"), /^Not saved/);
        await page.click("#disk-take");
        const isOf = (text) => until(page, (end) => studio.graph.text.endsWith(end) && studio.editor.state.doc.toString() === studio.graph.text, text);
        await isOf("// somebody else\n");
        // Only the file is: its text runs.
        appendFileSync(file, "// and again\n");
        await isOf("// and again\n");
        assert.equal(await page.evaluate(() => studio.graph.saved), true);
    } finally {
        await page.context().close();
        await own.end();
    }
});

// The recording beside the surface that was learned of it and beside another, and ABX.
async function listens(page) {
    await page.click(".surface-message button >> text=Listen");
    await page.waitForSelector("#listen select[aria-label='Another surface']", { timeout: LEARNING_MS });
    await page.selectOption("#listen select[aria-label='Another surface']", { index: 1 });
    await page.waitForFunction(() => document.querySelectorAll("#listen [aria-label='What sounds'] button").length === 3);
    for (const place of [0, 1, 2, 0]) {
        await page.click(`#listen [aria-label='What sounds'] button >> nth=${place}`);
        assert.equal(await page.locator("#listen [aria-pressed=true]").count(), 1);
    }
    await picture(page, "listen");
    await page.evaluate(AXE);
    const { violations } = await page.evaluate(() => axe.run("#listen"));
    assert.deepEqual(violations.map(({ id, nodes }) => `${id}: ${nodes[0].html}`), []);
    // As loud as it was recorded, to 6 dB.
    const beside = await page.textContent("#listen .soft");
    assert(Math.abs(Number(beside.match(/my-tile ([+−]?[\d.]+) dB/)[1].replace("−", "-"))) < 6, beside);
    await page.click("#listen button >> text=ABX");
    for (let trial = 0; trial < 10; trial++) {
        await page.click("#listen .abx button >> text=/^X$/");
        await page.click(`#listen .abx button >> text=X is ${trial % 2 ? "B" : "A"}`);
    }
    assert.match(await page.textContent("#listen .abx"), /\d+ of 10 right\./);
    await page.click("#stop");
    assert.equal(await page.locator("#listen [aria-pressed=true]").count(), 0);
}

(served ? test : programTest)("a recording that is dropped on the page is learned, and is on the pad", async () => {
    const own = served ? null : await studioOf("graphs/texturepad.ron");
    const page = await open(own ? { at: own.address } : {});
    const answer = async () => {
        await page.waitForSelector(".surface-message button >> text=Close", { timeout: LEARNING_MS });
        return page.textContent(".surface-message p");
    };
    try {
        await drop(page, "none.csv", "text/csv", "a,b\n1,2\n");
        assert.match(await answer(), /none\.csv/);
        await page.waitForSelector(".findings .error");
        await page.click(".surface-message button >> text=Close");
        const before = await page.evaluate(() => studio.graph.surfaces.length);
        const table = readFileSync(join(HOME, "examples/data/t3-tile-drag-simulated.csv"), "utf8");
        const dropped_ms = performance.now();
        await drop(page, "my-tile.csv", "text/csv", table);
        await page.waitForSelector(".surface-message", { timeout: 5000 });
        assert.match(await answer(), /my-tile\.csv was learned; it is on the pad: stroke it/);
        console.log(`        from the drop to the pad: ${((performance.now() - dropped_ms) / 1000).toFixed(2)} s`);
        await picture(page, "learned");
        // A server keeps both; a page lets them be downloaded.
        assert.equal(await page.locator(".surface-message a.report").count(), own ? 1 : 2);
        await until(page, (count) => studio.graph.surfaces.length === count + 1, before);
        assert.match(await page.evaluate(() => studio.currentSurface().path), /my-tile/);
        const port = await feltPort(page);
        let during = 0;
        await stroke(page, 0.5, 1500, async (part) => part > 0.6 && (during = Math.max(during, await level(page, port, 0.3))));
        assert(during > 0.01, `${during} m/s² while stroking`);
        await listens(page);
    } finally {
        await page.context().close();
        await own?.end();
    }
});

(served ? test : programTest)("learning is cancelled by its button, and what cannot be read is greyed", async () => {
    const files = { "graphs/surfaces/cut.ron": 'Surface(format: 1, name: "cut", texture: Some((' };
    const own = served ? null : await studioOf("graphs/texturepad.ron", { files });
    const page = await open({ ...(own && { at: own.address }), colorScheme: own ? "dark" : "light" });
    try {
        if (own) {
            await page.evaluate(() => studio.showTab("surfaces"));
            const cut = page.locator(".surface.unreadable");
            assert.deepEqual([await cut.count(), await cut.isDisabled()], [1, true]);
            assert.match(await cut.getAttribute("title"), /surfaces\/cut\.ron: ./);
            assert.equal(await page.evaluate(() => studio.graph.surfaces.some(({ name }) => name === "cut")), false);
            await cut.scrollIntoViewIfNeeded();
            await picture(page, "unreadable-dark");
            await page.emulateMedia({ colorScheme: "light" });
            await picture(page, "unreadable-light");
        }
        // A site loads those of the folder when they are shown.
        await page.evaluate(() => studio.showTab("surfaces"));
        await until(page, () => studio.graph.surfaces.length > 5);
        const count = await page.evaluate(() => studio.graph.surfaces.length);
        const header = "time_s,accel_m_s2,force_normal_n,speed_mm_s\n";
        const rows = Array.from({ length: 400_000 }, (_, k) =>
            [k / 2000, Math.sin(k * k) * (1 + Math.sin(k / 900)), 1.2 + 0.8 * Math.sin(k / 950), 110 + 80 * Math.sin(k / 1540)]
                .map((number) => number.toFixed(4))
                .join(","),
        );
        await drop(page, "long.csv", "text/csv", header + rows.join("\n"));
        await page.click(".surface-message button >> text=Cancel");
        await page.waitForSelector(".surface-message button >> text=Close");
        assert.match(await page.textContent(".surface-message p"), /cancelled/);
        await picture(page, "cancelled");
        assert.equal(await page.evaluate(() => studio.graph.surfaces.length), count);
        assert(await page.evaluate(() => studio.runs));
    } finally {
        await page.context().close();
        await own?.end();
    }
});

// The editor with `text` in place of what is there and the cursor at the bar in it.
async function write(page, text) {
    await page.evaluate((marked) => {
        studio.showTab("editor");
        const at = marked.indexOf("|");
        const { length } = studio.editor.state.doc;
        studio.editor.dispatch({
            changes: { from: 0, to: length, insert: marked.replace("|", "") },
            selection: { anchor: at },
            scrollIntoView: true,
        });
    }, text);
    await page.focus(".cm-content");
}

const completionsOf = async (page, name = null) => {
    await page.keyboard.press("Control+Space");
    await page.waitForSelector(".cm-tooltip-autocomplete li", { timeout: 5000 });
    if (name) await picture(page, name);
    const offered = await page
        .locator(".cm-tooltip-autocomplete li")
        .evaluateAll((items) =>
            items.map((item) => ["Label", "Detail"].map((part) => item.querySelector(`.cm-completion${part}`)?.textContent ?? "").join(" ")),
        );
    await page.keyboard.press("Escape");
    await page.waitForSelector(".cm-tooltip-autocomplete", { state: "detached" });
    return offered;
};

test("the editor completes quantities with units, nested settings and the keys of the file", async (page) => {
    const begin = 'Graph(format: 1, clocks: { "audio": Driver(rate_hz: 48000) }, nodes: {\n    ';
    await write(page, `${begin}"a": WavSource(quantity: "|"`);
    const quantities = await completionsOf(page, "completion-quantity");
    assert(quantities.includes("force N") && quantities.includes("angular speed rad/s"), quantities.join("; "));
    await write(page, `${begin}"a": ActuatorSink(limit: (pe|`);
    assert.equal((await completionsOf(page))[0], "peak_a required, A");
    await write(page, "Graph(|");
    assert((await completionsOf(page)).some((offered) => offered.startsWith("endpoints")));
    await write(page, `${begin}"a": Sine(clock: "|"`);
    assert.deepEqual(await completionsOf(page), ["audio 48000 Hz"]);
    // What is chosen is written.
    await write(page, `${begin}"a": ActuatorSink(limit: (pe|`);
    await page.keyboard.press("Control+Space");
    await page.waitForSelector(".cm-tooltip-autocomplete li[aria-selected]", { timeout: 5000 });
    await page.waitForTimeout(150); // a list that has just come takes no key
    await page.keyboard.press("Enter");
    await until(page, () => studio.editor.state.doc.toString().endsWith("limit: (peak_a: "));
    await page.click("#editor-revert");
});

test("the editor explains an output, a clock and a parameter where the mouse rests", async (page) => {
    await page.evaluate(() => studio.showTab("editor"));
    for (const [mark, text, wanted] of [
        ['force: "stylus.force"', "stylus.force", /Normal force of the tip.*125 Hz/s],
        ['"synth": Derived', "synth", /Derived.*10000 Hz/s],
        ['Param("gain")', "gain", /now 1\.0/],
    ]) {
        const at = await page.evaluate(
            ([around, inside]) => {
                const { editor } = studio;
                const from = editor.state.doc.toString().indexOf(around) + around.indexOf(inside) + 1;
                editor.dispatch({ selection: { anchor: from }, scrollIntoView: true });
                return from;
            },
            [mark, text],
        );
        await page.mouse.move(5, 5);
        await page.waitForSelector(".cm-tooltip .tip", { state: "detached" });
        await page.waitForTimeout(300);
        const { left, top, bottom } = await page.evaluate((from) => studio.editor.coordsAtPos(from), at);
        await page.mouse.move(left + 2, (top + bottom) / 2);
        await page.mouse.move(left + 3, (top + bottom) / 2);
        await page.waitForSelector(".cm-tooltip .tip h4", { timeout: 5000 });
        assert.match(await page.textContent(".cm-tooltip .tip"), wanted);
    }
    await picture(page, "hover-parameter");
    await page.mouse.move(5, 5);
});

test("what is typed is undone by the keyboard, also what was applied", async (page) => {
    await page.evaluate(() => studio.showTab("editor"));
    const text = () => page.evaluate(() => studio.editor.state.doc.toString());
    const runs = (wanted) => until(page, (given) => studio.graph.text === given, wanted);
    // What is typed is in the text a moment later.
    const becomes = (wanted) => until(page, (given) => studio.editor.state.doc.toString() === given, wanted);
    const undo = async (key, wanted) => {
        for (let count = 0; count < 5 && (await text()) !== wanted; count++) {
            await page.keyboard.press(key);
            await page.waitForTimeout(100);
        }
        assert.equal(await text(), wanted, key);
    };
    const before = await text();
    await page.focus(".cm-content");
    await page.keyboard.press("Control+Home");
    await page.keyboard.type("// typed");
    await becomes(`// typed${before}`);
    await undo("Control+z", before);
    assert(await page.isDisabled("#editor-apply"), "nothing is left to apply");

    await page.keyboard.type("// typed");
    await page.keyboard.press("Enter");
    const typed = `// typed\n${before}`;
    await becomes(typed);
    await page.keyboard.press("Control+Enter");
    await runs(typed);
    assert.equal(await text(), typed);
    await undo("Control+z", before); // what was applied is undone as well
    await runs(typed); // until that is applied
    await page.keyboard.press("Control+Enter");
    await runs(before);
    await undo("Control+y", typed); // and done again
    await page.click("#editor-revert");
    assert.equal(await text(), before);
});

programTest("a recording whose columns have foreign names is learned once a person has said what they hold", async () => {
    const own = await studioOf("graphs/texturepad.ron");
    const page = await open({ at: own.address });
    // A hand that strokes faster and slower: what is learned is not judged here.
    const rows = Array.from({ length: 40_000 }, (_, i) => {
        const speed = 60 + 40 * Math.sin(i / 4000);
        return `${i / 10},${(1 + 0.5 * Math.sin(i / 9000)).toFixed(4)},${(speed / 10).toFixed(4)},${(0.002 * speed * Math.sin(i * i)).toFixed(5)}`;
    });
    const file = { name: "foreign.csv", mimeType: "text/csv", buffer: Buffer.from(`q1/ms,q2,q3/(cm/s),q4/g\n${rows.join("\n").replace("0.5,", "0.5,?")}\n`) };
    try {
        await page.setInputFiles("#learn", file);
        await page.waitForSelector(".mapping", { timeout: 30_000 });
        await picture(page, "mapping");
        const quantities = ["time", "force_normal", "speed", "accel"];
        await page.waitForSelector(".findings .error");
        for (const [i, quantity] of quantities.entries()) await page.selectOption(`.mapping tr:nth-child(${i + 1}) select >> nth=0`, quantity);
        const units = () => page.locator(".mapping tr td:last-child select").evaluateAll((menus) => menus.map(({ value }) => value));
        assert.deepEqual(await units(), ["ms", "n", "cm_s", "g"]);
        // What would be repaired is said before anything is learned.
        await page.waitForSelector(".findings .repair");
        assert.match(await page.textContent(".findings"), /1 .*(unreadable|empty)/);
        await picture(page, "findings");
        await page.click(".surface-message .primary");
        const learned = () => [...document.querySelectorAll(".surface-message p")].some((p) => / was learned;/.test(p.textContent));
        await until(page, learned, null, 60_000);
        await page.click(".surface-message button >> text=Columns…");
        await page.waitForSelector(".mapping");
        assert.deepEqual(await units(), ["ms", "n", "cm_s", "g"]);
        // The same logger again needs no word.
        await page.click(".surface-message button >> text=Close");
        await page.setInputFiles("#learn", { ...file, name: "second.csv" });
        await until(page, learned, null, 60_000);
        assert(await page.evaluate(() => studio.graph.surfaces.some(({ path }) => path.includes("second"))));
    } finally {
        await page.context().close();
        await own.end();
    }
});

programTest("of a stroke that nothing answers the page says where to look", async () => {
    const text = readFileSync(join(HOME, "graphs/texturepad.ron"), "utf8")
        .replace('force: "stylus.force"),', 'force: "pressed"),')
        .replace("    nodes: {", '    nodes: {\n"pressed": Gain(input: "stylus.force", gain: 0.0),');
    const own = await studioOf("graphs/mute.ron", { files: { "graphs/mute.ron": text } });
    const page = await open({ at: own.address });
    const says = (wanted) => until(page, (text) => document.getElementById("status-text").textContent.includes(text), wanted);
    try {
        await page.click("#sound");
        await page.click("#demo");
        await says("wires of the drawing are thin behind the node that gives nothing");
        await page.evaluate(() => studio.set("pressed.gain", 1));
        await says("A simulated hand strokes");
    } finally {
        await page.context().close();
        await own.end();
    }
});

programTest("the page of a recorder shows how much of force and speed is recorded", async () => {
    const own = await studioOf("graphs/recorder.ron");
    const page = await open({ at: own.address });
    await page.click("#record");
    await until(page, () => /[1-9] of 9 areas/.test(document.getElementById("recorded").textContent));
    assert.equal(await page.isVisible("#recorded"), true);
    await picture(page, "coverage");
    await page.context().close();
    await own.end();
});

programTest("a parameter that feeds one setting has its unit and range, and is set when it is let go", async () => {
    const text = readFileSync(join(HOME, "graphs/texturepad.ron"), "utf8")
        .replace("parameters: {", 'parameters: { "soft_hz": 20.0,')
        .replace("cutoff_hz: 20", 'cutoff_hz: Param("soft_hz")');
    const own = await studioOf("graphs/soft.ron", { files: { "graphs/soft.ron": text } });
    const page = await open({ at: own.address });
    try {
        await turnSoft(page);
    } finally {
        await page.context().close();
        await own.end();
    }
});

async function turnSoft(page) {
    await page.evaluate(() => studio.showTab("controls"));
    const { name, min, max, value } = await page.evaluate(() => studio.graph.parameters.find((each) => each.name === "soft_hz"));
    const row = page.locator(".control", { has: page.locator(`[aria-label="parameter ${name}, number"]`) });
    const [slider, number] = [row.locator("input[type=range]"), row.locator("input[type=number]")];
    assert.deepEqual([await number.getAttribute("min"), await number.getAttribute("max")], [String(min), String(max)]);
    assert.equal(await row.locator(".unit").innerText(), "Hz");
    assert.match(await row.locator(".doc").innerText(), /cut-off/i);
    // One that feeds nothing alone has a field for its text.
    assert.equal(await page.locator('[data-parameter="hand"]').count(), 1);
    const now = () => page.evaluate((of) => Number(studio.graph.parameters.find((each) => each.name === of).value), name);
    const shows = async (wanted) => {
        await until(
            page,
            ([of, to]) =>
                Number(studio.graph.parameters.find((each) => each.name === of).value) === to &&
                Number(document.querySelector(`[aria-label="parameter ${of}, number"]`).value) === to,
            [name, wanted],
        );
    };
    await shows(Number(value));
    await slider.focus();
    await page.keyboard.press("ArrowLeft");
    await until(page, ([of, was]) => Number(studio.graph.parameters.find((each) => each.name === of).value) < was, [
        name,
        Number(value),
    ]);
    await shows(await now());
    await number.fill("30");
    await number.press("Enter");
    await shows(30);
    await picture(page, "parameters");
    // Beyond the range is its end, which is more than half the rate: the engine's error is shown, and what runs.
    await number.fill(String(10 * max));
    await number.press("Enter");
    await row.locator(".error").waitFor();
    assert.match(await row.locator(".error").innerText(), /125|62\.5/);
    await shows(30);
    await number.fill(value);
    await number.press("Enter");
    await shows(Number(value));
    assert.equal(await row.locator(".error").isVisible(), false);
}

const VIEWS = ["time", "spectrum", "spectrogram", "meter", "number"];

serverTest("a scope opens as each of its views, and what it draws moves", async (page) => {
    const port = await feltPort(page);
    const before = await page.evaluate(() => studio.scopeCount());
    await page.evaluate((name) => studio.addScope(name), port);
    const card = page.locator("#scopes .scope").last();
    const choice = card.locator("select").first();
    assert.deepEqual(await choice.locator("option").allInnerTexts(), VIEWS);
    await card.scrollIntoViewIfNeeded();
    await demo(page, true);
    await page.waitForTimeout(500);
    // What a canvas shows, and the share of its pixels that are painted.
    const seen = () =>
        card.locator("canvas").evaluate((canvas) => {
            const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d", { willReadFrequently: true });
            copy.drawImage(canvas, 0, 0);
            const { data } = copy.getImageData(0, 0, canvas.width, canvas.height);
            const painted = data.filter((value, i) => i % 4 === 3 && value > 0).length;
            return { part: (4 * painted) / data.length, url: canvas.toDataURL() };
        });
    const pictures = new Set();
    for (const view of VIEWS) {
        await choice.selectOption(view);
        await page.waitForTimeout(900);
        const [first, , second] = [await seen(), await page.waitForTimeout(400), await seen()];
        await picture(page, `view-${view}`);
        assert(second.part > 0.005, `${view}: ${second.part} of it is painted`);
        assert.notEqual(first.url, second.url, `${view} stands still`);
        pictures.add(second.url);
    }
    assert.equal(pictures.size, VIEWS.length);
    await demo(page, false);
    await card.locator('[aria-label^="Remove"]').click();
    assert.equal(await page.evaluate(() => studio.scopeCount()), before);
});

const FAULTY = `Graph(format: 1, about: "An infinity and a limit, for the test of the drawing.", clocks: { "servo": Driver(rate_hz: 1000) }, nodes: {
    "one": Constant(clock: "servo", value: 1e200, quantity: "current"),
    "many": Constant(clock: "servo", value: 1e200),
    "product": Multiply(input: "one", by: "many"),
    "broken": ActuatorSink(current: "product", endpoint: "coil", limit: (peak_a: 1, continuous_a: 1)),
    "much": Constant(clock: "servo", value: 5, quantity: "current"),
    "held": ActuatorSink(current: "much", endpoint: "other", limit: (peak_a: 0.5, continuous_a: 0.5)),
}, endpoints: { "simulated": { "coil": SimulatedHaptuator(), "other": SimulatedHaptuator() } })`;

programTest("the drawing marks where NaN came out and where a limit held", async () => {
    const own = await studioOf("faulty.ron", { files: { "faulty.ron": FAULTY } });
    const page = await open({ at: own.address });
    try {
        await page.evaluate(() => studio.showTab("graph"));
        // The marks by node, as they are seen.
        const marks = () =>
            page.evaluate(() => {
                const { shadowRoot } = document.querySelector("#graph > div");
                return [...shadowRoot.querySelectorAll(".mark")].map((mark) => {
                    const circle = mark.querySelector("circle");
                    const { width } = circle.getBoundingClientRect();
                    return {
                        node: mark.closest("[data-node]").getAttribute("data-node"),
                        isFault: mark.classList.contains("fault"),
                        isSeen: width > 4,
                        colour: getComputedStyle(circle).fill,
                        says: mark.querySelector("title").textContent,
                    };
                });
            });
        await until(page, () => {
            const { shadowRoot } = document.querySelector("#graph > div");
            return shadowRoot.querySelector(".mark.fault") && shadowRoot.querySelector(".mark:not(.fault)");
        });
        const found = await marks();
        const of = (node) => found.find((mark) => mark.node === node);
        assert(of("product")?.isFault && of("product").isSeen, JSON.stringify(found));
        assert.match(of("product").says, /NaN or infinity in \d+ frames of product\..*it was the first/);
        assert(of("held") && !of("held").isFault && of("held").isSeen, JSON.stringify(found));
        assert.match(of("held").says, /^limited: /);
        assert.notEqual(of("product").colour, of("held").colour);
        assert(!of("one") && !of("much"), JSON.stringify(found));
        const wires = await page.evaluate(() => {
            const { shadowRoot } = document.querySelector("#graph > div");
            return [...shadowRoot.querySelectorAll("path[data-port].faulty")].map((wire) => wire.getAttribute("data-port"));
        });
        assert(wires.length > 0 && wires.every((port) => port.startsWith("product.")), wires.join(" "));
        await page.waitForTimeout(300);
        await picture(page, "faulty");
        await page.evaluate(() => studio.showNode("product"));
        await until(page, () => document.getElementById("node").textContent.includes("NaN or infinity"));
    } finally {
        await page.context().close();
        await own.end();
    }
});

programTest("two fingers are two hands, each on the tablet of its own", async () => {
    const own = await studioOf("graphs/cookbook/two-hands.ron");
    const page = await open({ at: own.address, hasTouch: true });
    try {
        const ports = ["left.force", "right.force", "left.position", "right.position"];
        await page.evaluate((names) => names.forEach((name) => studio.taps.watch(name)), ports);
        const touch = await fingers(page);
        const force_n = await page.evaluate(() => studio.pad.hands.force_n);
        const are = (left, right) =>
            until(
                page,
                ([names, wanted]) =>
                    names.every((name, i) => {
                        const now = studio.taps.traces.find((trace) => trace.name === name)?.latest();
                        return Math.abs(now - wanted[i]) < 0.01;
                    }),
                [ports.slice(0, 2), [left, right]],
            );
        await touch({ 0: [0.25, 0.5] });
        await are(force_n, 0);
        await touch({ 0: [0.25, 0.5], 1: [0.75, 0.4] });
        await are(force_n, force_n);
        await page.waitForTimeout(200);
        const [left, right] = [await latest(page, "left.position"), await latest(page, "right.position")];
        assert(Math.abs(left) < 0.003 && Math.abs(right) < 0.003, `${left} and ${right} m`); // each in the middle of its own
        await picture(page, "two-hands");
        // Each moves by itself.
        await touch({ 0: [0.25, 0.5], 1: [0.9, 0.4] });
        await page.waitForTimeout(200);
        assert(Math.abs((await latest(page, "right.position")) - 0.048) < 0.003);
        assert(Math.abs(await latest(page, "left.position")) < 0.003);
        await touch({});
        await are(0, 0);
    } finally {
        await page.context().close();
        await own.end();
    }
});

programTest("the tilt of a pen is the orientation of the pad", async () => {
    const own = await studioOf("graphs/cookbook/pen-tilt.ron");
    const page = await open({ at: own.address });
    try {
        const port = "pen.orientation";
        await page.evaluate((name) => studio.taps.watch(name), port);
        assert((await page.evaluate(() => studio.graph.pads[0].channels)).includes("orientation"));
        const hand = await pen(page);
        const turns = (x_deg, y_deg) =>
            until(
                page,
                ([name, wanted]) => {
                    const trace = studio.taps.traces.find((each) => each.name === name);
                    return wanted.every((deg, lane) => Math.abs((trace.latest(lane) * 180) / Math.PI - deg) < 0.1);
                },
                [port, [x_deg, y_deg, 0]],
            );
        await hand.press(0.5, 0.5, 0.4, { tiltX: 0, tiltY: 0 });
        await turns(0, 0);
        // To the right it turns about the axis that points away; towards the person about the one to the right.
        await hand.move(0.52, 0.5, 0.4, { tiltX: 30, tiltY: 0 });
        await turns(0, 30);
        await hand.move(0.54, 0.5, 0.4, { tiltX: 0, tiltY: 20 });
        await turns(20, 0);
        await hand.lift(0.5, 0.5);
    } finally {
        await page.context().close();
        await own.end();
    }
});

test("full pressure is as many newtons as a person says, within bounds, and that is kept", async (page) => {
    const port = await page.evaluate(() => studio.graph.maps[0].force_port);
    const pressed = async (on, wanted_n) => {
        const hand = await pen(on);
        await hand.press(0.5, 0.5, 0.5);
        await until(
            on,
            ([name, wanted]) =>
                Math.abs(studio.taps.traces.find((trace) => trace.name === name)?.latest() / wanted - 1) < 0.02,
            [port, wanted_n],
        );
        await hand.lift(0.5, 0.5);
    };
    const say = async (on, text) => {
        await on.fill("#full-force", text);
        await on.press("#full-force", "Enter");
    };
    const own_n = await page.evaluate(() => studio.graph.pads[0].force_n);
    assert.equal(Number(await page.inputValue("#full-force")), own_n);
    assert.equal(own_n, 3);
    await pressed(page, 1.5);
    await say(page, "6");
    await pressed(page, 3);
    await picture(page, "calibrated");
    await page.reload();
    await ready(page);
    await page.evaluate(() => studio.own());
    await until(page, () => studio.status.owner);
    assert.equal(await page.inputValue("#full-force"), "6");
    await pressed(page, 3);
    // No more than the engine takes, and no less than something.
    await say(page, "500");
    assert.equal(await page.inputValue("#full-force"), "20");
    await pressed(page, 10);
    await say(page, "-1");
    assert.equal(await page.inputValue("#full-force"), "0.1");
    await say(page, "");
    await until(page, (own) => Number(document.getElementById("full-force").value) === own, own_n);
    await pressed(page, 1.5);
});

// A picture of one colour.
const PNG = "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNkYPhfDwAChwGA60e6kgAAAABJRU5ErkJggg==";

test("a photograph that is dropped is that of the surface on the pad, and of no other", async (page) => {
    await page.evaluate(() => studio.showTab("surfaces"));
    const cards = page.locator("#surfaces .surface");
    if ((await cards.count()) < 2 || (await cards.first().isDisabled())) return;
    const shown = () => page.evaluate(() => document.getElementById("pad-swatch").style.backgroundImage);
    const choose = async (path) => {
        await page.click(`#surfaces .surface[data-path=${JSON.stringify(path)}]`);
        await until(page, (wanted) => studio.currentSurface()?.path === wanted, path);
    };
    const [first, second] = await page.evaluate(() => {
        const now = studio.currentSurface().path;
        return [now, studio.graph.surfaces.find(({ path }) => path !== now).path];
    });
    const swatch = await shown();
    assert(!swatch.includes("blob:"), "it has a photograph already");
    const transfer = await page.evaluateHandle((base64) => {
        const data = new DataTransfer();
        const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
        data.items.add(new File([bytes], "my-tile.png", { type: "image/png" }));
        return data;
    }, PNG);
    await page.dispatchEvent("body", "drop", { dataTransfer: transfer });
    await until(page, () => document.getElementById("pad-swatch").style.backgroundImage.includes("blob:"));
    const photo = await shown();
    // The browser shows it: the policy of the page lets it.
    const address = photo.match(/blob:[^"]+/)[0];
    assert(await page.evaluate((src) => Object.assign(new Image(), { src }).decode().then(() => true), address));
    await picture(page, "photo");
    await choose(second);
    assert(!(await shown()).includes("blob:"), "the photograph hides another surface");
    await choose(first);
    assert.equal(await shown(), photo);
    await page.evaluate(() => {
        studio.photos.clear();
        studio.emit("photo");
    });
    assert.equal(await shown(), swatch);
});
