// A study on its two pages: whole sessions of two people, by mouse, pen, finger and keys; that the participant's page shows no name; and
// that nothing is lost when the program is killed.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { cpSync, existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { AXE, besideTest, HOME, open, picture, PROGRAM, studioOf, until } from "./harness.mjs";
import { serve } from "./serve.mjs";

const LOST = /WebSocket|ERR_|Failed to load/;

const STUDY = `Study(
    format: 1, about: "zeppelin", graph: "graphs/texturepad.ron", seed: 3,
    surfaces: {
        "zircon": (file: "graphs/surfaces/t2-canvas.ron", sample: "tray zulu"),
        "wolfram": (file: "graphs/surfaces/t5-vinyl.ron"),
    },
    versions: { "quokka": {}, "xylem": { "gain": 0.8125 } },
    scales: { "bogey": (ask: "How rough is it?", from: "smooth", to: "rough") },
    page: (language: "de", masking: Pink, texts: {
        "welcome": "Willkommen", "consent": "Du spürst Flächen und sagst, wie sie sind.", "agree": "Ich mache mit", "next": "Weiter", "stop": "Halt",
    }),
    phases: {
        "yak": Questions(questions: {
            "vole": Choice(ask: "Welche Hand?", of: ["rechts", "links"]), "lynx": Number(ask: "Wie alt?", from: 18, to: 99),
            "ibex": Text(ask: "Noch etwas?"),
        }),
        "marmot": Rate(text: "Streiche darüber.", stimuli: [Real, Virtual], opens_when: { "gedrückt": (port: "stylus.force", at_least_n: 0.2) }),
        "jaguar": Pairs(scale: "bogey", surfaces: ["wolfram"], stimuli: [Virtual]),
        "rook": Break(text: "Pause.", at_least_s: 1),
        "finch": TwoAlternative(ask: "Was ist echter?", surfaces: ["wolfram"]),
        "heron": TwoAlternative(abx: true, ask: "Was ist das dritte?", surfaces: ["wolfram"]),
        "emu": ConstantStimuli(ask: "Was ist stärker?", surface: "wolfram", parameter: "gain", standard: 1.0, levels: [1.5], repeats: 1),
    },
)`;
const SECRETS = ["zeppelin", "zircon", "wolfram", "zulu", "quokka", "xylem", "0.8125", "bogey", "marmot", "jaguar", "emu", "yak", "vole", "lynx", "rook", "finch", "heron"];
SECRETS.push("ibex", "vinyl", ".ron", "texturepad", "1.5");
const TRIALS = 3 + 5 + 1 + 1 + 1 + 1 + 1;
const KILLS = Number(process.env.KILLS ?? 8);

const study = (more = {}) => studioOf("study.ron", { files: { "study.ron": STUDY }, command: ["study", "run"], count: 2, ...more });
const isReady = (name) => (page) => until(page, (of) => window[of]?.view, name);
const pagesOf = async ({ addresses: [mine, theirs] }, how = {}) => [
    await open({ at: mine, isReady: isReady("experimenter"), expected: LOST }),
    await open({ at: theirs, isReady: isReady("participant"), expected: LOST, ...how }),
];
// The study as an exported site; null if the program has no engine for pages.
async function site() {
    if (!existsSync(join(HOME, "studio/engine.wasm"))) return null;
    const root = mkdtempSync(join(tmpdir(), "haptograph-study-"));
    cpSync(join(HOME, "graphs"), join(root, "graphs"), { recursive: true });
    writeFileSync(join(root, "study.ron"), STUDY);
    execFileSync(PROGRAM, ["study", "run", "study.ron", "--export", "site"], { cwd: root });
    const { address, close } = await serve(join(root, "site"));
    return { address, end: () => (close(), rmSync(root, { recursive: true, force: true })) };
}

// Both pages of a site, in a browser that keeps what it kept.
async function pagesOfSite(address, context = null) {
    const experimenter = context ? await context.newPage() : await open({ at: address, isReady: isReady("experimenter") });
    if (context) await experimenter.goto(address);
    await until(experimenter, () => window.experimenter.view);
    const [participant] = await Promise.all([experimenter.context().waitForEvent("page"), experimenter.click("#main")]);
    await until(participant, () => window.participant?.view);
    return [experimenter, participant];
}

// What a browser has kept of a study, by its paths.
const keptBy = (page) =>
    page.evaluate(async () => {
        const files = (await window.experimenter.engine.kept()).map(({ path, bytes }) => [path, new TextDecoder().decode(bytes)]);
        return Object.fromEntries(files);
    });

const table = (root, name) => {
    const path = join(root, "out/study", name);
    return rowsOf(existsSync(path) ? readFileSync(path, "utf8") : "");
};
const rowsOf = (text = "") => {
    const lines = text.trim().split("\n");
    const names = lines[0]?.split(",") ?? [];
    const cell = /(?:"((?:[^"]|"")*)"|([^,]*))(?:,|$)/gy;
    const cells = (line) => [...line.matchAll(cell)].map(([, quoted, plain]) => quoted?.replaceAll('""', '"') ?? plain);
    return lines.slice(1).map((line) => Object.fromEntries(cells(line).map((value, i) => [names[i], value])));
};

async function begin(experimenter, participant, code) {
    await until(experimenter, () => window.experimenter.view.participant_is_there && !window.experimenter.view.session);
    await experimenter.fill("#code", code);
    await experimenter.click("#begin-button");
    await until(participant, () => window.participant.view.state !== "idle");
}

// Everything that the participant's page holds.
const heldBy = (page) =>
    page.evaluate(() =>
        [document.documentElement.outerHTML, location.href, document.title, JSON.stringify({ ...localStorage }), JSON.stringify(participant.view)].join("\n"),
    );

async function isBlind(page) {
    const held = (await heldBy(page)).toLowerCase();
    const found = SECRETS.filter((secret) => held.includes(secret));
    assert.deepEqual(found, []);
}

async function isAccessible(page) {
    await page.evaluate(AXE);
    const { violations } = await page.evaluate(() => axe.run());
    assert.deepEqual(violations.map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html).join(" ")}`), []);
}

const strokeBy = {
    mouse: async (page, { x, y, width, height }) => {
        await page.mouse.move(x + width / 2, y + height / 2);
        await page.mouse.down();
        for (let i = 0; i < 12; i++) await page.mouse.move(x + width / 2 + 60 * Math.sin(i / 2), y + height / 2);
        await page.mouse.up();
    },
    pen: async (page, { x, y, width, height }) => {
        const session = await page.context().newCDPSession(page);
        const send = (type, i, force) =>
            session.send("Input.dispatchMouseEvent", {
                type,
                x: x + width / 2 + 60 * Math.sin(i / 2),
                y: y + height / 2,
                force,
                button: type === "mouseMoved" ? "none" : "left",
                buttons: type === "mouseReleased" ? 0 : 1,
                clickCount: 1,
                pointerType: "pen",
            });
        await send("mousePressed", 0, 0.4);
        for (let i = 1; i < 12; i++) await send("mouseMoved", i, 0.4);
        await send("mouseReleased", 12, 0);
    },
    keys: async (page) => {
        await page.focus("#pad");
        await page.keyboard.down("ArrowRight");
        await page.waitForTimeout(200);
        await page.keyboard.up("ArrowRight");
    },
};

async function markBy(how, page, kind) {
    const first = page.locator(".choices button").first();
    if (kind === "none") return;
    if (kind === "line" && how === "keys") {
        await page.focus(".line");
        for (const key of ["ArrowRight", "PageDown", "PageDown"]) await page.keyboard.press(key);
    } else if (kind === "line") {
        const { x, y, width, height } = await page.locator(".line").boundingBox();
        await page.mouse.click(x + 0.3 * width, y + height / 2);
    } else if (kind === "number") await page.fill(".answer input", "33");
    else if (kind === "words") await page.fill("textarea", "it, \"was\"\nfine");
    else if (how === "keys") {
        await first.focus();
        await page.keyboard.press("Space");
    } else await first.click();
}

// One step of a session: the experimenter lays out, or the participant feels and answers. False once all trials are done.
async function step(experimenter, participant, how, look = async () => {}) {
    await until(participant, () => ["consent", "trial", "done", "wait"].includes(participant.view.state));
    if (await experimenter.evaluate(() => window.experimenter.view.session?.state === "preparing")) {
        await experimenter.click("#main");
        await until(experimenter, () => window.experimenter.view.session.state !== "preparing");
        return true;
    }
    const view = await participant.evaluate(() => participant.view);
    if (view.state === "done") return false;
    await look(view);
    if (view.state === "consent") {
        await participant.click(".agree input");
        await participant.click("#next");
        await until(participant, () => participant.view.state !== "consent");
        return true;
    }
    if (view.state !== "trial" || view.begins) return true;
    for (let turn = 0; view.pad && turn < (view.turns?.felt.length ?? 1); turn++) {
        if (turn > 0) {
            await participant.click(`#turn-${turn}`);
            await until(participant, (turn) => participant.view.turns.now === turn && !participant.view.begins, turn);
        }
        await strokeBy[how](participant, await participant.locator("#pad").boundingBox());
    }
    await until(participant, () => participant.view.open).catch(async () => {
        const { input, turns, conditions, begins } = await participant.evaluate(() => participant.view);
        throw new Error(`the answer never opened, by ${how}: ${JSON.stringify({ input, turns, conditions, begins })}`);
    });
    await markBy(how, participant, view.input.kind);
    await look(await participant.evaluate(() => participant.view));
    await until(participant, () => !document.getElementById("next").disabled);
    await (how === "keys" && view.input.kind === "line" ? participant.keyboard.press("Enter") : participant.click("#next"));
    await until(participant, (trial) => participant.view.trial !== trial || participant.view.state !== "trial", view.trial);
    return true;
}

besideTest("two people take part in a study, by mouse and by keys, blind, and each answer is on disk", async () => {
    const served = await study();
    const [experimenter, participant] = await pagesOf(served);
    const seen = new Set();
    const look = async ({ state, input, turns }) => {
        await isBlind(participant);
        const kind = [state, input?.kind, turns?.felt.length].filter(Boolean).join("-");
        if (seen.has(kind)) return;
        seen.add(kind);
        await picture(participant, `participant-${kind}`);
        await picture(experimenter, `experimenter-${kind}`);
        await isAccessible(participant);
        await isAccessible(experimenter);
    };
    for (const [code, how] of [["P1", "mouse"], ["P2", "keys"]]) {
        await begin(experimenter, participant, code);
        while (await step(experimenter, participant, how, look));
        assert.equal(table(served.root, "trials.csv").filter(({ participant: of }) => of === code).length, TRIALS);
        await isAccessible(participant);
        await experimenter.click("#main");
        await until(experimenter, () => !window.experimenter.view.session);
    }
    assert(seen.size >= 6, [...seen].join());
    const rows = table(served.root, "trials.csv");
    assert(rows.every(({ status, simulated }) => status === "answered" && simulated === "false"));
    const ratings = rows.filter(({ phase, participant: of }) => phase === "marmot" && of === "P1").map(({ rating }) => Number(rating));
    assert(ratings.length === 5 && ratings.every((rating) => Math.abs(rating - 0.3) < 0.01), ratings.join());
    assert.equal(rows.find(({ scale }) => scale === "ibex").text, 'it, "was" fine');
    await served.end();
    for (const page of [experimenter, participant]) await page.context().close();
});

// The content of an archive without compression, by its paths.
function unzipped(bytes) {
    const files = {};
    const end = bytes.length - 22;
    assert.equal(bytes.readUInt32LE(end), 0x06054b50);
    for (let n = 0, at = bytes.readUInt32LE(end + 16); n < bytes.readUInt16LE(end + 10); n++) {
        const name = bytes.readUInt16LE(at + 28);
        const path = bytes.toString("utf8", at + 46, at + 46 + name);
        const from = bytes.readUInt32LE(at + 42) + 30 + name;
        files[path] = bytes.subarray(from, from + bytes.readUInt32LE(at + 24));
        at += 46 + name;
    }
    return files;
}

besideTest("two people take part in a study that runs in the browser, blind, and the data can be downloaded and analysed", async () => {
    const exported = await site();
    if (!exported) return console.log("skipped: this program has no engine for pages");
    const [experimenter, participant] = await pagesOfSite(exported.address);
    for (const [code, how] of [["P1", "pen"], ["P2", "mouse"]]) {
        await begin(experimenter, participant, code);
        while (await step(experimenter, participant, how, () => isBlind(participant)));
        await experimenter.click("#main");
        await until(experimenter, () => !window.experimenter.view.session);
    }
    await isAccessible(experimenter);
    await picture(experimenter, "experimenter-of-a-site");
    const [download] = await Promise.all([experimenter.waitForEvent("download"), experimenter.click("#download")]);
    assert.equal(download.suggestedFilename(), "study.ron.zip");
    const files = unzipped(readFileSync(await download.path()));
    const rows = rowsOf(files["data/trials.csv"].toString());
    assert.equal(rows.length, 2 * TRIALS);
    assert(rows.every(({ status, simulated }) => status === "answered" && simulated === "false"));
    // Each run in which something was felt can be replayed.
    const runs = Object.keys(files).filter((path) => /^data\/signals\/P[12]\/.*\/strokes\.json$/.test(path));
    const felt = rows.filter(({ first_version, second_version }) => [first_version, second_version].some((of) => of && of !== "real"));
    assert(runs.length >= felt.length, `${runs.length} of ${felt.length}`);
    assert(runs.every((path) => JSON.parse(files[path]).moves.length > 0));
    const root = mkdtempSync(join(tmpdir(), "haptograph-data-"));
    for (const name of ["study.json", "study.ron", "participants.csv", "trials.csv"]) writeFileSync(join(root, name), files[`data/${name}`]);
    const { means } = JSON.parse(execFileSync(PROGRAM, ["study", "analyse", root, "--json"], { encoding: "utf8" }));
    assert(means.length > 0);
    rmSync(root, { recursive: true, force: true });
    await experimenter.context().close();
    exported.end();
});

besideTest("a study in the browser whose windows are closed at any moment loses no answer and doubles none", async () => {
    const exported = await site();
    if (!exported) return console.log("skipped: this program has no engine for pages");
    let [experimenter, participant] = await pagesOfSite(exported.address);
    const context = experimenter.context();
    const trials = async () => rowsOf((await keptBy(experimenter))["data/trials.csv"]).map(({ trial }) => Number(trial));
    for (let kill = 0; kill < KILLS / 2; kill++) {
        const before = await trials();
        if (before.length === TRIALS) break;
        await begin(experimenter, participant, "P1");
        // The participant sees a further trial: what was answered is on disk.
        let answers = 0;
        for (let last = null; answers < 2 && (await step(experimenter, participant, "mouse")); ) {
            const trial = await participant.evaluate(() => participant.view.trial ?? null);
            if (last !== null && trial !== last) answers += 1;
            last = trial;
        }
        if (kill % 2) await experimenter.close();
        await participant.close();
        if (!(kill % 2)) await experimenter.close();
        [experimenter, participant] = await pagesOfSite(exported.address, context);
        const after = await trials();
        assert(after.length > before.length && after.length >= before.length + answers, `${before.length} ${answers} ${after.length}`);
        assert.deepEqual(after, after.map((_, i) => i + 1), "lost or doubled");
    }
    await context.close();
    exported.end();
});

besideTest("a study that is killed at any moment loses no answer and doubles none", async () => {
    let [served, root] = [await study(), null];
    ({ root } = served);
    let random = 7;
    const next = () => (random = (random * 16807) % 2147483647) / 2147483647;
    for (let kill = 0; kill < KILLS; kill++) {
        const [experimenter, participant] = await pagesOf(served);
        const person = `P${1 + Math.floor(table(root, "trials.csv").length / TRIALS)}`; // whoever has trials left
        const of = () => table(root, "trials.csv").filter(({ participant: code }) => code === person);
        await begin(experimenter, participant, person);
        const before = of().map(({ trial }) => Number(trial));
        // Some moment after an answer was kept: the next one may just be on its way.
        const killed = (async () => {
            while (of().length <= before.length) await new Promise((later) => setTimeout(later, 10));
            await new Promise((later) => setTimeout(later, 1500 * next() ** 2));
            await served.end("SIGKILL", true);
        })();
        await Promise.race([killed, (async () => { while (await step(experimenter, participant, "mouse")); })().catch(() => {})]);
        await killed;
        const after = of().map(({ trial }) => Number(trial));
        assert.deepEqual(after.slice(0, before.length), before);
        assert.deepEqual(after, after.map((_, i) => i + 1), "lost or doubled");
        for (const page of [experimenter, participant]) await page.context().close();
        served = await study({ root });
    }
    const count = table(root, "trials.csv").length;
    assert(count >= KILLS, `${count} trials`);
    await served.end();
    rmSync(root, { recursive: true, force: true });
});

