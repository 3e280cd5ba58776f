// The studio: the latest messages of the engine, the requests that the page may send, and its panels.
import { mountArming } from "./arming.js";
import { Assignments } from "./assign.js";
import { cards, galleryAddress, studioOf } from "./cards.js";
import { Motion } from "./choices.js";
import { mountCompare } from "./compare.js";
import { Connection } from "./connection.js";
import { mountControls } from "./controls.js";
import { find, make, setText, takesText } from "./dom.js";
import { Emitter } from "./events.js";
import { mountGraph } from "./graph.js";
import { mountPadInputs } from "./inputs.js";
import { mountPad } from "./pad.js";
import { unmoved } from "./pads.js";
import { mountRecorder } from "./recorder.js";
import { mountScopes } from "./scopes.js";
import { Sound } from "./sound.js";
import { mountStatus, stopSays } from "./status.js";
import { currentSurface, mountSurfaces } from "./surfaces.js";
import { mountTabs } from "./tabs.js";
import { Taps } from "./taps.js";
import { mountViews } from "./views.js";

const VERSION = 1;

// Emits `hello`, `graph`, `status` when the engine sends them, `value` ({ name, value }) when a setting changes, and `moved`
// whenever `motion` has taken the levels.
class Studio extends Emitter {
    constructor() {
        super();
        this.connection = new Connection();
        this.taps = new Taps(this.connection);
        this.motion = new Motion();
        this.values = new Map();
        this.hello = this.graph = this.status = null;
        this.photos = new Map(); // by surface
        this.lost = null; // how the connection was lost, while it is
        this.heard_ms = -Infinity; // when the last status came
        this.stop_ms = -Infinity; // when STOP was pressed
        const { connection } = this;
        connection.on("hello", (hello) => this.#greet(hello));
        connection.on("graph", (graph) => this.#take(graph));
        connection.on("status", (status) => {
            this.heard_ms = performance.now();
            this.#follow(status);
        });
        connection.on("levels", (levels) => {
            this.motion.take(levels);
            this.emit("moved");
        });
        connection.on("settings", ({ settings }) => settings.forEach(({ name, value }) => this.#changed(name, value)));
        connection.on("refused", ({ error }) => this.say("bad", `The engine refused a message: ${error}`));
        connection.on("lost", (how) => this.#lose(how));
        for (const turn of ["open", "waiting"]) connection.on(turn, () => cover(this));
    }

    currentSurface() {
        return currentSurface(this.graph);
    }

    // True if the engine runs according to its latest status, and no STOP waits for confirmation.
    get runs() {
        return this.connection.open && this.status?.state === "running";
    }

    // True if this page may put a hand on the pad now.
    mayTouch() {
        return this.runs && this.status.owner;
    }

    // Only a page of the studio's own machine ends a STOP.
    get mayResume() {
        return this.hello?.from !== "network";
    }

    set(name, value) {
        this.connection.send({ type: "set", name, value });
        this.#changed(name, value);
    }

    // The reply's `error` is the first problem.
    async parameter(name, value) {
        const reply = await this.connection.request({ type: "parameter", name, value });
        const first = reply.diagnostics?.[0]?.message;
        return reply.ok || !first ? reply : { ...reply, error: first };
    }

    stop() {
        this.connection.send({ type: "stop" });
        this.stop_ms = performance.now();
        this.sound.cut();
        this.silence();
        this.pad.hands.liftAll();
        if (this.status) this.#follow(this.status);
        if (this.lost) this.#sayLost();
    }

    // Only the owner ends a STOP, so this page takes over first. The sound follows when the engine runs.
    resume() {
        if (!this.status?.owner) this.own();
        this.connection.send({ type: "resume" });
    }

    own() {
        this.connection.send({ type: "own" });
    }

    #greet(hello) {
        const ports = hello.kinds.flatMap(({ inputs, outputs }) => [...inputs, ...outputs]);
        for (const item of [...ports, ...(hello.quantities ?? [])]) item.unit = printed(item.unit);
        this.hello = hello;
        this.lost = null;
        find("banner").hidden = hello.version === VERSION;
        if (hello.version !== VERSION)
            setText(
                find("banner"),
                `The engine speaks version ${hello.version} of the protocol, this page version ${VERSION}: reload the page.`,
            );
        this.connection.send({ type: "levels", on: true });
        this.emit("hello", hello);
    }

    #take(graph) {
        graph.unreadable = graph.surfaces.filter(({ error }) => error);
        graph.surfaces = graph.surfaces.filter(({ error }) => !error);
        const ports = [graph.ports, graph.levels, graph.contacts, ...graph.plots.map(({ signals }) => signals)].flat();
        for (const port of ports) port.unit = printed(port.unit);
        if (graph.name !== this.graph?.name) this.motion.restart();
        this.graph = graph;
        this.values = new Map(graph.settings.map(({ name, value }) => [name, value]));
        setText(find("name"), graph.name);
        setText(find("about"), graph.about ?? "");
        find("about").title = graph.about ?? "";
        document.title = `${graph.name} – haptograph studio`;
        this.emit("graph", graph);
        for (const [name, value] of this.values) this.emit("value", { name, value });
    }

    // After STOP the engine's state is "stopping", whatever older statuses say, until its status is "stopped".
    #follow(received) {
        const before = this.status;
        const stops = received.state === "running" && this.connection.stopping;
        const status = stops ? { ...received, state: "stopping" } : received;
        this.status = status;
        if (before?.state !== status.state) {
            if (this.runs) this.sound.resume();
            else {
                this.sound.cut();
                this.pad.hands.liftAll();
            }
        }
        if (before?.owner && !status.owner) this.pad.hands.liftAll();
        this.emit("status", status);
        cover(this);
    }

    #changed(name, value) {
        if (!this.values.has(name)) return;
        this.values.set(name, value);
        this.emit("value", { name, value });
    }

    #lose(how) {
        this.lost = how;
        this.status = null;
        this.pad.hands.liftAll();
        this.#sayLost();
        cover(this);
    }

    #sayLost() {
        const { wait_s, ever, reason, isAnother } = this.lost;
        const stop = this.connection.stopping ? " STOP is sent as soon as it answers." : "";
        const again = ` Trying again in ${wait_s < 1 ? "a moment" : `${Math.round(wait_s)} s`}.`;
        const why = this.connection.engine
            ? `The engine in this page ended (${reason}).`
            : ever
              ? "The connection to the engine is lost. It takes its actuators to zero by itself. If it was started anew, open the link that it printed."
              : "No engine answers here. Is haptograph still running? Open the address that it printed, with its token.";
        const banner = find("banner");
        banner.hidden = false;
        if (isAnother) banner.replaceChildren(make("span", { text: reason }), linkField());
        else setText(banner, wait_s === null ? reason : why + stop + again);
    }
}

// Takes the link that another haptograph printed, or its token, and opens its page here.
function linkField() {
    const field = make("input", { type: "text", spellcheck: "false", autocomplete: "off", "aria-label": "Link or token", placeholder: "Link or token" });
    const open = () => {
        const token = field.value.match(/(?:^|token=)([0-9a-f]{32})$/)?.[1];
        if (token) location.search = new URLSearchParams({ token });
        field.setAttribute("aria-invalid", String(!token));
    };
    field.addEventListener("keydown", (event) => event.key === "Enter" && open());
    return make("span", { class: "link-field" }, field, make("button", { text: "Open", onclick: open }));
}

// The text over the pad while it cannot be touched, with its button.
function coverSays(studio) {
    const { status } = studio;
    const { engine, open } = studio.connection;
    if (!open) return null;
    if (engine?.waits)
        return ["The engine runs in this page. Browsers start it only when you press the button.", "Start", () => engine.start()];
    const stop = stopSays(studio);
    if (stop) return [`${stop.text}.`, stop.label, stop.action];
    if (status && !status.owner) return ["Another page owns the pad.", "Take over", () => studio.own()];
    if (studio.graph?.pads.length !== 0) return null;
    return [["This graph reads nothing that a hand could move.", ...unmoved(studio.graph)].join(" ")];
}

function cover(studio) {
    const says = coverSays(studio);
    find("pad-cover").hidden = !says;
    if (!says) return;
    setText(find("pad-cover-text"), says[0]);
    find("pad-cover-button").hidden = !says[1];
    setText(find("pad-cover-button"), says[1] ?? "");
    find("pad-cover-button").onclick = says[2];
}

// Closes what is open over the page; false if there is nothing.
function closeOpen(studio) {
    if (studio.assignments.endLearning() || studio.closeByHand()) return true;
    const help = document.querySelector(":popover-open");
    const isOpen = help !== null || !find("node").hidden;
    help?.hidePopover();
    if (!help && isOpen) studio.showNode(null);
    return isOpen;
}

// Escape, where nothing is open, and full stop are STOP, unless a text field or the element with the focus handles the key.
function mountStop(studio) {
    find("stop").addEventListener("click", () => studio.stop());
    window.addEventListener("keydown", (event) => {
        if (event.defaultPrevented || event.isComposing) return;
        if (event.key === "Escape" ? !closeOpen(studio) : event.key === "." && !takesText(event.target)) studio.stop();
    });
}

// A site, or a studio that was opened without a graph, has several; each has its own address.
async function mountGraphChoice(studio) {
    const listed = await cards().catch(() => ({ cards: [] }));
    const graphs = listed.cards;
    if (graphs.length < 2) return;
    const choice = find("graph-choice");
    const options = graphs.map(({ name, about }) => make("option", { value: name, text: name, title: about }));
    choice.replaceChildren(...options, make("hr"), make("option", { value: "", text: "All graphs…" }));
    const show = ({ name }) => (choice.value = name);
    if (studio.graph) show(studio.graph);
    studio.on("graph", show);
    find("home").href = galleryAddress();
    find("home").title = "All graphs";
    find("name").hidden = true;
    choice.hidden = false;
    choice.addEventListener("change", () => (location.href = choice.value ? studioOf(choice.value) : galleryAddress()));
}

// The editor is large. In a site it is loaded when it is shown, when a hand comes to the drawing, which it changes, or when another
// program changes the file; a server is near.
function mountEditorLater(studio) {
    let loaded = null;
    studio.edits = { may: () => false };
    for (const comes of ["pointerenter", "focusin"]) find("graph").addEventListener(comes, () => studio.loadEditor(), { once: true });
    studio.loadEditor = () => (loaded ??= import("./editor.js").then(({ mountEditor }) => mountEditor(studio)));
    studio.on("tab", (name) => {
        if (name === "editor") studio.loadEditor();
        if (name === "surfaces" || name === "controls") studio.connection.loadSurfaces();
    });
    studio.connection.on("disk", async (message) => {
        if (studio.editor) return;
        await studio.loadEditor();
        studio.connection.emit("disk", message);
    });
    if (!studio.connection.engine) studio.loadEditor();
}

// A unit as it is printed: "m/s2" as m/s², empty for a plain number.
const printed = (unit) =>
    unit === "1"
        ? ""
        : (unit ?? "").replace(/(?<=[a-z])-?\d/g, (power) =>
              [...power].map((digit) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(digit)]).join(""),
          );

const studio = new Studio();
document.documentElement.classList.toggle("embedded", new URLSearchParams(location.search).has("embed"));
studio.showTab = studio.say = studio.silence = () => {}; // `silence` ends what is listened to
mountTabs(studio);
studio.sound = new Sound(studio);
studio.pad = mountPad(studio);
studio.assignments = new Assignments(studio);
mountPadInputs(studio);
mountScopes(studio);
mountViews(studio);
mountGraph(studio);
mountControls(studio);
mountEditorLater(studio);
mountSurfaces(studio);
mountCompare(studio);
mountRecorder(studio);
mountArming(studio);
mountStatus(studio);
mountStop(studio);
mountGraphChoice(studio);
window.addEventListener("error", ({ error, message }) => {
    if (error) studio.say("bad", `A part of this page failed (${message}). Reload the page`);
});
studio.connection.connect();
window.studio = studio; // for those who try things in the browser's console, and for tests
