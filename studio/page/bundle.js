// The running graph and the files that it needs as one archive, which another machine unpacks and opens.
import { save } from "./dom.js";
import { zip } from "./zip.js";

export async function saveBundle(studio) {
    const { bundle, error } = await studio.connection.request({ type: "files" });
    if (!bundle) return studio.say("bad", `The graph was not downloaded: ${error}`);
    const { name } = studio.graph;
    const files = bundle.files.map(({ path, base64 }) => ({ path: `${name}/${path}`, bytes: Uint8Array.from(atob(base64), (byte) => byte.charCodeAt(0)) }));
    const readme = `${name}, by haptograph ${studio.hello.haptograph}. In this folder:\n\n    ${commandOf(bundle)}\n`;
    save(`${name}.zip`, zip([...files, { path: `${name}/README.txt`, bytes: new TextEncoder().encode(readme) }]));
}

// As a POSIX shell takes it.
export function commandOf({ graph, set }) {
    const quoted = (word) => (/^[\w./=-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`);
    const words = ["haptograph", "studio", graph, ...set.flatMap(([name, value]) => ["--set", `${name}=${value}`])];
    return words.map(quoted).join(" ");
}
