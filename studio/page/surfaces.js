// The surfaces of the folder as swatches, and recordings that are dropped on the page and learned.
import { find, imageOf, make, setText } from "./dom.js";

const MOST_BYTES = 64 * 1024 * 1024;

export function mountSurfaces(studio) {
    let shape = null;
    studio.on("graph", (graph) => {
        const now = JSON.stringify([graph.surfaces, graph.unreadable]);
        if (now !== shape) rebuild(studio, graph);
        shape = now;
        showCurrent(studio);
    });
    find("learn").addEventListener("change", (event) => {
        if (event.target.files[0]) learn(studio, event.target.files[0]);
        event.target.value = "";
    });
    mountDrop(studio);
    document.addEventListener("visibilitychange", () => document.hidden && studio.silence());
}

// The parameter that a click on a swatch sets.
export const parameterOf = (graph) => graph?.parameters.find(({ is_surface }) => is_surface) ?? null;

// A path as a value of the parameter: a RON string, which JSON writes in the same way, unless it is one already.
export const quoted = (path) => (path.startsWith('"') ? path : JSON.stringify(path));

// A path without the quotes.
export const bare = (path) => (/^"[^"\\]*"$/.test(path) ? path.slice(1, -1) : path);

export function currentSurface(graph) {
    if (!graph) return null;
    const runs = [parameterOf(graph)?.value, graph.maps[0]?.surface].filter(Boolean).map(bare);
    const named = (matches) => graph.surfaces.find(({ path }) => runs.some((value) => matches(value, bare(path))));
    return (
        named((value, path) => value === path) ??
        named((value, path) => value.endsWith(`/${path}`) || path.endsWith(`/${value}`)) ??
        null
    );
}

// A tone for each surface, to tell them apart at a glance, in every graph the same: its hue is that of the name.
export function toneOf(surface) {
    const hash = [...(surface?.name ?? "")].reduce((sum, letter) => Math.imul(sum ^ letter.codePointAt(0), 0x01000193) >>> 0, 0x811c9dc5);
    return `hsl(${Math.round((hash / 2 ** 32) * 360)} 45% 88%)`;
}

function rebuild(studio, graph) {
    const parameter = parameterOf(graph);
    const cards = graph.surfaces.map((surface) => {
        const { path, name, swatch } = surface;
        const card = make(
            "button",
            { class: "surface", "aria-pressed": "false", "data-path": path, title: bare(path) },
            make("span", { class: "picture" }, make("img", { src: imageOf(swatch), alt: "" })),
            make("span", { class: "name", text: name }),
        );
        card.style.setProperty("--tone", toneOf(surface));
        card.disabled = !parameter;
        card.addEventListener("click", () => choose(studio, parameter.name, path));
        return card;
    });
    cards.push(...graph.unreadable.map(unreadable));
    const messages = [...find("surfaces").querySelectorAll(".surface-message")];
    find("surfaces").replaceChildren(...messages, ...cards);
}

// A file of the folder that cannot be read as a surface: it is left as it is.
const unreadable = ({ path, name, error }) =>
    make(
        "button",
        { class: "surface unreadable", disabled: true, "data-path": path, title: `${bare(path)}: ${error}` },
        make("span", { class: "picture", text: "cannot be read" }),
        make("span", { class: "name", text: name }),
        make("span", { class: "why", text: error }),
    );

async function choose(studio, name, path) {
    const reply = await studio.parameter(name, quoted(path));
    if (!reply.ok) studio.say("bad", reply.error);
}

function showCurrent(studio) {
    const current = currentSurface(studio.graph);
    for (const card of find("surfaces").querySelectorAll(".surface:not(.unreadable)")) {
        card.setAttribute("aria-pressed", String(!studio.blind && card.getAttribute("data-path") === current?.path));
    }
    const parameter = parameterOf(studio.graph);
    const says = !studio.graph.surfaces.length
        ? "The surface folder is empty"
        : parameter
          ? "Click a surface to put it on the pad"
          : "This graph has no parameter for its surface";
    setText(find("surface-state"), says);
}

// Files dropped anywhere: recordings, presets, photographs.
function mountDrop(studio) {
    const cover = find("drop");
    let depth = 0;
    const hasFiles = (event) => [...(event.dataTransfer?.types ?? [])].includes("Files");
    window.addEventListener("dragenter", (event) => hasFiles(event) && ((cover.hidden = false), depth++));
    window.addEventListener("dragleave", (event) => hasFiles(event) && --depth <= 0 && (cover.hidden = true));
    window.addEventListener("dragover", (event) => hasFiles(event) && event.preventDefault());
    window.addEventListener("drop", (event) => {
        if (!hasFiles(event)) return;
        event.preventDefault();
        [depth, cover.hidden] = [0, true];
        for (const file of event.dataTransfer.files) take(studio, file);
    });
}

function take(studio, file) {
    if (/^image\/(png|jpeg|webp)$/.test(file.type)) studio.usePhoto(file);
    else if (/\.json$/i.test(file.name)) takeJson(studio, file);
    else if (/\.csv$/i.test(file.name) || file.type === "text/csv") learn(studio, file);
    else studio.say("warn", `${file.name} is no CSV, JSON, PNG, JPEG or WebP.`);
}

// A recording of strokes, or a preset.
async function takeJson(studio, file) {
    const read = await file
        .text()
        .then(JSON.parse)
        .catch(() => null);
    if (Array.isArray(read?.moves)) studio.loadRecording(read);
    else studio.loadPreset(file);
}

async function learn(studio, file, mapping = undefined) {
    studio.showTab("surfaces");
    const text = make("p");
    const progress = make("progress", { max: 1, "aria-label": `Learning ${file.name}` });
    const box = make("div", { class: "surface-message", role: "status" }, text, progress);
    find("surfaces").prepend(box);
    const close = () => {
        for (const { href } of box.querySelectorAll("a[download]")) URL.revokeObjectURL(href);
        box.remove();
    };
    const end = (level, message) => {
        progress.remove();
        box.querySelector("button")?.remove();
        box.classList.toggle("bad", level === "bad");
        text.textContent = message;
        box.append(make("button", { class: "quiet", text: "Close", onclick: close }));
    };
    if (!studio.hello?.can.surfaces)
        return end(
            "bad",
            studio.hello?.from === "network"
                ? "A page that came over the network cannot learn surfaces. Drop the recording on the page of the machine itself."
                : "This engine cannot learn surfaces.",
        );
    if (file.size > MOST_BYTES)
        return end(
            "bad",
            `${file.name} has ${(file.size / 2 ** 20).toFixed(0)} MiB; at most 64 MiB are supported. Cut the recording, or use \`haptograph learn\`.`,
        );
    text.textContent = `Reading ${file.name}…`;
    const csv = await file.text();
    const { headOf, keptMapping, mappingForm } = await import("./mapping.js");
    const head = headOf(csv);
    mapping ??= head && (keptMapping(head.names) ?? undefined);
    const [answer, request] = studio.connection.numbered({ type: "learn", name: file.name, csv, mapping });
    let isCancelled = false;
    const cancel = make("button", { text: "Cancel", onclick: () => ((isCancelled = true), studio.connection.send({ type: "cancel", request })) });
    text.after(cancel);
    const timer = setInterval(() => showProgress(studio, file, text, progress), 150);
    const reply = await answer;
    clearInterval(timer);
    const read = async (chosen) => (await studio.connection.request({ type: "learn", reads: true, name: file.name, csv, mapping: chosen })).read;
    const again = (chosen) => (close(), learn(studio, file, chosen));
    const ask = async () => text.after(await mappingForm(head, read, again, reply.ok && !mapping));
    if (!reply.ok) {
        const asks = head && studio.connection.open && !isCancelled;
        // The page has no flags: it asks what the names of columns do not say.
        if (asks && !mapping && (await read({}))?.error) end("note", `What do the columns of ${file.name} hold?`);
        else end("bad", `${file.name} was not learned: ${reply.error.replace(/ Name the columns: --.*/s, "")}`);
        if (asks) await ask();
        return;
    }
    const parameter = parameterOf(studio.graph);
    const chosen = parameter ? await studio.parameter(parameter.name, quoted(reply.change)) : { ok: false };
    const says = chosen.ok ? "it is on the pad: stroke it" : `its swatch is below${chosen.error ? `: ${chosen.error}` : ""}`;
    end("good", `${file.name} was learned; ${says}.`);
    box.scrollIntoView({ block: "nearest" });
    studio.say("good", `${file.name} was learned; ${says}`);
    const recording = { name: file.name, csv, mapping, path: reply.change };
    text.after(make("button", { text: "Listen", title: "The recording beside the surface, and ABX", onclick: () => import("./listen.js").then(({ listen }) => listen(studio, recording)).catch((error) => studio.say("bad", `The recording cannot be played: ${error.message}`)) }));
    if (head) text.after(make("button", { text: "Columns…", title: "Change what its columns hold, and learn another surface of it", onclick: ({ target }) => (target.remove(), ask()) }));
    if (reply.report) text.after(reportLink(reply.report));
    if (reply.learned) text.after(...keepLinks(reply.learned, bare(reply.change).split("/").at(-1)));
}

// A page has no folder: a learned surface is kept by downloading it.
function keepLinks({ surface, report }, file) {
    const link = (label, download, type, content) =>
        make("a", { class: "report", href: URL.createObjectURL(new Blob([content], { type })), download, text: label });
    return [
        link("Save the surface", file, "text/plain", surface),
        link("Save the report", file.replace(/\.ron$/, "-learned.html"), "text/html", report),
    ];
}

// A link to the page in a folder of the studio, which opens a new tab.
export function reportLink(folder) {
    const address = new URL(`report/${encodeURIComponent(folder)}`, location.href);
    address.search = new URLSearchParams({ token: new URLSearchParams(location.search).get("token") ?? "" });
    return make("a", { class: "report", href: address.href, target: "_blank", rel: "noopener", text: "Report" });
}

function showProgress(studio, file, text, progress) {
    const left = studio.connection.unsent;
    if (left > 0 && file.size > 0) {
        progress.value = Math.max(0, 1 - left / file.size);
        setText(text, `Sending ${file.name}…`);
    } else {
        progress.removeAttribute("value");
        setText(text, `Learning ${file.name}…`);
    }
}
