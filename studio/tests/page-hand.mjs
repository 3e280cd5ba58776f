// The graph changed in its drawing: settings in a form at a node, wires from port to port, by mouse, keyboard and finger; and that the
// text of the editor has exactly these changes.
import assert from "node:assert/strict";
import { AS_PHONE, AXE, open, picture, programTest, studioOf, test, until } from "./harness.mjs";

const textOf = (page) => page.evaluate(() => studio.edits.text());
// Waits until a text is in the editor and runs.
const runs = (page, text) => until(page, (wanted) => studio.edits.text() === wanted && studio.graph.text === wanted, text);
const field = (page, key) => page.locator(`.by-hand [data-key="${key}"]`);

// The middle of what a selector finds in the drawing, on the page.
const placeOf = (page, selector) =>
    page.evaluate((wanted) => {
        const { x, y, width, height } = document.querySelector("#graph > div").shadowRoot.querySelector(wanted).getBoundingClientRect();
        return [x + width / 2, y + height / 2];
    }, selector);

// The whole drawing in the window, with ports or names.
async function draw(page, what) {
    await page.evaluate(() => studio.showTab("graph"));
    while ((await page.getAttribute("#expand", "aria-pressed")) !== "true" || !(await page.evaluate(() => document.querySelector(".panes.whole")))) await page.click("#expand");
    if ((await page.textContent("#graph-ports")) === what) await page.click("#graph-ports");
    await page.click(".graph-buttons >> text=Fit");
    await page.waitForTimeout(200);
}

const small = async (page) => {
    await page.evaluate(() => studio.closeByHand());
    for (let i = 0; i < 3 && (await page.evaluate(() => document.querySelector(".panes").matches(".widened, .whole"))); i++) await page.click("#expand");
};

async function drag(page, from, to) {
    await page.mouse.move(...from);
    await page.mouse.down();
    for (const part of [0.3, 0.7, 1]) await page.mouse.move(from[0] + part * (to[0] - from[0]), from[1] + part * (to[1] - from[1]));
    await page.mouse.up();
}

test("a double click on a node changes a number in the text, the graph follows, and Ctrl-Z undoes it", async (page) => {
    await draw(page, "Ports");
    const before = await textOf(page);
    const changed = before.replace("cutoff_hz: 20)", "cutoff_hz: 35)");
    assert.notEqual(before, changed);
    await page.mouse.dblclick(...(await placeOf(page, '[data-node="speed"] .box')));
    await field(page, "cutoff_hz").fill("35");
    await picture(page, "hand-form");
    await field(page, "cutoff_hz").press("Enter");
    await runs(page, changed);
    assert.equal(await field(page, "cutoff_hz").inputValue(), "35");
    await page.keyboard.press("Control+z");
    await runs(page, before);
    assert.equal(await field(page, "cutoff_hz").inputValue(), "20");
    await page.keyboard.press("Escape");
    assert.equal(await page.locator(".by-hand").count(), 0);
    assert.equal(await page.evaluate(() => studio.status.state), "running", "Escape closed the form and stopped nothing");
    await small(page);
});

test("a setting that is not written is written, emptied it is taken out, and a parameter is changed where it stands", async (page) => {
    await draw(page, "Ports");
    const before = await textOf(page);
    await page.evaluate(() => studio.editNode("speed"));
    await field(page, "smoothing").selectOption("DoublePole");
    const written = before.replace("cutoff_hz: 20)", "cutoff_hz: 20, smoothing: DoublePole)");
    await runs(page, written);
    await field(page, "smoothing").selectOption("");
    await runs(page, before);
    await page.evaluate(() => studio.editNode("out"));
    await field(page, "gain").fill("0.5");
    await field(page, "gain").press("Tab");
    await runs(page, before.replace('"gain": 1.0', '"gain": 0.5'));
    await page.keyboard.press("Control+z");
    await runs(page, before);
    // What it has set outside of the text goes, too.
    await page.evaluate(() => studio.parameter("gain", "1.0"));
    await field(page, "limit.peak_a").fill("0.4");
    await field(page, "limit.peak_a").press("Enter");
    await runs(page, before.replace("peak_a: 0.5", "peak_a: 0.4"));
    await page.keyboard.press("Control+z");
    await runs(page, before);
    await small(page);
});

test("what the engine refuses goes back, and is said where it was changed", async (page) => {
    await draw(page, "Ports");
    const before = await textOf(page);
    await page.evaluate(() => studio.editNode("speed"));
    await field(page, "cutoff_hz").fill("-3");
    await field(page, "cutoff_hz").press("Enter");
    await page.waitForSelector(".by-hand .field:has([data-key=cutoff_hz]) .refusal");
    assert.match(await page.textContent(".by-hand .refusal strong"), /^E\d{4}/);
    assert.equal(await textOf(page), before);
    await picture(page, "hand-refused");
    await small(page);
});

test("a wire is dropped on an input, and one that crosses clocks is offered with the bridges that the engine takes", async (page) => {
    await draw(page, "Ports");
    const before = await textOf(page);
    await drag(page, await placeOf(page, '[data-output="stylus.force"]'), await placeOf(page, '[data-input="vibration.input"]'));
    const connected = before.replace('"vibration": WavSink(input: "texture"', '"vibration": WavSink(input: "stylus.force"');
    await runs(page, connected);
    await picture(page, "hand-wire");
    await page.focus("#graph");
    await page.keyboard.press("Control+z");
    await runs(page, before);
    // A force is no acceleration, and its place is said.
    const target = await placeOf(page, '[data-input="drive.acceleration"]');
    await drag(page, await placeOf(page, '[data-output="stylus.force"]'), target);
    await page.waitForSelector(".by-hand .refusal strong");
    assert.equal(await textOf(page), before);
    const box = await page.locator(".by-hand").boundingBox();
    assert(Math.abs(box.x - target[0]) < 500 && Math.abs(box.y - target[1]) < 500, `the note stands at ${box.x}, ${box.y}`);
    await picture(page, "hand-wire-refused");
    await small(page);
});

test("the ends of a wire are chosen by keys", async (page) => {
    await draw(page, "Names");
    const before = await textOf(page);
    await page.evaluate(() => document.querySelector("#graph > div").shadowRoot.querySelector('[data-node="vibration"], [data-node="drive"]').focus());
    await page.keyboard.press("F2");
    await page.waitForSelector(".by-hand [data-key]");
    await page.evaluate(() => studio.editNode("stylus", "Tablet"));
    await field(page, "output stylus.force").focus();
    await page.keyboard.type("vibration");
    await runs(page, before.replace('"vibration": WavSink(input: "texture"', '"vibration": WavSink(input: "stylus.force"'));
    await page.keyboard.press("Control+z");
    await runs(page, before);
    await small(page);
});

const BRIDGES = `Graph(
    format: 1,
    clocks: { "audio": Driver(rate_hz: 10000), "slow": Derived(of: "audio", rate_hz: 100) },
    nodes: {
        "fast": Sine(clock: "audio", frequency_hz: 50),
        "slow": Sine(clock: "slow", frequency_hz: 1), // "not" (this
        "sum": Sum(inputs: ["fast", Linear("slow")]),
        "gain": Gain(
            input: "fast",   // which one
            gain: Expr("2 * 3"), clock: "audio",
        ),
        "use": Twice(of: "fast"),
        "file": WavSink(input: "sum", file: "a.wav", full_scale: 1),
    },
    templates: { "Twice": Template(inputs: ["of"], settings: { "by": 2.0 }, nodes: { "by": Gain(input: Input("of"), gain: Setting("by")) }, outputs: { "it": "by" }) },
)
`;

programTest("a bridge stays where it is needed, and what a form cannot change it names and leads to", async () => {
    const own = await studioOf("bridges.ron", { files: { "bridges.ron": BRIDGES.replaceAll("Sum(", "Add(") } });
    const page = await open({ at: own.address });
    await draw(page, "Ports");
    const before = await textOf(page);
    const drop = async (from, to) => drag(page, await placeOf(page, `[data-output="${from}"]`), await placeOf(page, to));
    await drop("slow.output", '[data-input="gain.input"]');
    await page.waitForSelector(".by-hand .offers button");
    assert.equal(await textOf(page), before);
    const offers = await page.locator(".by-hand .offers button").allTextContents();
    assert.deepEqual(offers.map((text) => text.split("(")[0]), ["Hold", "Linear", "Resample"]);
    await picture(page, "hand-bridges");
    await page.click(".by-hand .offers >> text=Linear");
    await runs(page, before.replace('input: "fast",   //', 'input: Linear("slow"),   //'));
    // Without need the bridge goes again.
    await drop("fast.output", '[data-input="gain.input"]');
    await runs(page, before);
    // A template's output is named as the graph names it; its inside is led to.
    await drop("use/by.output", '[data-input="gain.input"]');
    await runs(page, before.replace('input: "fast",   //', 'input: "use",   //'));
    await page.focus("#graph");
    await page.keyboard.press("Control+z");
    await runs(page, before);
    await page.evaluate(() => studio.editNode("gain"));
    await page.click('.by-hand .field:has-text("2 * 3") >> text=Edit in the text');
    assert.equal(await page.evaluate(() => studio.editor.state.sliceDoc(studio.editor.state.selection.main.from, studio.editor.state.selection.main.to)), 'Expr("2 * 3")');
    await page.evaluate(() => (studio.showTab("graph"), studio.editNode("use/by")));
    await page.click(".by-hand >> text=Go to the template's text");
    assert.match(await page.evaluate(() => studio.editor.state.sliceDoc(studio.editor.state.selection.main.from, studio.editor.state.selection.main.to)), /^"by": Gain/);
    // Beside changes that are not applied, it is in the text and does not run.
    await page.evaluate(() => (studio.editor.dispatch({ changes: { from: 0, insert: "// mine\n" } }), studio.showTab("graph"), studio.editNode("fast")));
    await field(page, "frequency_hz").fill("60");
    await field(page, "frequency_hz").press("Enter");
    await page.waitForSelector(".by-hand >> text=Apply all");
    assert.deepEqual([await textOf(page), await page.evaluate(() => studio.graph.text)], [`// mine\n${before.replace("frequency_hz: 50", "frequency_hz: 60")}`, before]);
    await page.click(".by-hand >> text=Apply all");
    await runs(page, `// mine\n${before.replace("frequency_hz: 50", "frequency_hz: 60")}`);
    await page.context().close();
    await own.end();
});

programTest("the form is clean for axe, is opened by two taps, and fits a phone", async () => {
    const own = await studioOf("graphs/texturepad.ron");
    for (const options of [{}, { ...AS_PHONE, colorScheme: "dark" }]) {
        const page = await open({ at: own.address, ...options });
        await page.evaluate(() => (studio.own(), studio.showTab("graph")));
        await until(page, () => studio.status.owner);
        await page.waitForTimeout(300);
        const at = await placeOf(page, '[data-node="speed"] .box');
        if (options.hasTouch) for (const _ of [1, 2]) await page.touchscreen.tap(...at);
        else await page.mouse.dblclick(...at);
        await page.waitForSelector(".by-hand [data-key=cutoff_hz]");
        const box = await page.locator(".by-hand").boundingBox();
        const { width } = page.viewportSize();
        assert(box.x >= 0 && box.x + box.width <= width, `${box.x} to ${box.x + box.width} of ${width}`);
        await page.evaluate(AXE);
        for (const _ of ["names", "ports"]) {
            const { violations } = await page.evaluate(() => axe.run("#graph-tab"));
            assert.deepEqual(violations.map(({ id, nodes }) => [id, nodes[0].html, nodes[0].failureSummary]), []);
            await page.evaluate(() => document.getElementById("graph-ports").click());
        }
        await picture(page, options.hasTouch ? "hand-phone" : "hand-axe");
        await page.context().close();
    }
    await own.end();
});
