// The two windows of a study that runs in a page: the experimenter's has the engine, the participant's, which it opens, a port to it.
const ASKS_MS = 500;
const GONE_MS = 2500;
const MARK = "haptograph-study";

// In the experimenter's window: lets the participant's in, and notices when it is gone. The latest one counts.
export function letIn(engine) {
    let guest = null;
    let heard_ms = 0;
    const leave = () => {
        guest = null;
        engine.letOut();
    };
    window.addEventListener("message", ({ data, origin, source }) => {
        if (origin !== location.origin || data?.[MARK] !== "participant" || !engine.node) return;
        const own = engine.number; // another one after the engine was opened again
        if (data.leaves) return data.guest === guest && leave();
        const isNew = data.engine !== own || guest === null;
        if (isNew) guest = data.guest;
        if (guest === data.guest) heard_ms = performance.now();
        const answer = { [MARK]: "engine", engine: own, isYours: guest === data.guest };
        source.postMessage(answer, { targetOrigin: origin, transfer: isNew ? [engine.letIn()] : [] });
    });
    setInterval(() => guest !== null && performance.now() - heard_ms > GONE_MS && leave(), ASKS_MS);
}

const TAKEN = "Another window of the participant is open.";
const GONE = "The experimenter's page is closed.";
const ALONE = "This page is opened by the experimenter's page.";

// In the participant's: asks the window that opened it for a port. `joined` gets it, `lost` why there is none.
export function askOpener({ joined, lost }) {
    if (!window.opener) return lost(ALONE);
    const guest = crypto.randomUUID();
    let engine = null;
    let heard_ms = performance.now();
    let isOver = false;
    const end = (why) => {
        engine = null;
        lost(why);
    };
    window.addEventListener("message", ({ data, origin, source, ports }) => {
        if (isOver || origin !== location.origin || source !== window.opener || data?.[MARK] !== "engine") return;
        heard_ms = performance.now();
        if (!data.isYours) {
            isOver = true;
            return end(TAKEN);
        }
        if (ports.length === 0) return;
        if (engine !== null) end(GONE);
        engine = data.engine;
        joined(ports[0]);
    });
    const ask = () => {
        if (!isOver && window.opener) window.opener.postMessage({ [MARK]: "participant", guest, engine }, location.origin);
        if (engine !== null && performance.now() - heard_ms > GONE_MS) end(GONE);
    };
    window.addEventListener("pagehide", () => window.opener?.postMessage({ [MARK]: "participant", guest, leaves: true }, location.origin));
    setInterval(ask, ASKS_MS);
    ask();
}
