// The page in a real Chromium: node page.mjs WHERE [folder for pictures]; WHERE is the address that a running server printed,
// "http://127.0.0.1:PORT/?token=TOKEN", or the folder of an exported site.
// `npm ci` here brings playwright-core; it drives the system's Chromium: CHROMIUM, else chromium-headless-shell, else chromium.
import assert from "node:assert/strict";
import {
    assertSame,
    feltPort,
    gather,
    latest,
    level,
    open,
    PATIENCE_MS,
    pen,
    picture,
    ready,
    record,
    replay,
    runAll,
    serverTest,
    siteTest,
    stroke,
    test,
    until,
} from "./harness.mjs";

test("the page greets and shows the graph", async (page) => {
    const { version, host, kinds, name } = await page.evaluate(() => ({
        ...studio.hello,
        kinds: studio.hello.kinds.length,
        name: studio.graph.name,
    }));
    assert.equal(version, 1);
    assert(["native", "page"].includes(host));
    assert(kinds > 50, `${kinds} kinds`);
    assert.equal(await page.textContent("#name"), name);
    assert.equal(await page.isVisible("#banner"), false);
    assert(
        (await page.evaluate(() => document.querySelector("#graph > div").shadowRoot.querySelectorAll("[data-node]").length)) > 0,
        "no node is drawn",
    );
    assert(
        (await page.evaluate(
            () => document.querySelector("#graph > div").shadowRoot.querySelectorAll("path[data-port]").length,
        )) > 0,
        "no wire is drawn",
    );
});

test("a stroke of a pen moves the map's point and is seen on a scope", async (page) => {
    const [map, pad] = await page.evaluate(() => [studio.graph.maps[0], studio.graph.pads[0]]);
    const forces = [],
        speeds = [],
        points = [];
    await stroke(page, 0.4, 1800, async () => {
        forces.push(await latest(page, map.force_port));
        speeds.push((await latest(page, map.speed_port)) || 0); // there may be none yet
        points.push(await page.evaluate(() => studio.mapPoint()));
    });
    await picture(page, "stroke");
    const seen = forces.slice(forces.length / 2).sort((a, b) => a - b);
    const force_n = seen[Math.floor(seen.length / 2)];
    assert(Math.abs(force_n / (0.4 * pad.force_n) - 1) < 0.1, `0.4 of ${pad.force_n} N arrived as ${force_n} N`);
    assert(Math.max(...speeds) > 0.02, `the speed never passed ${Math.max(...speeds)} m/s`);
    const fastest = points.filter(Boolean).reduce((most, { speed }) => Math.max(most, speed), 0);
    assert(fastest > 0.02, `the map's point never passed ${fastest} m/s`);
    assert((await page.evaluate(() => studio.scopeCount())) > 0, "no scope is open");
    await page.waitForTimeout(600);
    assert((await latest(page, map.force_port)) < 0.01, "the lifted pen still presses");
});

test("the vibration grows with the stroke and ends with it", async (page) => {
    const port = await feltPort(page);
    if (!port) return;
    let during = 0;
    await stroke(page, 0.4, 1500, async (part) => part > 0.6 && (during = Math.max(during, await level(page, port, 0.3))));
    await page.waitForTimeout(900);
    const after = await level(page, port, 0.2);
    assert(during > 0.01, `${during} m/s² while stroking`);
    assert(after < during / 20, `${after} m/s² after, ${during} while stroking`);
});

test("a click on a wire puts it on a scope, one on a node shows its card", async (page) => {
    await page.evaluate(() => studio.showTab("graph"));
    await page.waitForTimeout(300);
    const [wire, node, port, path] = await page.evaluate(() => {
        const drawn = document.querySelector("#graph > div").shadowRoot;
        const grab = drawn.querySelector("[data-wire]");
        const middle = grab.getPointAtLength(grab.getTotalLength() / 2).matrixTransform(grab.getScreenCTM());
        const box = drawn.querySelector("[data-node]");
        const { x, y, width } = box.getBoundingClientRect();
        return [[middle.x, middle.y], [x + width / 2, y + 10], grab.dataset.wire, box.dataset.node];
    });
    const before = await page.evaluate(() => studio.scopeCount());
    await page.mouse.click(...wire);
    await page.waitForFunction((count) => studio.scopeCount() === count + 1, before, { timeout: PATIENCE_MS });
    await page.waitForFunction((name) => studio.taps.traces.some((trace) => trace.name === name && trace.count > 0), port, {
        timeout: PATIENCE_MS,
    });
    await page.mouse.click(...node);
    await page.waitForFunction((name) => document.querySelector("#node h3")?.textContent === name, path, {
        timeout: PATIENCE_MS,
    });
    await picture(page, "node");
    await page.click("#node >> text=Close");
});

test("the drawing shows how strong each wire is, and what each node costs where there is a clock", async (page) => {
    await page.evaluate(() => studio.showTab("graph"));
    await page.click("#demo");
    const drawn = (look) => page.waitForFunction(look, null, { timeout: PATIENCE_MS });
    await drawn(() => {
        const { shadowRoot } = document.querySelector("#graph > div");
        const wires = [...shadowRoot.querySelectorAll("path[data-port]")];
        return wires.filter((wire) => Number(wire.style.strokeWidth) > 2).length > 3;
    });
    await drawn(() => {
        const { shadowRoot } = document.querySelector("#graph > div");
        const percents = [...shadowRoot.querySelectorAll(".cost text")].map((text) => parseInt(text.textContent, 10));
        const sum = percents.reduce((all, percent) => all + percent, 0);
        const key = document.querySelector(".graph-key").textContent;
        return studio.hello.host === "page" ? key.includes("not measured") : sum > 80 && sum < 120;
    });
    await picture(page, "levels");
    await page.click("#demo");
});

serverTest("a setting arrives at another page", async (page) => {
    const setting = await page.evaluate(
        () => studio.graph.settings.find(({ min, max }) => min !== null && max !== null) ?? studio.graph.settings[0],
    );
    const other = await open();
    const value = Number(
        ((setting.min ?? setting.value * 0.8) * 0.4 + (setting.max ?? setting.value * 1.2) * 0.6).toPrecision(3),
    );
    await page.evaluate((tab) => studio.showTab(tab), "controls");
    const field = page.locator(`#controls [title="${setting.name}"] ~ input[type=number]`);
    await field.fill(String(value));
    await field.press("Tab");
    await other.waitForFunction(
        ([name, wanted]) => Math.abs(studio.values.get(name) - wanted) < 1e-9 * Math.abs(wanted),
        [setting.name, value],
        { timeout: PATIENCE_MS },
    );
    await picture(page, "controls");
    await field.fill(String(setting.value));
    await field.press("Tab");
    await other.context().close();
});

test("an error in the text is shown inline and the sound goes on", async (page) => {
    await page.click("#sound");
    await page.click("#demo");
    await page.waitForFunction(() => studio.sound.report?.playing && studio.sound.report.peak > 1e-5, null, {
        timeout: PATIENCE_MS,
    });
    await page.evaluate(() => {
        studio.showTab("editor");
        const text = studio.editor.state.doc.toString();
        const at = text.indexOf("SpeedEstimator(");
        studio.editor.dispatch({
            changes: { from: at, to: at + "SpeedEstimator".length, insert: "SpeedEstimatr" },
            selection: { anchor: at },
            scrollIntoView: true,
        });
    });
    await page.waitForSelector("#problems li", { timeout: PATIENCE_MS });
    await page.waitForSelector(".cm-lintRange-error, .cm-lint-marker-error", { timeout: PATIENCE_MS });
    await page.click("#editor-apply");
    await page.waitForFunction(() => document.getElementById("editor-state").textContent.startsWith("Not applied"), null, {
        timeout: PATIENCE_MS,
    });
    await picture(page, "error");
    assert.equal(await page.evaluate(() => studio.graph.text.includes("SpeedEstimatr")), false);
    await page.waitForTimeout(700);
    const report = await page.evaluate(() => studio.sound.report);
    assert(report.playing && report.peak > 1e-5, `the sound ended: ${JSON.stringify(report)}`);
    await page.click("#editor-revert");
    await page.waitForFunction(() => document.querySelectorAll("#problems li").length === 0, null, { timeout: PATIENCE_MS });
});

test("a good edit takes over", async (page) => {
    const before = await page.evaluate(() => studio.graph.text);
    await page.evaluate(() => studio.editor.dispatch({ changes: { from: 0, insert: "// one more remark\n" } }));
    await page.focus(".cm-content");
    await page.keyboard.press("Control+Enter");
    await page.waitForFunction(() => studio.graph.text.startsWith("// one more remark"), null, { timeout: PATIENCE_MS });
    assert.equal(await page.evaluate(() => studio.graph.saved), false);
    await page.evaluate(
        (text) => studio.editor.dispatch({ changes: { from: 0, to: studio.editor.state.doc.length, insert: text } }),
        before,
    );
    await page.click("#editor-apply");
    await page.waitForFunction((text) => studio.graph.text === text, before, { timeout: PATIENCE_MS });
});

test("a swatch puts its surface on the pad", async (page) => {
    await page.evaluate(() => studio.showTab("surfaces"));
    const cards = page.locator("#surfaces .surface");
    if ((await cards.count()) < 2 || (await cards.first().isDisabled())) return;
    const before = page.locator("#surfaces .surface[aria-pressed=true]");
    const path = await before.getAttribute("data-path");
    const points = await page.evaluate(() => JSON.stringify(studio.graph.maps[0].points));
    await page.click("#surfaces .surface[aria-pressed=false] >> nth=0");
    await page.waitForFunction(
        (old) => document.querySelector("#surfaces .surface[aria-pressed=true]")?.dataset.path !== old,
        path,
        { timeout: PATIENCE_MS },
    );
    await page.waitForFunction((old) => JSON.stringify(studio.graph.maps[0].points) !== old, points, { timeout: PATIENCE_MS });
    await picture(page, "surfaces");
    await page.click(`#surfaces .surface[data-path=${JSON.stringify(path)}]`);
    await page.waitForFunction(
        (old) => document.querySelector("#surfaces .surface[aria-pressed=true]")?.dataset.path === old,
        path,
        { timeout: PATIENCE_MS },
    );
});

test("STOP is a key and a button, and only Resume ends it", async (page) => {
    await page.evaluate(() => studio.showTab("graph"));
    if ((await page.getAttribute("#demo", "aria-pressed")) === "false") await page.click("#demo");
    await page.click("h2 >> nth=0");
    for (const stop of [() => page.keyboard.press("Escape"), () => page.keyboard.press("."), () => page.click("#stop")]) {
        await stop();
        await page.waitForFunction(() => studio.status.state === "stopped" && studio.pad.hands.down.length === 0, null, {
            timeout: PATIENCE_MS,
        });
        await page.waitForTimeout(400);
        assert.equal(await page.evaluate(() => studio.status.state), "stopped");
        assert(await page.evaluate(() => studio.status.actuators.every(({ peak }) => peak === 0)), "a drive is not at zero");
        await picture(page, "stopped");
        await page.click("#pad-cover-button");
        await page.waitForFunction(() => studio.status.state === "running", null, { timeout: PATIENCE_MS });
    }
});

test("Escape closes what is open, and stops only then; the full stop stops at once", async (page) => {
    await page.evaluate(() => studio.showTab("graph"));
    const running = () => page.evaluate(() => studio.connection.stopping === false && studio.status.state === "running");
    const isOpen = () => page.evaluate(() => !document.getElementById("node").hidden || document.querySelector(":popover-open") !== null);
    const opening = [
        () => page.evaluate(() => studio.showNode(studio.graph.settings[0].node)),
        () => page.evaluate(() => document.getElementById("figures-help").showPopover()),
    ];
    for (const open of opening) {
        await open();
        assert(await isOpen());
        await page.click("h2 >> nth=0", { trial: true });
        await page.keyboard.press("Escape");
        await page.waitForTimeout(300);
        assert(!(await isOpen()) && (await running()));
    }
    await opening[0]();
    await page.keyboard.press(".");
    await page.waitForFunction(() => studio.status.state === "stopped", null, { timeout: PATIENCE_MS });
    await page.evaluate(() => studio.showNode(null));
    await page.click("#pad-cover-button");
    await page.waitForFunction(() => studio.status.state === "running", null, { timeout: PATIENCE_MS });
});

serverTest("of two pages one owns the pad", async (page) => {
    const other = await open();
    await other.waitForTimeout(300);
    assert.equal(await other.evaluate(() => studio.status.owner), false);
    await other.click("#pad-cover-button");
    await other.waitForFunction(() => studio.status.owner, null, { timeout: PATIENCE_MS });
    await page.waitForFunction(() => !studio.status.owner, null, { timeout: PATIENCE_MS });
    await page.click("#pad-cover-button");
    await page.waitForFunction(() => studio.status.owner, null, { timeout: PATIENCE_MS });
    await other.context().close();
});

test("the pad is stroked by the arrow keys", async (page) => {
    const force_port = await page.evaluate(() => studio.graph.maps[0].force_port);
    await page.focus("#pad");
    await page.keyboard.down("ArrowRight");
    await page.waitForTimeout(500);
    assert((await latest(page, force_port)) > 0.1, "the keys do not press");
    await page.keyboard.up("ArrowRight");
    await page.waitForTimeout(500);
    assert((await latest(page, force_port)) < 0.01, "the keys still press");
});

test("a recorded stroke is done again with the same samples", async (page) => {
    await gather(page, await page.evaluate(() => `${studio.graph.actuators[0].name}.delivered`));
    const { recording, run } = await record(page, 0.4, 1200);
    assertSame(recording, run, await replay(page));
    await page.reload();
    await ready(page);
    await page.evaluate(() => studio.own());
});

test("two surfaces lie side by side, and the hand feels the one that it is on", async (page) => {
    await page.evaluate(() => studio.showTab("surfaces"));
    if (await page.locator("#compare").isHidden()) return;
    await page.click("#compare");
    const [left, right] = await page.evaluate(() => studio.compared.map(({ path }) => path));
    const runs = () => page.evaluate(() => studio.currentSurface().path);
    const hand = await pen(page);
    for (const [x, surface] of [
        [0.25, left],
        [0.75, right],
        [0.25, left],
    ]) {
        await hand.press(x, 0.5, 0.4);
        await page.waitForFunction((path) => studio.currentSurface()?.path === path, surface, { timeout: PATIENCE_MS });
        await hand.lift(x, 0.5);
    }
    await picture(page, "compare");
    await page.check("#blind");
    assert.equal(await page.locator("#surfaces .surface[aria-pressed=true]:visible").count(), 0, "it shows which is which");
    await picture(page, "blind");
    await page.uncheck("#blind");
    await page.click("#compare");
    assert([left, right].includes(await runs()));
});

siteTest("how long an edit keeps the sound is shown", async (page) => {
    const was = await page.evaluate(() => studio.sound.on);
    if (!was) await page.click("#sound");
    await page.waitForFunction(() => studio.sound.on);
    const took_ms = await page.evaluate(async () => {
        const { text } = studio.graph;
        const begun = performance.now();
        const reply = await studio.connection.request({ type: "apply", text: `// again\n${text}` });
        return reply.ok ? performance.now() - begun : -1;
    });
    assert(took_ms >= 0, "the edit was refused");
    await page.waitForFunction(() => /edit \d+ ms/.test(document.getElementById("status-figures").textContent));
    const kept_ms = await page.evaluate(() => studio.sound.report.edit_ms);
    console.log(`        an edit took ${took_ms.toFixed(0)} ms and kept the sound for ${kept_ms} ms`);
    if (!was) await page.click("#sound");
});

siteTest("a link carries the text that was changed", async (page) => {
    const text = `// from a link\n${await page.evaluate(() => studio.graph.text)}`;
    assert((await page.evaluate((text) => studio.connection.request({ type: "apply", text }), text)).ok);
    await page.waitForFunction((text) => studio.graph.text === text, text);
    await page.evaluate(() => document.getElementById("preset-link").click());
    const there = await open({ at: await page.getAttribute("#preset-link", "data-address") });
    await until(there, (text) => studio.graph.text === text, text);
    await there.context().close();
});

siteTest("an edit that the engine refused leaves the checker with what runs", async (page) => {
    const ask = (message) => page.evaluate((said) => studio.connection.request(said), message);
    const text = await page.evaluate(() => studio.graph.text);
    const without = text.replace('"gain": 1.0,', "").replace('Param("gain")', "1.0");
    assert.notEqual(text, without);
    await page.click("#record");
    await page.waitForFunction(() => studio.status.recording_s !== null, null, { timeout: PATIENCE_MS });
    const refused = await ask({ type: "apply", text: without });
    assert(!refused.ok && /recording/.test(refused.error), refused.error);
    await page.click("#record");
    await page.waitForFunction(() => studio.status.recording_s === null && studio.runs, null, { timeout: PATIENCE_MS });
    for (const value of ["0.9", "1.0"]) {
        const reply = await ask({ type: "parameter", name: "gain", value });
        assert(reply.ok, `${reply.error}: ${JSON.stringify(reply.diagnostics)}`);
    }
});

for (const others of ["safe", "work", "hand", "move", "seen", "views", "study", "site"]) await import(`./page-${others}.mjs`);
process.exit((await runAll()) ? 1 : 0);
