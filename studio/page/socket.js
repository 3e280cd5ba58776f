// A Worker that holds the connection to the engine, a WebSocket or a port to the page's audio thread. A server's sound
// goes from here to the player by a port of its own, without waiting for the page; simulated hands run here. All
// other messages go to the page.
import { EngineLink } from "./engine-link.js";
import { pointers } from "./frames.js";
import { Stroke } from "./gestures.js";

const SOUND = 3;
const WATCH_MS = 100;
const STROKE_MS = 10;
let socket = null;
let player = null;
let said = null;
let stroke = null;
let graph = 0; // the number of the graph whose pads are stroked
let page_ms = 0; // the page's clock less this one

const hear = {
    connect: ({ address, protocol, engine, origin_ms }) => {
        page_ms = performance.timeOrigin - origin_ms;
        if (engine) (follow(new EngineLink(engine)), postMessage({ what: "open" }));
        else connect(address, protocol);
    },
    send: ({ message }) => send(message),
    player: ({ port }) => (player = port),
    stroke: ({ how }) => guide(how),
    graph: ({ number }) => (graph = number),
    surfaces: () => socket?.loadSurfaces?.(),
};
onmessage = ({ data }) => hear[data.what]?.(data);

function connect(address, protocol) {
    const opening = new WebSocket(address, protocol);
    opening.binaryType = "arraybuffer";
    opening.onopen = () => postMessage({ what: "open" });
    follow(opening);
}

function follow(link) {
    socket = link;
    socket.onclose = ({ reason }) => {
        stroke = null;
        postMessage({ what: "close", reason });
    };
    socket.onmessage = ({ data }) => {
        const binary = data instanceof ArrayBuffer;
        if (binary && player && new Uint8Array(data, 0, 1)[0] === SOUND) player.postMessage(data, [data]);
        else postMessage({ what: "message", data }, binary ? [data] : []);
    };
}

function send(message) {
    if (socket?.readyState !== WebSocket.OPEN) return;
    socket.send(message);
    said = null;
}

// Begins to stroke with `hands`, changes gesture and force, or lifts the hands if `how` is null.
function guide(how) {
    if (how && !how.hands) return stroke?.change(how);
    stroke?.end().forEach(sendPlanned);
    stroke = how && new Stroke(how, performance.now() + page_ms);
}

const sendPlanned = ({ number, samples }) => send(pointers(number, samples, true, graph));

setInterval(() => {
    for (const part of stroke?.until(performance.now() + page_ms) ?? []) {
        sendPlanned(part);
        postMessage({ what: "stroked", ...part });
    }
}, STROKE_MS);

// Number of bytes that wait to be sent, for the progress of long messages.
setInterval(() => {
    const unsent = socket?.bufferedAmount ?? 0;
    if (unsent !== said) postMessage({ what: "unsent", unsent });
    said = unsent;
}, WATCH_MS);
