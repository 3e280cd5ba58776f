// A server of static files that knows nothing of what it serves, as any web server does; the site lies in a subfolder.
import { createReadStream, statSync } from "node:fs";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";

const BELOW = "/some/where/";
const KINDS = {
    ".html": "text/html",
    ".js": "text/javascript",
    ".css": "text/css",
    ".svg": "image/svg+xml",
    ".json": "application/json",
};

export function serve(folder) {
    const server = createServer((request, response) => {
        const path = decodeURIComponent(new URL(request.url, "http://localhost").pathname);
        const inside = path.startsWith(BELOW) ? normalize(path.slice(BELOW.length)) : "..";
        const file = join(folder, inside === "." ? "index.html" : inside);
        const found = !inside.startsWith("..") && statSync(file, { throwIfNoEntry: false })?.isFile();
        response.writeHead(found ? 200 : 404, { "content-type": KINDS[extname(file)] ?? "application/octet-stream" });
        if (found) createReadStream(file).pipe(response);
        else response.end();
    });
    return new Promise((done) =>
        server.listen(0, "127.0.0.1", () =>
            done({ address: `http://127.0.0.1:${server.address().port}${BELOW}`, close: () => server.close() }),
        ),
    );
}
