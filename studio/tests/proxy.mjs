// Stands between a page and its server, so that a test can cut the connection or hold back what the server says.
import { createServer, request } from "node:http";
import { connect } from "node:net";

export function proxyTo(address) {
    const { hostname, port, host, search } = new URL(address);
    const links = new Set(); // WebSockets as { near, far, kept }
    const state = { isCut: false, holds: false };
    // The server answers to its own name only.
    const renamed = (headers, from, to) =>
        Object.fromEntries(Object.entries(headers).map(([name, value]) => [name, String(value).replaceAll(from, to)]));
    const server = createServer((asked, answer) => {
        const headers = renamed(asked.headers, asked.headers.host, host);
        const onward = request({ hostname, port, path: asked.url, method: asked.method, headers }, (got) => {
            answer.writeHead(got.statusCode, renamed(got.headers, host, asked.headers.host));
            got.pipe(answer);
        });
        onward.on("error", () => answer.destroy());
        asked.pipe(onward);
    });
    server.on("upgrade", (asked, near) => {
        if (state.isCut) return near.destroy();
        const far = connect(Number(port), hostname);
        const link = { near, far, kept: [] };
        const headers = Object.entries(renamed(asked.headers, asked.headers.host, host));
        far.write(`GET ${asked.url} HTTP/1.1\r\n${headers.map(([name, value]) => `${name}: ${value}\r\n`).join("")}\r\n`);
        near.on("data", (bytes) => far.write(bytes));
        far.on("data", (bytes) => (state.holds ? link.kept.push(bytes) : near.write(bytes)));
        for (const [one, other] of [
            [near, far],
            [far, near],
        ]) {
            one.on("close", () => (other.destroy(), links.delete(link)));
            one.on("error", () => other.destroy());
        }
        links.add(link);
    });
    const control = {
        // Ends the connections; new ones are refused until `mend`.
        cut() {
            state.isCut = true;
            for (const { near, far } of links) (near.destroy(), far.destroy());
        },
        mend() {
            state.isCut = false;
        },
        // What the server says is kept until `release`; what the page says goes on.
        hold() {
            state.holds = true;
        },
        release() {
            state.holds = false;
            for (const link of links) for (const bytes of link.kept.splice(0)) link.near.write(bytes);
        },
        close() {
            control.cut();
            server.close();
        },
    };
    return new Promise((done) =>
        server.listen(0, "127.0.0.1", () => done({ address: `http://127.0.0.1:${server.address().port}/${search}`, ...control })),
    );
}
