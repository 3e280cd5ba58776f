// What a person moves: inputs without a pad, several pads, simulated hands, replays, and what is assigned to the controls.
import assert from "node:assert/strict";
import { join } from "node:path";
import { AS_PHONE, AXE, besideTest, demo, drop, fingers, latest, level, open, picture, programTest, record, studioOf, test, until } from "./harness.mjs";

const FADERS = `Graph(format: 1, about: "A hum that two faders set.",
    clocks: { "audio": Driver(rate_hz: 48000), "control": Derived(of: "audio", rate_hz: 125) }, nodes: {
    "pitch": LiveInput(clock: "control", endpoint: "pitch", quantity: "frequency"),
    "loud": LiveInput(clock: "control", endpoint: "loud"),
    "tone": Sine(clock: "audio", frequency: Linear("pitch"), amplitude: 4, quantity: "acceleration"),
    "hum": Multiply(input: "tone", by: Linear("loud")),
    "drive": DynamicCompensator(acceleration: "hum"),
    "out": ActuatorSink(current: "drive", endpoint: "coil", limit: (peak_a: 0.5, continuous_a: 0.25)),
}, endpoints: { "simulated": {
    "pitch": SimulatedInput(to: [80, 320]), "loud": SimulatedInput(to: [0.2, 1], period_s: 3), "coil": SimulatedHaptuator(),
} })`;
const ofFaders = () => studioOf("faders.ron", { files: { "faders.ron": FADERS } });

// Waits until the latest value of a port is as wanted.
const is = (page, port, wanted, within = 1e-3) =>
    until(page, ([name, to, far]) => Math.abs(studio.taps.traces.find((trace) => trace.name === name)?.latest() - to) < far, [port, wanted, within]);

programTest("an input without a pad has a fader, is held, handed back and silent when its page is", async () => {
    const own = await ofFaders();
    const page = await open({ at: own.address });
    try {
        await page.evaluate(() => ["pitch.value", "out.delivered"].forEach((port) => studio.taps.watch(port)));
        assert(await page.isVisible("#pad-inputs") && !(await page.isVisible("#pad")));
        const number = page.locator('#pad-inputs [aria-label="pitch value, number"]');
        const back = page.locator('#pad-inputs [aria-label="pitch: as the graph has it"]');
        assert(await back.isDisabled());
        await number.fill("190");
        await number.press("Enter");
        await is(page, "pitch.value", 190);
        await page.waitForTimeout(700); // longer than any timeout
        assert(Math.abs((await latest(page, "pitch.value")) - 190) < 1e-3);
        assert((await level(page, "out.delivered", 0.2)) > 1e-3, "it is silent though it is held");
        await picture(page, "inputs");
        await back.click();
        await until(page, () => Math.abs(studio.taps.traces.find(({ name }) => name === "pitch.value").latest() - 190) > 20);
        // Keys do the same.
        await page.locator('#pad-inputs [aria-label="pitch value"]').focus();
        await page.keyboard.press("End");
        await is(page, "pitch.value", 320);
        // A page that says nothing lets go of the actuators; the next one finds the graph's own.
        await page.evaluate(() => (studio.pad.hands.allowed = () => false));
        await until(page, () => studio.status.silent.some(({ input }) => input === "pitch"));
        await page.waitForTimeout(300);
        assert((await level(page, "out.delivered", 0.1)) < 1e-6, "it goes on");
        const other = await open({ at: own.address });
        await other.evaluate(() => studio.own());
        await until(other, () => studio.status.owner && studio.status.silent.length === 0);
        await other.context().close();
    } finally {
        await page.context().close();
        await own.end();
    }
});

programTest("one finger moves the pad that it is on, and two-hands.ron is felt; simulated hands move both", async () => {
    const own = await studioOf("graphs/cookbook/two-hands.ron");
    const page = await open({ at: own.address, hasTouch: true });
    try {
        await page.evaluate(() => ["left.force", "right.force", "right.position", "out.delivered"].forEach((port) => studio.taps.watch(port)));
        const touch = await fingers(page);
        await touch({ 0: [0.85, 0.5] });
        const force_n = await page.evaluate(() => studio.pad.hands.force_n);
        await is(page, "right.force", force_n, 0.01);
        await page.waitForTimeout(600);
        assert.equal(await latest(page, "left.force"), 0);
        assert(Math.abs((await latest(page, "right.position")) - 0.032) < 0.003, `${await latest(page, "right.position")} m`);
        assert((await level(page, "out.delivered", 0.2)) > 1e-3, "one hand is not felt");
        await touch({});
        await demo(page, true);
        await page.waitForTimeout(800);
        for (const port of ["left.force", "right.force"]) assert((await latest(page, port)) > 0.3, port);
        await picture(page, "simulated-hands");
        await demo(page, false);
    } finally {
        await page.context().close();
        await own.end();
    }
});

test("the speed in the engine is that of the gesture", async (page) => {
    const { speed_port: port } = await page.evaluate(() => studio.graph.maps[0]);
    for (const gesture of ["circles", "across", "stop"]) {
        await page.evaluate(
            ([name, how]) => {
                studio.stroked = [];
                studio.forget = studio.connection.on("stroked", ({ number, samples }) => number === 0 && studio.stroked.push(...samples));
                studio.speedTrace = studio.taps.watch(name, true);
                document.getElementById("gesture").value = how;
                document.getElementById("gesture").dispatchEvent(new Event("change"));
            },
            [port, gesture],
        );
        await demo(page, true);
        await page.waitForTimeout(4200);
        const { times, speeds, stroked } = await page.evaluate(() => {
            const [trace, times, speeds] = [studio.speedTrace.copy(), [], []];
            studio.forget();
            studio.taps.release(studio.speedTrace);
            for (let back = Math.floor(2 / trace.interval_s); back > 0; back--) {
                times.push(performance.now() / 1000 + trace.end_s - studio.taps.now_s() - back * trace.interval_s);
                speeds.push(trace.most[trace.place(back)]);
            }
            return { times, speeds, stroked: studio.stroked };
        });
        await demo(page, false);
        // Its own speed, by differences of its positions.
        const at = (time_s) => {
            const i = Math.floor((time_s * 1000 - stroked[0].time_ms) / 4);
            const [a, b] = [stroked[i], stroked[i + 1]];
            return a && b && a.force_n > 0 && b.force_n > 0 ? Math.hypot(b.x_mm - a.x_mm, b.y_mm - a.y_mm) / (b.time_ms - a.time_ms) : null;
        };
        // One lag, that of the estimator and of the page's clock, puts them on each other; where a gesture begins or stops the
        // estimator's filter is seen.
        const smooth = (time_s) => [-0.15, -0.1, -0.05, 0, 0.05].every((d) => Math.abs(at(time_s + d) - at(time_s)) < 0.3 * at(time_s));
        const worst = (lag_s) => {
            const errors = times.flatMap((time_s, i) => {
                const own = at(time_s - lag_s);
                return own > 0.05 && smooth(time_s - lag_s) ? [Math.abs(speeds[i] / own - 1)] : [];
            });
            return errors.length > 20 ? Math.max(...errors) : Infinity;
        };
        const errors = Array.from({ length: 500 }, (_, i) => worst(-0.1 + i * 0.001));
        const least = Math.min(...errors);
        console.log(`        ${gesture}: the speed is within ${(100 * least).toFixed(2)} % (lag ${-100 + errors.indexOf(least)} ms)`);
        assert(least < 0.02, `${gesture}: ${least}`);
    }
});

test("a replay shows the hand on the pad and says at its end that it was", async (page) => {
    await record(page, 0.4, 1500);
    await page.click("#replay");
    const said = () => page.textContent("#status-text");
    await until(page, () => studio.pad.hands.down.some(({ by, samples }) => by === "replay" && samples.at(-1).force_n > 1));
    assert.doesNotMatch(await said(), /replayed/i);
    await picture(page, "replayed");
    await until(page, () => studio.status.replay === null && studio.runs && studio.pad.hands.down.length === 0);
    assert.match(await said(), /^Replayed: of this graph: the same samples/);
});

programTest("a knob, an axis and a key are learned, kept and in the address", async () => {
    const own = await ofFaders();
    const mocks = () => {
        window.asked = 0;
        const input = {};
        const inputs = new Map([["one", input]]);
        navigator.requestMIDIAccess = async () => (window.asked++, { inputs });
        window.knob = (...data) => input.onmidimessage({ data });
        window.pads = [];
        navigator.getGamepads = () => window.pads;
        navigator.permissions.query = async () => ({ state: "prompt" });
    };
    const page = await open({ at: own.address });
    try {
        await page.addInitScript(mocks);
        await page.reload();
        const ready = () => until(page, () => studio.status?.owner);
        await ready();
        await page.evaluate(() => ["pitch.value", "loud.value"].forEach((port) => studio.taps.watch(port)));
        assert.equal(await page.evaluate(() => window.asked), 0, "MIDI was asked for at the start");
        // By keyboard, by a right-click, by a long press.
        const assign = page.locator('#pad-inputs [aria-label="Assign a knob, axis or key to pitch value"]');
        await assign.focus();
        await page.keyboard.press("Enter");
        await until(page, () => window.asked === 1);
        await page.evaluate(() => window.knob(0xb0, 7, 127));
        await is(page, "pitch.value", 320);
        await page.evaluate(() => window.knob(0xb0, 7, 0));
        await is(page, "pitch.value", 80);
        await page.locator("#pad-inputs .control").nth(1).click({ button: "right", position: { x: 5, y: 10 } });
        const axes = (value) => page.evaluate((x) => (window.pads = [{ axes: [x], buttons: [] }]), value);
        await axes(-1);
        await page.waitForTimeout(100);
        await axes(1);
        await is(page, "loud.value", 1);
        await axes(-1);
        await is(page, "loud.value", 0.2);
        await page.evaluate(() => studio.showTab("controls"));
        const gain = page.locator('#controls [aria-label="Assign a knob, axis or key to out gain"]');
        await gain.click();
        await page.keyboard.press("k");
        await page.keyboard.down("k");
        await until(page, () => studio.values.get("out.gain") > 1);
        await page.keyboard.up("k");
        await until(page, () => studio.values.get("out.gain") === 0);
        await picture(page, "assigned");
        const wanted = { "input pitch.value": "midi:cc:0:7", "input loud.value": "pad:axis:0", "out.gain": "key:KeyK" };
        assert.deepEqual(await page.evaluate(() => studio.assignments.sources), wanted);
        // Kept by the browser; MIDI is not asked for again by itself.
        await page.reload();
        await ready();
        assert.deepEqual(await page.evaluate(() => [studio.assignments.sources, window.asked]), [wanted, 0]);
        await page.evaluate(() => studio.showTab("controls"));
        await page.click("#midi");
        await until(page, () => window.asked === 1 && document.getElementById("midi").hidden);
        // In the page's address, also in another browser.
        await page.evaluate(() => studio.set("out.gain", 0.5));
        await page.click("#preset-link");
        const link = new URL(await page.getAttribute("#preset-link", "data-address"));
        assert(!link.searchParams.has("token"), "the token is given away");
        const other = await open({ at: own.address + link.hash });
        await other.evaluate(() => studio.own());
        await until(other, () => studio.values.get("out.gain") === 0.5 && studio.assignments.sources["out.gain"] === "key:KeyK");
        const says = (pattern) => until(other, (text) => new RegExp(text).test(document.getElementById("status-text").textContent), pattern);
        const hash = (text) => other.evaluate((to) => (location.hash = to), text);
        await hash("#preset=a%b");
        await says("at letter 2");
        await hash(`#preset=${"a".repeat(20_000)}`);
        await says("at most 16000");
        const wrong = { haptograph_preset: 1, settings: { "out.gain": "loud", "no.such": 1 }, assignments: { "out.gain": "midi:cc:99:1" } };
        await hash(`#preset=${Buffer.from(JSON.stringify(wrong)).toString("base64url")}`);
        await says("settings, out.gain: \"loud\" is no number; settings, no.such: .*; .*`assignments`, `out.gain`: \"midi:cc:99:1\" is no source");
        await drop(other, "mine.json", "application/json", "{\n  oh");
        await says("mine.json is not a preset: it is not JSON .*position 4");
        await other.context().close();
        // Taken away by the same button.
        await page.locator('#pad-inputs [aria-label^="Take controller 7 of MIDI channel 1 from"]').click();
        assert.equal(await page.evaluate(() => studio.assignments.sources["input pitch.value"]), undefined);
    } finally {
        await page.context().close();
        await own.end();
    }
});

besideTest("the inputs are clean for axe and fit a phone, by day and night", async () => {
    const wrong = [];
    const look = async ([graph, files]) => {
        const own = await studioOf(graph, { files });
        for (const [size, options] of [["wide", {}], ["small", { viewport: { width: 1024, height: 768 } }], ["phone", AS_PHONE]]) {
            for (const colorScheme of ["light", "dark"]) {
                const page = await open({ at: own.address, colorScheme, bypassCSP: true, ...options });
                await page.evaluate(() => (studio.own(), studio.showTab("controls")));
                await page.waitForTimeout(400);
                await page.addScriptTag({ content: AXE });
                const { violations } = await page.evaluate(() => axe.run("main"));
                await picture(page, `move-${graph.split("/").at(-1)}-${size}-${colorScheme}`);
                wrong.push(...violations.flatMap(({ id, nodes }) => nodes.map(({ html }) => `${graph} ${size} ${colorScheme}: ${id} ${html}`)));
                const beyond = () => Math.max(...[...document.querySelectorAll(".controls")].map((each) => each.scrollWidth - each.clientWidth));
                if ((await page.evaluate(beyond)) > 0) wrong.push(`${graph} ${size}: controls are beyond their edge`);
                await page.context().close();
            }
        }
        await own.end();
    };
    await Promise.all([["faders.ron", { "faders.ron": FADERS }], ["graphs/recorder.ron", {}], ["graphs/cookbook/two-hands.ron", {}]].map(look));
    assert.deepEqual(wrong, []);
});

test("by the keyboard alone, twelve keys lead from the opened page to a stroke with sound", async () => {
    const page = await open({ isReady: (page) => until(page, () => window.studio?.hello && studio.graph && studio.pad) });
    await page.evaluate(() => studio.own());
    let presses = 0;
    const press = (key) => (presses++, page.keyboard.press(key));
    const go = async (id) => {
        while (presses < 12 && !(await page.evaluate((id) => document.activeElement?.id === id, id))) await press("Tab");
    };
    await go("sound");
    await press("Enter");
    await go("pad");
    presses++;
    await page.keyboard.down("ArrowRight");
    await until(page, () => studio.sound.report?.playing && studio.sound.report.peak > 1e-3);
    await page.keyboard.up("ArrowRight");
    console.log(`        ${presses} key presses`);
    assert(presses <= 12, `${presses} presses`);
    await page.context().close();
});

test("Escape ends the wait for a knob, and not the run", async (page) => {
    await page.evaluate(() => studio.showTab("controls"));
    const button = page.locator("#controls .assign").first();
    const before = await button.textContent();
    await button.click();
    assert.equal(await button.getAttribute("aria-pressed"), "true");
    await page.keyboard.press("Escape");
    assert.deepEqual([await button.getAttribute("aria-pressed"), await button.textContent()], ["false", before]);
    await page.waitForTimeout(300);
    assert(await page.evaluate(() => studio.runs), "it was a STOP");
});
