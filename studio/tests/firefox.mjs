// A site in Firefox, driven by its Marionette port: the gallery leads to a graph, which runs and sounds: node firefox.mjs SITE
// Firefox runs no sound without a device: a sound daemon (Debian's pulseaudio) plays to nobody.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { existsSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { connect } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { serve } from "./serve.mjs";

const PATIENCE_MS = 60_000;
const PORT = 2828 + (process.pid % 1000);
const PREFERENCES = {
    "marionette.port": PORT,
    "media.autoplay.default": 0,
    "media.autoplay.blocking_policy": 0,
    "browser.shell.checkDefaultBrowser": false,
    "datareporting.policy.dataSubmissionEnabled": false,
};

const wait = (ms) => new Promise((done) => setTimeout(done, ms));

// A message is its length, a colon, and JSON: [0, number, command, parameters], answered by [1, number, error, result].
class Marionette {
    #socket;
    #text = Buffer.alloc(0);
    #waiting = new Map();
    #next = 1;

    constructor(socket) {
        this.#socket = socket;
        socket.on("data", (bytes) => this.#take(bytes));
    }

    static async open() {
        const until = Date.now() + PATIENCE_MS;
        while (Date.now() < until) {
            const socket = connect(PORT, "127.0.0.1");
            const isOpen = await new Promise((done) => socket.on("connect", () => done(true)).on("error", () => done(false)));
            if (isOpen) return new Marionette(socket);
            await wait(300);
        }
        throw new Error("Firefox does not listen");
    }

    #take(bytes) {
        this.#text = Buffer.concat([this.#text, bytes]);
        for (;;) {
            const colon = this.#text.indexOf(58);
            const length = Number(this.#text.subarray(0, colon));
            if (colon < 0 || this.#text.length < colon + 1 + length) return;
            const message = JSON.parse(this.#text.subarray(colon + 1, colon + 1 + length));
            this.#text = this.#text.subarray(colon + 1 + length);
            if (Array.isArray(message)) this.#waiting.get(message[1])?.(message);
        }
    }

    call(command, parameters = {}) {
        const number = this.#next++;
        const text = JSON.stringify([0, number, command, parameters]);
        this.#socket.write(`${Buffer.byteLength(text)}:${text}`);
        return new Promise((done, failed) =>
            this.#waiting.set(number, ([, , error, result]) => (error ? failed(new Error(`${command}: ${error.message}`)) : done(result))),
        );
    }

    async look(script) {
        return (await this.call("WebDriver:ExecuteScript", { script: `const studio = (window.wrappedJSObject ?? window).studio; ${script}`, args: [] })).value;
    }

    async until(what, script) {
        const until = Date.now() + PATIENCE_MS;
        let why = "";
        while (Date.now() < until) {
            if (await this.look(script).catch((error) => void (why = error.message))) return;
            await wait(200);
        }
        const state = "return JSON.stringify([studio?.status, studio?.lost, studio?.connection.engine?.context?.state, studio?.sound.report])";
        throw new Error(`waited for: ${what}; ${why} ${await this.look(state)}`);
    }

    async press(selector) {
        const { value } = await this.call("WebDriver:FindElement", { using: "css selector", value: selector });
        await this.call("WebDriver:ElementClick", { id: Object.values(value)[0] });
    }
}

const served = await serve(process.argv[2]);
const profile = mkdtempSync(join(tmpdir(), "haptograph-firefox-"));
const lines = Object.entries(PREFERENCES).map(([name, value]) => `user_pref("${name}", ${JSON.stringify(value)});\n`);
writeFileSync(join(profile, "user.js"), lines.join(""));
const socket = join(profile, "sound");
const modules = [`module-native-protocol-unix socket=${socket} auth-anonymous=1`, "module-null-sink rate=48000"];
const options = ["-n", "--daemonize=no", "--use-pid-file=no", "--exit-idle-time=-1", "--disable-shm=yes", "--realtime=no", "--high-priority=no"];
const own = { XDG_RUNTIME_DIR: profile, PULSE_RUNTIME_PATH: profile };
const daemon = spawn("pulseaudio", [...options, ...modules.flatMap((module) => ["-L", module])], { stdio: "ignore", env: { ...process.env, ...own } });
daemon.on("error", () => console.log("there is no pulseaudio"));
while (!existsSync(socket) && daemon.exitCode === null && daemon.pid) await wait(100);
const firefox = spawn(process.env.FIREFOX ?? "firefox-esr", ["--headless", "--marionette", "--no-remote", "--profile", profile], {
    stdio: "ignore",
    env: { ...process.env, PULSE_SERVER: `unix:${socket}` },
});
try {
    const page = await Marionette.open();
    const { capabilities } = await page.call("WebDriver:NewSession", { strictFileInteractability: false });
    await page.call("WebDriver:Navigate", { url: served.address });
    await page.until("the gallery", "return document.querySelectorAll('.card a').length > 20");
    await page.press("#stroke");
    await page.until("the graph", "return Boolean(studio && studio.graph && studio.connection.engine.context)");
    await page.until("the button", "return studio.runs || !document.getElementById('pad-cover-button').hidden");
    if (await page.look("return !studio.runs")) await page.press("#pad-cover-button");
    await page.until("the run", "return studio.runs");
    if (await page.look("return !studio.sound.on")) await page.press("#sound");
    await page.press("#demo");
    await page.until("the sound", "return studio.sound.report && studio.sound.report.peak > 1e-5");
    const [peak, time_s] = await page.look("return [studio.sound.report.peak, studio.status.time_s]");
    assert(peak > 1e-5 && time_s > 0);
    console.log(`ok      ${capabilities.browserName} ${capabilities.browserVersion} strokes ${await page.look("return studio.graph.name")} after ${time_s.toFixed(1)} s, peak ${peak.toFixed(3)}`);
} finally {
    firefox.kill();
    daemon.kill();
    served.close();
    await wait(500);
    rmSync(profile, { recursive: true, force: true });
}
process.exit(0);
