// What is seen and reached: on a phone, in the dark, by keys, without things that jump, and where no engine can run.
import assert from "node:assert/strict";
import {
    address,
    AS_PHONE,
    demo,
    FAR_NAME,
    finger,
    latest,
    open,
    picture,
    serverTest,
    siteTest,
    stroke,
    test,
    until,
} from "./harness.mjs";
import { proxyTo } from "./proxy.mjs";

const LEAST_TEXT = 4.5; // WCAG AA
const LEAST_LARGE_TEXT = 3;
const ROUNDING = 0.05; // of colours to 8 bits
const MOST_SHIFT = 0.01;
const MOST_TABS = 80;
const LEAST_FINGER_PX = 40;
const TABS = ["graph", "editor", "controls", "surfaces"];

const takeOver = async (page) => {
    await page.evaluate(() => studio.own());
    await until(page, () => studio.status.owner);
};

// Texts that do not stand out from what is behind them. What is on a picture or is disabled is left out.
const faintTexts = (page) =>
    page.evaluate(
        ([least, least_large, rounding]) => {
            const paint = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
            const channels = (colour) => {
                paint.clearRect(0, 0, 1, 1);
                paint.fillStyle = colour;
                paint.fillRect(0, 0, 1, 1);
                const [r, g, b, a] = paint.getImageData(0, 0, 1, 1).data;
                return [r / 255, g / 255, b / 255, a / 255];
            };
            const over = ([r, g, b, a], below) => [r, g, b].map((value, i) => a * value + (1 - a) * below[i]);
            const luminance = (rgb) =>
                rgb
                    .map((part) => (part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4))
                    .reduce((sum, part, i) => sum + part * [0.2126, 0.7152, 0.0722][i], 0);
            const groundOf = (element) => {
                const above = [];
                for (let at = element; at; at = at.parentElement) {
                    const { backgroundColor, backgroundImage } = getComputedStyle(at);
                    if (backgroundImage !== "none") return null;
                    above.push(channels(backgroundColor));
                    if (above.at(-1)[3] === 1) break;
                }
                return above.reduceRight((below, colour) => over(colour, below), [1, 1, 1]);
            };
            const wrong = [];
            for (const element of document.body.querySelectorAll("*")) {
                const hasText = [...element.childNodes].some(({ nodeType, data }) => nodeType === Node.TEXT_NODE && data.trim());
                if (!hasText && !element.matches("input[type=text], input[type=number], select")) continue;
                const visible = element.checkVisibility({ visibilityProperty: true, opacityProperty: true });
                if (!visible || element.closest(":disabled, option, svg, .pad-swatch, .hidden-input, .skip")) continue;
                const ground = groundOf(element);
                if (!ground) continue;
                const { color, fontSize, fontWeight } = getComputedStyle(element);
                const [low, high] = [luminance(over(channels(color), ground)), luminance(ground)].sort((a, b) => a - b);
                const size = parseFloat(fontSize);
                const isLarge = size >= 24 || (size >= 18.66 && Number(fontWeight) >= 700);
                const found = (high + 0.05) / (low + 0.05);
                if (found < (isLarge ? least_large : least) - rounding)
                    wrong.push(
                        `${found.toFixed(2)} ${element.tagName}#${element.id}.${element.className} "${element.textContent.slice(0, 30)}"`,
                    );
            }
            return wrong;
        },
        [LEAST_TEXT, LEAST_LARGE_TEXT, ROUNDING],
    );

for (const colorScheme of ["light", "dark"])
    serverTest(`every text stands out from what is behind it: ${colorScheme}`, async (main) => {
        const page = await open({ colorScheme });
        await takeOver(page);
        const ground = await page.evaluate(() => getComputedStyle(document.body).backgroundColor);
        assert.equal(ground === "rgb(255, 255, 255)", colorScheme === "light", ground);
        await demo(page, true);
        for (const tab of TABS) {
            await page.evaluate((name) => studio.showTab(name), tab);
            if (tab === "graph") await page.evaluate(() => studio.showNode(studio.graph.ports[0].node));
            if (tab === "editor") {
                await page.evaluate(() => {
                    const at = studio.editor.state.doc.toString().indexOf("SpeedEstimator(");
                    const changes = { from: at, to: at + 5, insert: "Spead" };
                    studio.editor.dispatch({ changes, selection: { anchor: at }, scrollIntoView: true });
                });
                await page.waitForSelector("#problems li");
            }
            await page.waitForTimeout(1500);
            await picture(page, `${tab}-${colorScheme}`);
            assert.deepEqual(await faintTexts(page), [], tab);
        }
        await page.click("#stop");
        await until(page, () => studio.status.state === "stopped");
        await page.waitForTimeout(400);
        await picture(page, `stop-${colorScheme}`);
        assert.deepEqual(await faintTexts(page), [], "stopped");
        await page.click("#pad-cover-button");
        await until(page, () => studio.runs);
        await page.context().close();
        await takeOver(main);
    });

for (const colorScheme of ["light", "dark"])
    (colorScheme === "light" ? test : serverTest)(`on a phone STOP is in reach, a finger strokes, and nothing is wider than the screen: ${colorScheme}`, async (main) => {
        const page = await open({ ...AS_PHONE, colorScheme });
        if (!(await page.evaluate(() => studio.status.owner))) {
            await picture(page, `phone-not-owner-${colorScheme}`);
            await page.tap("#pad-cover-button");
            await until(page, () => studio.status.owner);
        }
        const port = await page.evaluate(() => studio.graph.maps[0].force_port);
        const hand = await finger(page);
        let most = 0;
        await stroke(page, 0, 900, async () => (most = Math.max(most, (await latest(page, port)) || 0)), hand); // there may be none yet
        const force_n = await page.evaluate(() => studio.pad.hands.force_n);
        assert(Math.abs(most / force_n - 1) < 0.1, `a finger presses with ${most} N, the slider says ${force_n} N`);
        await demo(page, true);
        for (const tab of ["views", "scopes", ...TABS]) {
            await page.tap(`#phone-tabs [data-for=${tab}]`);
            await page.waitForTimeout(700);
            await picture(page, `phone-${tab}-${colorScheme}`);
            await assertFits(page, tab);
            assert.deepEqual(await faintTexts(page), [], tab);
        }
        await page.tap("#stop");
        await until(page, () => studio.status.state === "stopped");
        await picture(page, `phone-stop-${colorScheme}`);
        await assertFits(page, "stopped");
        // All that the bar can say at once.
        await page.evaluate(() => {
            document.getElementById("moves-what").textContent = "real";
            document.getElementById("state").textContent = "connecting";
        });
        await assertFits(page, "with a full bar");
        await page.tap("#pad-cover-button");
        await until(page, () => studio.runs);
        await page.context().close();
        await takeOver(main);
    });

// Is STOP in reach, and nothing beyond the edge of the screen?
async function assertFits(page, when) {
    const { stop, wide, beyond } = await page.evaluate(() => {
        const button = document.getElementById("stop");
        const { left, right, top, bottom, width, height } = button.getBoundingClientRect();
        const hit = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
        const isInside = left >= 0 && top >= 0 && right <= innerWidth && bottom <= innerHeight;
        const parts = document.querySelectorAll("body > * > *, .panel-bar > *, .pad-tools > *, .sound > *");
        return {
            stop: { isSeen: hit === button && isInside, width, height },
            wide: document.scrollingElement.scrollWidth - innerWidth,
            beyond: [...parts]
                .filter((part) => part.checkVisibility({ visibilityProperty: true, opacityProperty: true }))
                .filter((part) => part.getBoundingClientRect().right > innerWidth + 0.5)
                .map((part) => part.id || part.className || part.textContent),
        };
    });
    assert(stop.isSeen && Math.min(stop.width, stop.height) >= LEAST_FINGER_PX, `${when}: ${JSON.stringify(stop)}`);
    assert(wide <= 0, `${when}: ${wide} px too wide`);
    assert.deepEqual(beyond, [], `${when}: beyond the edge`);
}

// Notes what jumps from now on; the result fails where that is too much.
async function watchShifts(page) {
    await page.evaluate(() => {
        window.shifts = [];
        const keep = (list) =>
            list
                .getEntries()
                .forEach(({ value, sources }) =>
                    window.shifts.push([
                        value,
                        sources.map(({ node }) => node?.id || node?.className || node?.nodeName).join(" "),
                    ]),
                );
        new PerformanceObserver(keep).observe({ type: "layout-shift", buffered: false });
    });
    return async () => {
        const shifts = await page.evaluate(() => window.shifts);
        const sum = shifts.reduce((all, [value]) => all + value, 0);
        assert(sum < MOST_SHIFT, `${sum.toFixed(4)}: ${JSON.stringify(shifts)}`);
    };
}

serverTest("nothing jumps while one strokes, stops and goes on", async (main) => {
    const page = await open();
    await takeOver(page);
    await page.waitForTimeout(1000);
    const assertStill = await watchShifts(page);
    await stroke(page, 0.4, 2000);
    await demo(page, true);
    await page.waitForTimeout(1500);
    await page.click("#stop");
    await until(page, () => studio.status.state === "stopped");
    await page.click("#pad-cover-button");
    await until(page, () => studio.runs);
    await page.waitForTimeout(800);
    await assertStill();
    await page.context().close();
    await takeOver(main);
});

serverTest("nothing jumps while one changes the tab and edits", async (main) => {
    const page = await open();
    await takeOver(page);
    for (const tab of TABS) await page.evaluate((name) => studio.showTab(name), tab);
    await page.waitForTimeout(1000);
    const assertStill = await watchShifts(page);
    for (const tab of [...TABS, ...TABS]) {
        await page.evaluate((name) => studio.showTab(name), tab);
        await page.waitForTimeout(250);
    }
    await page.evaluate(() => studio.showTab("editor"));
    // Nothing that is written moves what stands after it.
    const write = (changes) => page.evaluate((given) => studio.editor.dispatch({ changes: given }), changes);
    const { length, at } = await page.evaluate(() => {
        const text = studio.graph.text;
        return { length: text.length, at: text.indexOf("SpeedEstimator(") };
    });
    await write({ from: at + 2, to: at + 3, insert: "E" });
    await page.waitForSelector("#problems li");
    await page.waitForTimeout(300);
    await write({ from: at + 2, to: at + 3, insert: "e" });
    await until(page, () => document.querySelectorAll("#problems li").length === 0);
    for (const change of [
        { from: length, insert: "// an edit" },
        { from: length, to: length + 10 },
    ]) {
        await write(change);
        await page.evaluate(() => document.getElementById("editor-apply").click());
        await until(page, () => studio.graph.text === studio.editor.state.doc.toString());
        await page.waitForTimeout(500);
    }
    await assertStill();
    await page.context().close();
    await takeOver(main);
});

serverTest("nothing jumps where the connection is lost and comes back", async (main) => {
    const proxy = await proxyTo(address);
    const page = await open({ at: proxy.address, expected: /WebSocket|ERR_|Failed to load/ });
    await takeOver(page);
    await page.waitForTimeout(1000);
    const assertStill = await watchShifts(page);
    proxy.cut();
    await until(page, () => !document.getElementById("banner").hidden);
    await picture(page, "lost");
    await page.waitForTimeout(1500);
    proxy.mend();
    await until(page, () => document.getElementById("banner").hidden && studio.runs);
    await page.waitForTimeout(1000);
    await assertStill();
    await page.context().close();
    proxy.close();
    await takeOver(main);
});

// What has the focus: its id, label or class; and whether that is seen.
const focused = (page) =>
    page.evaluate(() => {
        let element = document.activeElement;
        while (element?.shadowRoot?.activeElement) element = element.shadowRoot.activeElement;
        if (element === document.body) return { name: "the page", isMarked: true }; // from its end to its beginning
        const name =
            element.id || element.dataset.for || element.dataset.node || element.getAttribute("aria-label") || element.className;
        const marked = element.closest(".cm-editor") ?? element;
        return { name, isMarked: element instanceof SVGElement || getComputedStyle(marked).outlineStyle !== "none" };
    });

test("the keyboard reaches STOP, the controls and the editor, and leaves them again", async (main) => {
    const page = await open();
    await takeOver(page);
    await page.evaluate(() => studio.showTab("graph"));
    const order = [];
    const press = async (key) => {
        await page.keyboard.press(key);
        const now = await focused(page);
        for (let look = 0; look < 10 && !now.isMarked; look++) {
            await page.waitForTimeout(50); // the editor marks itself a little later
            now.isMarked = (await focused(page)).isMarked;
        }
        if (key === "Tab") assert(now.isMarked, `nothing shows that ${now.name} has the focus`);
        return now.name;
    };
    const tabTo = async (wanted) => {
        for (let count = 0; count < MOST_TABS; count++) {
            const name = await press("Tab");
            order.push(name);
            if (wanted(name)) return name;
        }
        throw new Error(`not reached in ${MOST_TABS} steps: ${order.join(" ")}`);
    };
    await tabTo((name) => name === "graph");
    for (const [earlier, later] of [
        ["skip", "sound"],
        ["sound", "level"],
        ["level", "stop"],
        ["stop", "pad"],
        ["pad", "force"],
        ["force", "record"],
        ["record", "demo"],
        ["demo", "scope-add"],
        ["scope-add", "graph"],
    ])
        assert(
            order.includes(later) && order.indexOf(earlier) < order.indexOf(later),
            `${earlier} then ${later}: ${order.join(" ")}`,
        );
    // The tabs are one stop; arrows move in them.
    const choose = async (tab) => {
        await page.focus("#tabs [aria-selected=true]");
        for (let count = 0; count < TABS.length; count++) if ((await press("ArrowRight")) === tab) return;
        throw new Error(`no tab ${tab}`);
    };
    await choose("editor");
    await tabTo((name) => name.includes("cm-content") || name === "The graph's text");
    const text = await page.evaluate(() => studio.editor.state.doc.toString());
    await press("Tab");
    assert.notEqual((await focused(page)).name, "The graph's text", "the editor keeps the focus");
    assert.equal(await page.evaluate(() => studio.editor.state.doc.toString()), text);
    await choose("controls");
    const slider = await page.evaluate(() => document.querySelector("#controls input[type=range]").getAttribute("aria-label"));
    await tabTo((name) => name === slider);
    const value = () => page.evaluate(() => document.activeElement.value);
    const before = await value();
    await page.keyboard.press("ArrowRight");
    assert.notEqual(await value(), before, "an arrow does not turn it");
    await page.keyboard.press("ArrowLeft");
    await page.focus("#stop");
    await page.keyboard.press("Enter");
    await until(page, () => studio.status.state === "stopped");
    await page.focus("#pad");
    await tabTo((name) => name === "pad-cover-button");
    await page.keyboard.press("Enter");
    await until(page, () => studio.runs);
    await page.context().close();
    await takeOver(main);
});

siteTest("a site over plain HTTP from another machine says why no engine runs, and what to do", async () => {
    const at = new URL(address);
    at.hostname = FAR_NAME;
    const page = await open({ at: at.href, isReady: (far) => far.waitForSelector("#banner:not([hidden])") });
    assert.equal(await page.evaluate(() => isSecureContext), false);
    assert.match(await page.textContent("#banner"), /^Browsers run the engine of this page only .* open its https address/);
    await until(page, () => document.getElementById("status-text").textContent.includes("No engine can run at this address"));
    await picture(page, "plain-http");
    await page.context().close();
});

test("STOP and the force of the hand are in view at every width", async (page) => {
    const before = page.viewportSize();
    for (let width = 320; width <= 1600; width += 80) {
        await page.setViewportSize({ width, height: 800 });
        const { left, right, top } = await page.evaluate(() => document.getElementById("stop").getBoundingClientRect().toJSON());
        assert(left >= 0 && right <= width && top >= 0, `${left} to ${right} of ${width} px`);
        const [force, record] = await page.evaluate(() => ["force-text", "record"].map((id) => document.getElementById(id).getBoundingClientRect().toJSON()));
        assert(force.right <= record.left, `the force is at ${force.right}, a button at ${record.left} of ${width} px`);
    }
    await page.setViewportSize(before);
});

test("the whole of the graph can be read in the window, and its nodes be found", async (page) => {
    const before = page.viewportSize();
    await page.setViewportSize({ width: 1440, height: 900 });
    await page.click('#tabs [data-for="graph"]');
    for (let press = 0; press < 2; press++) await page.click("#expand");
    await page.click(".graph-buttons button:last-child"); // Fit
    const seen = await page.evaluate(() => {
        const root = document.getElementById("graph").firstElementChild.shadowRoot;
        const panel = document.getElementById("graph").getBoundingClientRect();
        const names = [...root.querySelectorAll("[data-node] text.strong")];
        return names.map((name) => {
            const { left, right, top, bottom } = name.getBoundingClientRect();
            const isIn = left >= panel.left && right <= panel.right && top >= panel.top && bottom <= panel.bottom;
            return { isIn, px: (12 * name.getBoundingClientRect().height) / name.getBBox().height };
        });
    });
    assert(seen.length > 3 && seen.every(({ isIn, px }) => isIn && px >= 9), JSON.stringify(seen));
    await page.fill(".graph-search input", "zz nothing");
    const dim = () => page.evaluate(() => document.getElementById("graph").firstElementChild.shadowRoot.querySelectorAll(".dim").length);
    assert.equal(await dim(), seen.length);
    await page.fill(".graph-search input", "");
    assert.equal(await dim(), 0);
    await page.click("#expand");
    await page.setViewportSize(before);
});
