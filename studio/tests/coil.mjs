// A coil that another program owns, at the other end of the device protocol (docs/device-protocol.md): it senses nothing,
// and notes the currents that it is driven by.
import { createSocket } from "node:dgram";

const STATE_BYTES = 120;
const COMMAND_BYTES = 72;
const CURRENT_AT = 48;
const VERSION = 1;
const STATE = 1;
const COMMAND = 2;
const EVERY_MS = 2;

// `place` is where the graph listens.
export async function coil() {
    const [socket, free] = [createSocket("udp4"), createSocket("udp4")];
    const bound = (one) => new Promise((done) => one.bind(0, "127.0.0.1", done));
    await Promise.all([bound(socket), bound(free)]);
    const { port } = free.address();
    await new Promise((done) => free.close(done));
    const begun_ns = process.hrtime.bigint();
    const currents = [];
    let sequence = 0;
    socket.on("message", (bytes) => {
        if (bytes.length === COMMAND_BYTES && bytes.readUInt16LE(6) === COMMAND) currents.push(bytes.readDoubleLE(CURRENT_AT));
    });
    socket.on("error", () => {}); // nobody listens between two runs
    const timer = setInterval(() => {
        const state = Buffer.alloc(STATE_BYTES);
        state.write("HGRF");
        state.writeUInt16LE(VERSION, 4);
        state.writeUInt16LE(STATE, 6);
        state.writeUInt32LE(sequence++ >>> 0, 8);
        state.writeBigUInt64LE(process.hrtime.bigint() - begun_ns, 16);
        socket.send(state, port, "127.0.0.1");
    }, EVERY_MS);
    return {
        place: `127.0.0.1:${port}`,
        // What it was driven by since this was asked last.
        take: () => currents.splice(0),
        close: () => (clearInterval(timer), socket.close()),
    };
}
