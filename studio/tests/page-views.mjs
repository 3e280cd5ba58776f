// What is seen of a graph: its plots, the object that is touched, and scopes of what moves.
import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { AXE, HOME, open, picture, programTest, stroke, studioOf, until } from "./harness.mjs";

const STROKE_MS = 4500; // longer than a scope that does not move stays
const AT_ONCE = 3;
const PLOTS = ["time", "xy", "path"];

// Every graph beside the repository's own and in its cookbook.
const shipped = ["graphs", "graphs/cookbook"].flatMap((folder) =>
    readdirSync(join(HOME, folder))
        .filter((name) => name.endsWith(".ron"))
        .map((name) => join(folder, name)),
);

const pageOf = async (graph, options = {}) => {
    const served = await studioOf(graph);
    const page = await open({ at: served.address, ...options });
    const end = async () => {
        await page.context().close();
        await served.end();
    };
    return { page, end, address: served.address };
};

// The place of the first plot, which is chosen if it is not shown.
async function firstPlot(page) {
    const plot = await page.evaluate((forms) => {
        const [first] = studio.graph.plots;
        return first ? `plot ${first.name}` : studio.shownViews().find(({ form }) => forms.includes(form))?.id;
    }, PLOTS);
    if (!plot) return null;
    if (!(await page.evaluate((id) => studio.shownViews().some((view) => view.id === id), plot)))
        await page.selectOption(".view-choice >> nth=0", plot);
    return plot;
}

const moves = (page, id) => page.evaluate((wanted) => studio.shownViews().find((view) => view.id === wanted).moves, id);

// What is wrong with what is seen of a graph while its first pad is stroked.
async function faultsOf(page) {
    const plot = await firstPlot(page);
    const hasPad = await page.evaluate(() => studio.graph.pads.length > 0);
    // A press that comes before the first samples is not seen.
    await until(page, () => studio.taps.traces.every(({ written }) => written > 0), null, 5000).catch(() => {});
    let moved = plot === null;
    const look = async () => (moved ||= await moves(page, plot));
    if (hasPad) await stroke(page, 0.5, STROKE_MS, look);
    else await page.waitForTimeout(STROKE_MS);
    await look();
    const { still, texts } = await page.evaluate(() => {
        const names = [...document.querySelectorAll(".scope")].map((scope) => scope.getAttribute("aria-label"));
        const others = studio.graph.ports.some(({ name }) => studio.motion.moves(name) && !names.includes(name));
        const texts = [...document.querySelectorAll(".view-text")].map((text) => text.textContent);
        return { still: others ? names.filter((name) => !studio.motion.moves(name)) : [], texts };
    });
    return [
        ...(moved ? [] : [`${plot} does not move (${texts.join("; ")})`]),
        ...still.map((name) => `the scope of ${name} does not move`),
    ];
}

// What is wrong with the first control of a page: it has to change what the engine tells another page, or to say why not.
async function controlFaults(page, other) {
    await page.evaluate(() => studio.showTab("controls"));
    const controls = page.locator("#controls :is(input[type=range], input[type=checkbox], select)");
    const port = await page.evaluate(() => studio.graph.inputs[0]?.port);
    const had = () =>
        other.evaluate(
            (name) => JSON.stringify([[...studio.values], studio.graph.parameters.map(({ value }) => value), name ? studio.taps.watch(name).latest() : null]),
            port,
        );
    await had();
    const before = await had();
    const move = (number) =>
        controls.nth(number).evaluate((element) => {
            if (element.type === "checkbox") return element.click();
            if (element.tagName === "SELECT") element.selectedIndex = (element.selectedIndex + 1) % element.options.length;
            else element.value = String(Number(element.value) > 500 ? 300 : 700);
            for (const type of ["input", "change"]) element.dispatchEvent(new Event(type, { bubbles: true }));
        });
    if (port) {
        await move(0);
        // Held: it stands still, where the graph's own moves.
        await other.waitForTimeout(400);
        const [one, , two] = [await had(), await other.waitForTimeout(300), await had()];
        return one === two && one !== before ? [] : [`the first control: ${one} and ${two}, before ${before}`];
    }
    // In its own row: that of an earlier control stays.
    const refuses = (number) =>
        controls.nth(number).evaluate((element) => {
            let row = element;
            while (row.tagName !== "SECTION" && !row.querySelector(".error")) row = row.parentElement;
            return row.tagName !== "SECTION" && row.querySelector(".error").checkVisibility();
        });
    for (let number = 0; number < (await controls.count()); number++) {
        await move(number);
        const begun_ms = performance.now();
        do {
            if ((await had()) !== before) return [];
            if (performance.now() - begun_ms > 15_000) return [`control ${number} does nothing`];
        } while (!(await refuses(number)));
    }
    return ["the engine refuses every control"];
}

programTest("of every graph the first plot moves while its first pad is stroked, and every scope, and its first control moves what the engine has", async () => {
    assert(shipped.length > 10);
    const faults = [];
    const left = [...shipped];
    const tryNext = async () => {
        for (let graph = left.shift(); graph; graph = left.shift()) {
            const opened = await pageOf(graph);
            const found = await faultsOf(opened.page);
            await picture(opened.page, `views-${graph.replaceAll("/", "-")}`);
            const other = await open({ at: opened.address });
            found.push(...(await controlFaults(opened.page, other)));
            faults.push(...found.map((fault) => `${graph}: ${fault}`));
            await other.context().close();
            await opened.end();
        }
    };
    await Promise.all(Array.from({ length: AT_ONCE }, tryNext));
    assert.deepEqual(faults, []);
});

programTest("views are chosen by the keyboard and kept, one alone or several, and axe finds nothing", async () => {
    const { page, end } = await pageOf("graphs/omni.ron");
    const shown = () => page.evaluate(() => studio.shownViews().map(({ id }) => id));
    const before = await shown();
    assert(before.length > 1 && before[0].startsWith("map"), before.join());
    await page.focus(".view-choice >> nth=0");
    await page.keyboard.press("ArrowDown");
    const after = await shown();
    assert.deepEqual(after.slice(0, 2), [before[1], before[0]], "the other view does not change places");
    await page.focus(".view-bar button");
    await page.keyboard.press("Enter");
    assert.equal((await shown()).length, 1);
    await page.reload();
    await until(page, () => studio.graph && studio.shownViews().length > 0);
    assert.deepEqual(await shown(), after.slice(0, 1));
    await page.click(".view-bar button");
    assert.deepEqual(await shown(), after);
    await page.evaluate(AXE);
    const { violations } = await page.evaluate(() => axe.run({ include: ["#views-panel", "#scopes-panel"] }));
    assert.deepEqual(
        violations.map(({ id, nodes }) => `${id}: ${nodes.map(({ target }) => target).join(" ")}`),
        [],
    );
    await end();
});

programTest("what is seen and heard is kept as SVG, PNG and WAV", async () => {
    const { page, end } = await pageOf("graphs/omni.ron");
    const kept = async (act) => {
        const [download] = await Promise.all([page.waitForEvent("download"), act()]);
        return { name: download.suggestedFilename(), bytes: readFileSync(await download.path()) };
    };
    try {
        await page.click("#sound");
        await page.click("#demo");
        await page.waitForTimeout(1500);
        const menus = page.locator(".figure-menu");
        assert((await menus.count()) >= 6, "a view or scope has no menu");
        for (let place = 0; place < (await menus.count()); place++) {
            const { name, bytes } = await kept(() => menus.nth(place).selectOption("svg"));
            const wrong = await page.evaluate((svg) => {
                const read = new DOMParser().parseFromString(svg, "image/svg+xml");
                return read.querySelector("parsererror")?.textContent ?? (read.querySelector("text, rect") ? null : "it is empty");
            }, bytes.toString());
            assert.equal(wrong, null, name);
        }
        const { name, bytes } = await kept(() => menus.first().selectOption("png"));
        assert.match(name, /^omni-.+\.png$/);
        assert.equal(bytes.subarray(1, 4).toString(), "PNG");
        let samples = [];
        for (let tries = 0; tries < 10 && samples.length <= 40_000; tries++) {
            await page.waitForTimeout(500);
            const { bytes } = await kept(() => page.click("#wav"));
            assert.match(bytes.toString("latin1"), /coil\.delivered of omni; 1\.0 is its limit, 0\.5 A/);
            samples = new Float32Array(new Uint8Array(bytes.subarray(bytes.indexOf("data") + 8)).buffer);
        }
        assert(samples.length > 40_000 && samples.some((x) => Math.abs(x) > 0.01), `${samples.length} samples`);
        await page.selectOption("#wav-format", "haptic");
        const pattern = await kept(() => page.click("#wav"));
        assert.match(pattern.name, /\.haptic$/);
        assert.equal(JSON.parse(pattern.bytes).version.major, 1);
    } finally {
        await end();
    }
});
