// Keeps a site for use without a network: what was loaded at once, and the rest of the graphs once one has run for a while.
const SETTLED_MS = 3000;

async function keep() {
    const { serviceWorker } = navigator;
    await serviceWorker.register(new URL("sw.js", import.meta.url));
    const worker = (await serviceWorker.ready).active;
    const loaded = performance.getEntriesByType("resource").map(({ name }) => name);
    worker.postMessage({ keep: [location.href, ...loaded] });
    if (navigator.connection?.saveData) return;
    const timer = setInterval(() => {
        if (globalThis.studio?.connection.engine?.context?.state !== "running") return;
        clearInterval(timer);
        worker.postMessage({ keep: null });
    }, SETTLED_MS);
}

// Browsers have it for https and this machine only; without it the site works as any other.
if (navigator.serviceWorker) setTimeout(() => keep().catch(() => {}), SETTLED_MS);
