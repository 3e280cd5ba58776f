// A study on its two pages: whole sessions of two people, by mouse, pen, finger and keys; that the participant's page shows no name; and
// that nothing is lost when the program is killed.
import assert from "node:assert/strict";
import { existsSync, readFileSync, rmSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { open, picture, programTest, studioOf, until } from "./harness.mjs";

const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
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
        "emu": ConstantStimuli(ask: "Was ist stärker?", surface: "wolfram", parameter: "gain", standard: 1.0, levels: [1.5], repeats: 1),
    },
)`;
const SECRETS = ["zeppelin", "zircon", "wolfram", "zulu", "quokka", "xylem", "0.8125", "bogey", "marmot", "jaguar", "emu", "yak", "vole", "lynx", "rook", "finch"];
SECRETS.push("ibex", "vinyl", ".ron", "texturepad", "1.5");
const TRIALS = 3 + 5 + 1 + 1 + 1 + 1;
const KILLS = Number(process.env.KILLS ?? 8);

const study = (more = {}) => studioOf("study.ron", { files: { "study.ron": STUDY }, command: ["study", "run"], count: 2, ...more });
const isReady = (name) => (page) => until(page, (of) => window[of]?.view, name);
const pagesOf = async ({ addresses: [mine, theirs] }, how = {}) => [
    await open({ at: mine, isReady: isReady("experimenter"), expected: LOST }),
    await open({ at: theirs, isReady: isReady("participant"), expected: LOST, ...how }),
];
const table = (root, name) => {
    const path = join(root, "out/study", name);
    const lines = existsSync(path) ? readFileSync(path, "utf8").trim().split("\n") : [];
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

programTest("two people take part in a study, by mouse and by keys, blind, and each answer is on disk", async () => {
    const served = await study();
    const [experimenter, participant] = await pagesOf(served);
    const seen = new Set();
    const look = async ({ state, input }) => {
        await isBlind(participant);
        const kind = `${state}-${input?.kind ?? ""}`;
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

programTest("a study that is killed at any moment loses no answer and doubles none", async () => {
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

