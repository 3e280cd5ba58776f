// Scenarios of a site as a visitor finds it: its gallery, a recipe, the documentation, a phone, no network.
import assert from "node:assert/strict";
import { gzipSync } from "node:zlib";
import { AS_PHONE, AXE, browser, demo, open, PATIENCE_MS, served, siteTest, until } from "./harness.mjs";

// Gzipped, of all that is loaded before the first sound; of it the engine is 1.08.
const MOST_BYTES = 1.4e6;
const sounds = (page) => until(page, () => studio.sound.report?.playing && studio.sound.report.peak > 1e-5);
const galleryReady = (page) => page.waitForSelector(".card a", { timeout: PATIENCE_MS });
const visit = (options = {}) => open({ at: served.address, isReady: galleryReady, ...options });

// Presses Start where the browser wants it, strokes, and listens.
async function hear(page) {
    await until(page, () => window.studio?.hello && studio.graph && studio.status);
    if (await page.locator("#pad-cover-button").isVisible()) await page.click("#pad-cover-button");
    await until(page, () => studio.runs);
    if ((await page.getAttribute("#sound", "aria-pressed")) === "false") await page.click("#sound");
    await demo(page, true);
    await sounds(page);
}

siteTest("a visitor finds a recipe in the gallery, strokes it and hears it, and comes back", async () => {
    const page = await visit();
    assert((await page.locator(".card").count()) > 20, "cards are missing");
    const images = page.locator(".card img");
    for (const image of await images.all()) {
        await image.scrollIntoViewIfNeeded();
        await page.waitForFunction((shown) => shown.complete && shown.naturalWidth > 0, await image.elementHandle());
    }
    await page.fill("#find", "ridges vibration");
    await page.fill("#find", "grating");
    await page.waitForFunction(() => document.querySelectorAll(".card:not([hidden])").length === 1);
    await page.click(".card:not([hidden]) a");
    await hear(page);
    assert.equal(await page.evaluate(() => studio.graph.name), "grating");
    assert.equal(await page.inputValue("#graph-choice"), "grating");
    await page.click("#home");
    await galleryReady(page);
    await page.context().close();
});

siteTest("an old address of a graph still opens it", async () => {
    const page = await open({ at: `${served.address}?graph=click` });
    assert.equal(await page.evaluate(() => studio.graph.name), "click");
    await page.context().close();
});

siteTest("little is loaded before the first sound", async () => {
    const bytes = new Map();
    const context = await browser.newContext({ viewport: { width: 1440, height: 900 } });
    const page = await context.newPage();
    const loads = [];
    context.on("response", (response) =>
        loads.push(response.body().then((body) => bytes.set(response.url(), gzipSync(body).length), () => {})),
    );
    await page.goto(served.address);
    await galleryReady(page);
    // The mouse would lie where the drawing is then, which a hand there may change.
    await page.focus("#stroke");
    await page.keyboard.press("Enter");
    await hear(page);
    await Promise.all(loads);
    const sum = [...bytes.values()].reduce((all, each) => all + each, 0);
    const largest = [...bytes].sort((a, b) => b[1] - a[1]).slice(0, 6);
    console.log(`        ${bytes.size} files, ${(sum / 1e6).toFixed(2)} MB gzipped; ${largest.map(([url, size]) => `${url.split("/").at(-1)} ${(size / 1e3).toFixed(0)} kB`).join(", ")}`);
    assert(![...bytes.keys()].some((url) => url.includes("codemirror") || url.includes("whole.wasm")), "what is not needed is loaded");
    await context.close();
    assert(sum < MOST_BYTES, `${sum} bytes`);
});

siteTest("a page of the documentation runs its graphs in place, one at a time", async () => {
    const page = await open({ at: `${served.address}docs/cookbook.html`, isReady: (page) => page.waitForSelector("button.run") });
    const [first, second] = ["grating", "click"].map((name) => page.locator(`button.run[data-graph=${name}]`));
    await first.click();
    await second.click();
    assert.equal(await page.locator("iframe").count(), 1);
    const frame = await (await page.waitForSelector("iframe")).contentFrame();
    await hear(frame);
    assert.equal(await frame.evaluate(() => studio.graph.name), "click");
    await second.click();
    assert.equal(await page.locator("iframe").count(), 0);
    await page.context().close();
});

siteTest("links of the documentation lead to pages that are there, and pictures are shown", async () => {
    const page = await open({ at: `${served.address}docs/index.html`, isReady: (page) => page.waitForSelector("h1") });
    const seen = new Map();
    const read = async (address) => {
        if (!seen.has(address)) seen.set(address, await (await page.request.get(address)).text());
        return seen.get(address);
    };
    const wait = [page.url()];
    const looked = new Set();
    while (wait.length) {
        const address = wait.pop();
        if (looked.has(address)) continue;
        looked.add(address);
        const found = (await read(address)).matchAll(/(?:href|src)="([^"]+)"/g);
        for (const [, link] of found) {
            const target = new URL(link.replaceAll("&amp;", "&"), address);
            if (target.origin !== new URL(address).origin) continue;
            const plain = target.origin + target.pathname;
            const answer = seen.has(plain) ? null : await page.request.get(plain);
            assert(!answer || answer.ok(), `${address} links ${plain}`);
            if (!plain.includes("/docs/") || !plain.endsWith(".html")) seen.set(plain, seen.get(plain) ?? "");
            else {
                const text = await read(plain);
                const part = decodeURIComponent(target.hash.slice(1));
                assert(!part || text.includes(`id="${part}"`), `${address} links ${plain}#${part}`);
                wait.push(plain);
            }
        }
    }
    assert(looked.size > 25, `${looked.size} pages`);
    await page.context().close();
});

siteTest("the gallery and the documentation suit a phone", async () => {
    for (const [path, look] of [["", ".card a"], ["docs/cookbook.html", "h1"], ["docs/studio.html", "h1"]]) {
        const page = await open({ at: served.address + path, isReady: (page) => page.waitForSelector(look), ...AS_PHONE });
        const width = await page.evaluate(() => document.documentElement.scrollWidth);
        assert(width <= 390, `${path || "the gallery"} is ${width} px wide`);
        if (path === "") {
            await page.tap("#stroke");
            await hear(page);
        }
        await page.context().close();
    }
});

siteTest("once visited, the site works without a network", async () => {
    const page = await visit();
    await page.click("#stroke");
    await hear(page);
    // The rest comes once the graph has run for a while.
    const isKept = () =>
        page.evaluate(async () => {
            const [name] = await caches.keys();
            const kept = name ? await (await caches.open(name)).keys() : [];
            return ["index.html", "whole.wasm", "worklet.js"].every((file) => kept.some(({ url }) => url.endsWith(`/${file}`)));
        });
    const begun_ms = performance.now();
    while (!(await isKept())) {
        assert(performance.now() - begun_ms < 4 * PATIENCE_MS, "it is not kept");
        await page.waitForTimeout(300);
    }
    await page.context().setOffline(true);
    await page.goto(served.address);
    await galleryReady(page);
    await page.click(".card[data-name=sandpaper] a");
    await hear(page);
    assert.equal(await page.evaluate(() => studio.graph.name), "sandpaper");
    await page.context().setOffline(false);
    await page.context().close();
});

siteTest("the gallery and the documentation are accessible, light and dark", async () => {
    for (const colorScheme of ["light", "dark"])
        for (const [path, look] of [["", ".card a"], ["docs/cookbook.html", "button.run"]]) {
            const isReady = (page) => page.waitForSelector(look);
            const page = await open({ at: served.address + path, isReady, colorScheme, bypassCSP: true });
            await page.evaluate(AXE);
            const { violations } = await page.evaluate(() => axe.run());
            const found = violations.map(({ id, nodes }) => `${id}: ${nodes[0].html}`);
            assert.deepEqual(found, [], `${path} ${colorScheme}`);
            await page.context().close();
        }
});
