// A Worker with the WebSocket in it: sound goes from here to the player by a port of its own, past whatever the page
// is busy with. All else goes to the page.
const SOUND = 3;
const WATCH_MS = 100;
let socket = null;
let player = null;
let said = null;

onmessage = ({ data: { what, address, protocol, message, port } }) => {
    if (what === "connect") connect(address, protocol);
    else if (what === "send" && socket?.readyState === WebSocket.OPEN) {
        socket.send(message);
        said = null;
    } else if (what === "player") player = port;
};

function connect(address, protocol) {
    socket = new WebSocket(address, protocol);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => postMessage({ what: "open" });
    socket.onclose = () => postMessage({ what: "close" });
    socket.onmessage = ({ data }) => {
        const binary = data instanceof ArrayBuffer;
        if (binary && player && new Uint8Array(data, 0, 1)[0] === SOUND) player.postMessage(data, [data]);
        else postMessage({ what: "message", data }, binary ? [data] : []);
    };
}

// How much still waits here, for the progress of what is long.
setInterval(() => {
    const unsent = socket?.bufferedAmount ?? 0;
    if (unsent !== said) postMessage({ what: "unsent", unsent });
    said = unsent;
}, WATCH_MS);
