// What keeps actuators and ears safe: STOP, who may end it, what is armed, and silence where nobody looks.
import assert from "node:assert/strict";
import { networkInterfaces } from "node:os";
import { coil } from "./coil.mjs";
import {
    address,
    AS_PHONE,
    demo,
    feltPort,
    level,
    open,
    picture,
    programTest,
    ready,
    serverTest,
    studioOf,
    test,
    until,
} from "./harness.mjs";
import { proxyTo } from "./proxy.mjs";

const FIRST_GAIN = 0.1; // -20 dB
const CUT_MS = 500; // a cut sound has long ended by then
const LOST = /WebSocket|ERR_|Failed to load/; // what a browser says of a connection that a test cuts

const gain = (page) => page.evaluate(() => studio.sound.gain);
const turnSoundOn = async (page) => {
    if (!(await page.evaluate(() => studio.sound.on))) await page.click("#sound");
    await until(page, (wanted) => Math.abs(studio.sound.gain / wanted - 1) < 0.05, FIRST_GAIN);
};
const resume = async (page) => {
    await page.click("#pad-cover-button");
    await until(page, () => studio.runs && studio.status.owner);
};

test("the sound begins at -20 dB", async () => {
    const page = await open();
    assert.deepEqual([await gain(page), await page.textContent("#level-text")], [0, "−20 dB"]);
    await page.click("#sound");
    const gains = [];
    for (let i = 0; i < 20; i++) {
        gains.push(await gain(page));
        await page.waitForTimeout(40);
    }
    const most = Math.max(...gains);
    assert(Math.abs(most / FIRST_GAIN - 1) < 0.05, `it came to ${most}`);
    await page.context().close();
});

test("a page that nobody sees is silent, and is heard again when it is seen", async (page) => {
    const setHidden = (hidden) =>
        page.evaluate((value) => {
            for (const [name, now] of [
                ["hidden", value],
                ["visibilityState", value ? "hidden" : "visible"],
            ])
                Object.defineProperty(document, name, { value: now, configurable: true });
            document.dispatchEvent(new Event("visibilitychange"));
        }, hidden);
    const port = await feltPort(page);
    await turnSoundOn(page);
    await demo(page, true);
    await page.waitForTimeout(800);
    assert((await level(page, port, 0.3)) > 0.01, "nothing vibrates");
    await setHidden(true);
    await until(page, () => studio.pad.hands.down.length === 0 && studio.sound.gain < 1e-3);
    await page.waitForTimeout(900);
    assert((await level(page, port, 0.2)) < 1e-3, "it vibrates while nobody looks");
    await setHidden(false);
    await until(page, (wanted) => Math.abs(studio.sound.gain / wanted - 1) < 0.05, FIRST_GAIN);
});

serverTest("no status from before STOP brings the sound back", async (page) => {
    const proxy = await proxyTo(address);
    const mine = await open({ at: proxy.address, expected: LOST });
    await mine.evaluate(() => studio.own());
    await until(mine, () => studio.status.owner);
    await turnSoundOn(mine);
    proxy.hold(); // the engine's confirmation does not come
    const seen = await mine.evaluate(async (wait_ms) => {
        const running = { ...studio.status };
        studio.stop();
        const until_ms = performance.now() + wait_ms;
        while (performance.now() < until_ms) {
            studio.connection.emit("status", { ...running });
            await new Promise((done) => setTimeout(done, 20));
        }
        return { state: studio.status.state, gain: studio.sound.gain, cover: document.getElementById("pad-cover").innerText };
    }, CUT_MS);
    assert.equal(seen.state, "stopping");
    assert(seen.gain < 1e-3, `the sound came back to ${seen.gain}`);
    assert.match(seen.cover, /^Stopping/);
    await picture(mine, "stopping");
    proxy.release();
    await until(mine, () => studio.status.state === "stopped");
    assert((await gain(mine)) < 1e-3);
    await resume(mine);
    await until(mine, (wanted) => Math.abs(studio.sound.gain / wanted - 1) < 0.05, FIRST_GAIN);
    await mine.context().close();
    proxy.close();
    await until(page, () => studio.status.owner);
});

serverTest("a STOP without a connection stops the engine when there is one, and whoever resumes takes over", async (page) => {
    const proxy = await proxyTo(address);
    const mine = await open({ at: proxy.address, expected: LOST });
    await until(mine, () => studio.status.owner === false);
    await page.evaluate(() => studio.own());
    proxy.cut();
    await until(mine, () => !studio.connection.open);
    await mine.keyboard.press("Escape");
    assert.match(await mine.textContent("#banner"), /STOP is sent as soon as it answers/);
    await until(mine, () => document.getElementById("status-text").textContent.includes("STOP is sent"));
    await picture(mine, "stop-unsent");
    assert.equal(await page.evaluate(() => studio.status.state), "running");
    proxy.mend();
    for (const each of [mine, page]) await until(each, () => studio.status?.state === "stopped");
    assert.equal(await mine.textContent("#pad-cover-button"), "Take over and resume");
    await picture(mine, "stopped-by-another");
    await resume(mine);
    await until(page, () => studio.status.state === "running" && !studio.status.owner);
    await mine.context().close();
    proxy.close();
    await until(page, () => studio.status.owner);
});

programTest("a page of a studio that was killed and started anew says so, tries no more, and takes the new link", async () => {
    const first = await studioOf("graphs/texturepad.ron");
    const page = await open({ at: first.address, expected: LOST });
    await first.end("SIGKILL");
    await until(page, () => !studio.connection.open);
    // Without a server it tries again, after longer and longer pauses.
    await until(page, () => studio.lost.wait_s > 1);
    assert.match(await page.textContent("#banner"), /Trying again in/);
    const next = await studioOf("graphs/texturepad.ron", { more: ["--port", new URL(first.address).port] });
    try {
        await until(page, () => studio.lost.wait_s === null);
        assert.match(await page.textContent("#banner"), /started anew: open the link/);
        await until(page, () => document.getElementById("status-text").textContent.includes("started anew"));
        const tries = [];
        page.on("websocket", () => tries.push("again"));
        page.on("request", () => tries.push("again"));
        await page.waitForTimeout(10_000); // longer than the longest pause
        assert.deepEqual(tries, []);
        await picture(page, "restarted-light");
        await page.emulateMedia({ colorScheme: "dark" });
        await picture(page, "restarted-dark");
        await page.fill(".link-field input", "no link");
        await page.click(".link-field button");
        assert.equal(await page.getAttribute(".link-field input", "aria-invalid"), "true");
        const old = page.url();
        await page.fill(".link-field input", next.address);
        await page.keyboard.press("Enter");
        await ready(page);
        await page.goto(old);
        assert.match(await page.textContent("body"), /of a studio that was closed/);
    } finally {
        await page.context().close();
        await next.end();
    }
});

programTest("a page of the network stops, and says that it cannot resume and why it has no sound", async () => {
    // An address of this machine in a network is no secure context to a browser; 127.0.0.2 stands for one that has none.
    const own_address = Object.values(networkInterfaces())
        .flat()
        .find(({ family, internal }) => family === "IPv4" && !internal)?.address;
    const lan = own_address ?? "127.0.0.2";
    const own = await studioOf("graphs/texturepad.ron", { more: [`--lan=${lan}`] });
    const near = await open({ at: own.addresses.find((each) => each.includes("127.0.0.1")) });
    const far = await open({ at: own.addresses.find((each) => each.includes(lan)), ...AS_PHONE });
    try {
        if (own_address) {
            await far.waitForTimeout(400);
            assert.match(await far.evaluate(() => studio.sound.obstacle), /plain HTTP, so browsers play no sound/);
            assert.equal(await far.isDisabled("#sound"), true);
        }
        await far.tap("#pad-cover-button");
        await until(far, () => studio.status.owner);
        assert.equal(await far.evaluate(() => (studio.editNode("speed"), document.querySelectorAll(".by-hand").length)), 0, "it may not edit");
        await far.tap("#stop");
        for (const each of [near, far]) await until(each, () => studio.status.state === "stopped");
        assert.match(await far.textContent("#pad-cover-text"), /cannot resume: resume on the studio's own machine/);
        assert.equal(await far.isVisible("#pad-cover-button"), false);
        await picture(far, "phone-stopped");
        await resume(near);
        await until(far, () => studio.status.state === "running" && !studio.status.owner);
    } finally {
        await Promise.all([near.context().close(), far.context().close()]);
        await own.end();
    }
});

const ASKED_A = 0.5;
const DRIVEN = (
    place,
) => `Graph(format: 1, about: "A constant current, for the test of what is armed.", clocks: { "servo": Driver(rate_hz: 1000) }, nodes: {
    "one": Constant(clock: "servo", value: ${ASKED_A}, quantity: "current"),
    "out": ActuatorSink(current: "one", endpoint: "coil", limit: (peak_a: 1, continuous_a: 1)),
}, endpoints: {
    "simulated": { "coil": SimulatedHaptuator() },
    "live": { "coil": UdpDevice(listen: "${place}", timeout_ms: 1000) },
})`;

programTest("a real actuator rises when it is armed, and falls at STOP and where the page sees no status", async () => {
    const device = await coil();
    const own = await studioOf("driven.ron", { files: { "driven.ron": DRIVEN(device.place) }, more: ["--live"] });
    const proxy = await proxyTo(own.address);
    const page = await open({ at: proxy.address, expected: LOST });
    const near = (current, part) => Math.abs(current - part * ASKED_A) < 1e-6;
    const until_driven = async (is_wanted, limit_ms = 10_000) => {
        const [all, until_ms] = [[], performance.now() + limit_ms];
        while (performance.now() < until_ms) {
            all.push(...device.take());
            if (all.length && is_wanted(all.at(-1))) return all;
            await page.waitForTimeout(20);
        }
        throw new Error(`it never was: ${all.slice(-20)}`);
    };
    const arm = async () => {
        await page.click("#arm");
        const rise = await until_driven((current) => near(current, FIRST_GAIN));
        assert(Math.max(...rise) <= FIRST_GAIN * ASKED_A + 1e-6, `it rose to ${Math.max(...rise)} A`);
        await until(page, () => document.getElementById("real").dataset.armed === "true");
        return rise;
    };
    // A run that is stopped sends nothing more.
    const assertSilent = async (least = 50) => {
        await until_driven((current) => current === 0);
        await page.waitForTimeout(400);
        const driven = device.take();
        assert(driven.length >= least && driven.every((current) => current === 0), `${driven.length}: ${driven.slice(0, 5)} A`);
    };
    try {
        await until_driven(() => true);
        assert.match(await page.textContent("#real-text"), /^Not armed: coil .*gets zeros/);
        await picture(page, "not-armed");
        await assertSilent();

        const rise = await arm();
        assert(
            rise.some((current) => current > 0 && current < 0.5 * FIRST_GAIN * ASKED_A),
            "it jumped",
        );
        assert.match(await page.textContent("#real-text"), /^Armed: coil .*moves/);
        await picture(page, "armed");
        // Where the machine is busy for 0.3 s nobody holds it: then it is disarmed, as it should be.
        for (let tries = 1; ; tries++) {
            try {
                await page.fill("#arm-level", "-6", { timeout: 2000 });
                break;
            } catch (error) {
                if (tries === 5) throw error;
                if ((await page.getAttribute("#real", "data-armed")) === "false") await arm();
            }
        }
        await until_driven((current) => near(current, 10 ** (-6 / 20)));
        await page.click("#stop");
        await assertSilent(0);
        await until(page, () => studio.status.state === "stopped");
        assert.equal(await page.isDisabled("#arm"), true);

        await resume(page);
        await until(page, () => !document.getElementById("arm").disabled);
        await arm();
        // The page goes on, but the engine's statuses do not come.
        proxy.hold();
        await until_driven((current) => current === 0, 3000);
        await until(page, () => /^The engine has sent nothing for/.test(document.getElementById("status-text").textContent));
        proxy.release();
        await until(page, () => document.getElementById("real").dataset.armed === "false");
        await assertSilent();

        await arm();
        await page.click("#arm");
        await assertSilent();
    } finally {
        await page.context().close();
        proxy.close();
        await own.end();
        device.close();
    }
});
