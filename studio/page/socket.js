// A Worker that holds the connection to the engine, a WebSocket or a port to the page's audio thread. A server's sound
// goes from here to the player by a port of its own, without waiting for the page; the simulated hand runs here. All
// other messages go to the page.
import { EngineLink } from "./engine-link.js";
import { pointers } from "./frames.js";
import { Stroke } from "./stroke.js";

const SOUND = 3;
const WATCH_MS = 100;
const STROKE_MS = 5; // as a pen tablet reports
let socket = null;
let player = null;
let said = null;
let stroke = null;
let page_ms = 0; // the page's clock less this one

const hear = {
    connect: ({ address, protocol, engine, origin_ms }) => {
        page_ms = performance.timeOrigin - origin_ms;
        if (engine) (follow(new EngineLink(engine)), postMessage({ what: "open" }));
        else connect(address, protocol);
    },
    send: ({ message }) => send(message),
    player: ({ port }) => (player = port),
    stroke: ({ pad, force_n }) => guide(pad, force_n),
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

// Begins to stroke, changes the force, or lifts the hand if there is no pad.
function guide(pad, force_n) {
    const now_ms = performance.now() + page_ms;
    if (pad && stroke) stroke.force_n = force_n;
    else if (pad) stroke = new Stroke(pad, force_n, now_ms);
    else if (stroke) {
        send(pointers(0, [{ ...stroke.sample(now_ms), force_n: 0 }]));
        stroke = null;
    }
}

setInterval(() => {
    const samples = stroke?.until(performance.now() + page_ms) ?? [];
    if (samples.length === 0) return;
    send(pointers(0, samples));
    postMessage({ what: "stroked", samples });
}, STROKE_MS);

// Number of bytes that wait to be sent, for the progress of long messages.
setInterval(() => {
    const unsent = socket?.bufferedAmount ?? 0;
    if (unsent !== said) postMessage({ what: "unsent", unsent });
    said = unsent;
}, WATCH_MS);
