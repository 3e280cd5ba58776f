// The service worker of a site: it gives out what it kept as long as the server has the same export, and without a network.
// Each export has another version, so that its worker replaces this one with all that it kept.
const VERSION = "VERSION OF THE SITE";
const OWN = `haptograph ${registration.scope} `;
const KEPT = OWN + VERSION;
const ANSWERS_MS = 3000; // a server that does not answer is none
const UNASKED = "docs/"; // kept when read, as its pictures are large

let latest = null; // whether the server has no other export

async function askServer() {
    try {
        const script = await fetch("sw.js", { cache: "no-store", signal: AbortSignal.timeout(ANSWERS_MS) });
        return !script.ok || (await script.text()).includes(VERSION);
    } catch {
        return true;
    }
}

// The address by which a file is kept: the studio's page is the same for every graph.
function plain(address) {
    const { origin, pathname } = new URL(address);
    return origin + pathname.replace(/\/$/, "/index.html");
}

async function take(cache, address, response) {
    if (response.ok && !response.redirected && response.status === 200) await cache.put(plain(address), response.clone());
    return response;
}

async function answer(request) {
    if (request.mode === "navigate") latest = null;
    latest ??= askServer();
    if (!(await latest)) return fetch(request);
    const cache = await caches.open(KEPT);
    return (await cache.match(plain(request.url))) ?? take(cache, request.url, await fetch(request));
}

async function keep(addresses) {
    if (!(await askServer())) return;
    const cache = await caches.open(KEPT);
    if (!addresses) {
        const { sha256 } = await (await fetch("files.json")).json();
        const names = Object.keys(sha256).filter((name) => !name.startsWith(UNASKED));
        addresses = [...names, "site.json"].map((name) => new URL(name.split("/").map(encodeURIComponent).join("/"), registration.scope).href);
    }
    for (const address of new Set(addresses.filter((address) => address.startsWith(registration.scope)).map(plain))) {
        if (!(await cache.match(address))) await take(cache, address, await fetch(address)).catch(() => {});
    }
}

async function forgetOthers() {
    for (const name of await caches.keys()) if (name.startsWith(OWN) && name !== KEPT) await caches.delete(name);
    await clients.claim();
}

self.addEventListener("install", () => self.skipWaiting());
self.addEventListener("activate", (event) => event.waitUntil(forgetOthers()));
self.addEventListener("message", (event) => event.waitUntil(keep(event.data.keep)));
self.addEventListener("fetch", (event) => {
    const { request } = event;
    if (request.method === "GET" && request.url.startsWith(registration.scope)) event.respondWith(answer(request));
});
