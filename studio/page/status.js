// The status line: the most urgent problem with its remedy, and the figures beside it.
import { find, setText } from "./dom.js";
import { frameRate } from "./frame.js";

const SAID_MS = 7000;
const LETTER_MS = 60; // of a longer message
const LATE_MS = 8;
const SILENT_S = 0.5;
const HOT = 0.85;
const RECENT_MS = 8000;
const UNHEARD_S = 2;
const HEARD = 1e-4; // of full scale
const SILENT_MS = 3000;
const UNCONFIRMED_MS = 1000; // after which an engine that has not confirmed STOP is worth a word

export function mountStatus(studio) {
    const state = { said: null, action: null, counts: { lost: 0, faults: 0, xruns: 0, underruns: 0 }, since: {} };
    studio.say = (level, text) => {
        const read_ms = Math.max(SAID_MS, text.length * LETTER_MS);
        state.said = { level, text, until_ms: performance.now() + read_ms };
        show(studio, state);
    };
    find("status-action").addEventListener("click", () => state.action?.());
    find("owner").addEventListener("click", () => studio.own());
    setInterval(() => show(studio, state), 250);
    studio.on("status", () => {
        watchCounts(studio, state);
        show(studio, state);
    });
    studio.on("graph", () => show(studio, state));
}

// Counts that grew recently are reported; older ones are in the figures.
function watchCounts(studio, { counts, since }) {
    const { lost, faults, xruns } = studio.status;
    const now = { lost, faults, xruns: xruns ?? 0, underruns: studio.sound.report?.underruns ?? 0 };
    for (const [name, count] of Object.entries(now)) {
        if (count > counts[name]) since[name] = performance.now();
        counts[name] = count;
    }
}

// When a sound was last heard, or there was no reason for one: a hand that presses and rests is silent.
let heard_ms = 0;

function show(studio, state) {
    const { demo } = studio.pad;
    const isMoved = studio.runs && demo.running && demo.gesture !== "press" && studio.sound.on;
    if (!isMoved || !(studio.sound.report?.peak === 0)) heard_ms = performance.now();
    const { level, text, label, action } = pick(studio, state);
    const line = find("status-text");
    line.dataset.level = level;
    setText(line, text);
    line.title = text;
    const button = find("status-action");
    button.hidden = !action;
    if (action) setText(button, label);
    state.action = action ?? null;
    showBadge(studio);
    showLatency(studio);
    setText(find("status-figures"), figures(studio, state));
}

// The most urgent message.
function pick(studio, state) {
    const recent = (name) => performance.now() - (state.since[name] ?? -Infinity) < RECENT_MS;
    for (const find of [connectionSays, stateSays]) {
        const said = find(studio);
        if (said) return said;
    }
    if (state.said && performance.now() < state.said.until_ms) return state.said;
    return (
        ownerSays(studio) ??
        engineSays(studio, state.counts, recent) ??
        soundSays(studio, state.counts, recent) ??
        handSays(studio)
    );
}

function connectionSays(studio) {
    const { engine } = studio.connection;
    if (studio.connection.open && engine?.waits)
        return {
            level: "note",
            text: "The engine runs in this page, once you start it",
            label: "Start",
            action: () => engine.start(),
        };
    if (studio.connection.open && studio.status) return silenceSays(studio);
    if (!studio.lost) return { level: "warn", text: "Connecting to the engine" };
    if (studio.lost.wait_s === null) return { level: "bad", text: engine ? "No engine can run at this address" : studio.lost.reason };
    if (studio.connection.stopping) return { level: "bad", text: "Not connected: STOP is sent as soon as the engine answers" };
    if (engine) return { level: "warn", text: "The engine in this page ended" };
    return { level: "warn", text: "Not connected: the engine has taken its actuators to zero by itself" };
}

// An engine that is connected but sends nothing: the page does not show its state.
function silenceSays({ heard_ms, connection }) {
    const silent_s = (performance.now() - heard_ms) / 1000;
    if (silent_s < UNHEARD_S) return null;
    const end = connection.engine ? "Reload the page" : "Use its terminal";
    return { level: "bad", text: `The engine has sent nothing for ${silent_s.toFixed(0)} s, so its state is not known. ${end}` };
}

// The effect of a STOP, and the way to end it; null without a STOP.
export function stopSays(studio) {
    const { state, owner } = studio.status ?? {};
    if (state !== "stopped" && state !== "stopping") return null;
    const end = studio.connection.engine ? "close this page" : "end haptograph in its terminal";
    const late = performance.now() - studio.stop_ms > UNCONFIRMED_MS;
    const text =
        state === "stopped"
            ? "Stopped: every actuator is at zero"
            : late
              ? `Stopping: the engine has not confirmed STOP. If it does not, ${end}`
              : "Stopping";
    if (!studio.mayResume)
        return {
            level: "bad",
            text: `${text}. This page came over the network and cannot resume: resume on the studio's own machine`,
        };
    return { level: "bad", text, label: owner ? "Resume" : "Take over and resume", action: () => studio.resume() };
}

function stateSays(studio) {
    const { state } = studio.status;
    const stop = stopSays(studio);
    if (stop) return stop;
    if (state === "failed")
        return {
            level: "bad",
            text: "The engine failed: its actuators are at zero. The terminal shows the reason; start it again there",
        };
    return null;
}

function ownerSays(studio) {
    if (studio.status.owner) return null;
    return { level: "warn", text: "Another page owns the pad and the settings", label: "Take over", action: () => studio.own() };
}

function engineSays(studio, counts, recent) {
    const { behind_ms, cost, silent, note } = studio.status;
    const actuators = studio.blind ? [] : studio.status.actuators; // how warm a coil is tells a surface
    if (recent("faults"))
        return {
            level: "bad",
            text: `The command of an actuator was NaN or infinite in ${counts.faults} ticks: it got zero. Undo the last edit`,
        };
    if (behind_ms > LATE_MS) {
        const why =
            cost > 0.8
                ? `the graph needs ${(100 * cost).toFixed(0)} % of the processor: make it cheaper`
                : "another program takes the processor: close some";
        return { level: "warn", text: `The engine is ${behind_ms.toFixed(0)} ms late: ${why}` };
    }
    const mute = silent.find(({ for_s }) => for_s > SILENT_S);
    if (mute && studio.pad.hands.down.length)
        return {
            level: "warn",
            text: `\`${mute.input}\` has been silent for ${mute.for_s.toFixed(0)} s: its actuators are at zero. Lift and press again`,
        };
    const hot = actuators.find(({ heat, simulated, armed }) => heat > HOT && (simulated || armed));
    if (hot)
        return {
            level: "warn",
            text: `\`${hot.name}\` uses ${(100 * hot.heat).toFixed(0)} % of its continuous limit: turn its gain down or pause`,
        };
    if (recent("xruns"))
        return {
            level: "warn",
            text: `The soundcard had ${counted(counts.xruns, "xrun")}: close other programs, or give its endpoint a larger \`buffer_frames\``,
        };
    if (note) return { level: "warn", text: note };
    if (recent("lost"))
        return { level: "warn", text: `The page reads too slowly: ${counts.lost} messages were dropped. Remove a scope` };
    return null;
}

function soundSays(studio, counts, recent) {
    const { sound } = studio;
    if (sound.obstacle) return { level: "note", text: sound.obstacle };
    if (!sound.on)
        return { level: "note", text: "No sound yet: press Sound", label: "Turn sound on", action: () => sound.toggle() };
    // Where nobody strokes there is nothing to hear.
    if (recent("underruns") && studio.pad.hands.down.length)
        return {
            level: "warn",
            text: `The sound had ${counted(counts.underruns, "gap")}: the page buffers ${(1000 * (sound.report?.target_s ?? 0)).toFixed(0)} ms now`,
        };
    return null;
}

function handSays(studio) {
    const down = studio.pad.hands.down;
    if (down.some(({ by }) => by === "replay")) return { level: "note", text: "The recorded hand strokes" };
    if (performance.now() - heard_ms > SILENT_MS)
        return { level: "warn", text: "Silent though a simulated hand strokes: wires of the drawing are thin behind the node that gives nothing" };
    if (studio.pad.demo.running)
        return { level: "good", text: "A simulated hand strokes; touch the pad to take over" };
    if (down.length)
        return { level: "good", text: studio.sound.on ? `You hear ${studio.graph?.sound?.what ?? "the actuator"}` : "Stroking" };
    if (studio.sound.report?.peak > HEARD) return { level: "good", text: `You hear ${studio.graph?.sound?.what ?? "the actuator"}` };
    if (!studio.graph?.pads.length) return { level: "good", text: "Ready" };
    const text = studio.sound.on ? "Silent, as no hand strokes: stroke the pad" : "Ready: stroke the pad";
    return { level: "good", text, label: "Let it stroke", action: () => studio.pad.demo.start() };
}

const counted = (count, what) => `${count} ${what}${count === 1 ? "" : "s"}`;

function showBadge(studio) {
    const state = !studio.connection.open ? (studio.lost ? "lost" : "connecting") : (studio.status?.state ?? "connecting");
    find("state").dataset.state = state;
    setText(find("state"), state === "lost" ? "no engine" : state);
    showMoves(studio);
    showDrivers(studio);
    const owner = find("owner");
    owner.disabled = studio.status?.owner !== false;
    setText(owner, !studio.status ? "" : studio.status.owner ? "the pad is yours" : "Take over");
}

// Shows whether a real device can move, from the engine's list of devices.
function showMoves(studio) {
    const real = studio.graph?.devices?.filter(({ simulated }) => !simulated);
    const badge = find("moves");
    badge.style.visibility = real ? "visible" : "hidden";
    if (!real) return;
    badge.dataset.state = real.length ? "stopped" : "";
    setText(find("moves-what"), real.length ? "real" : "simulated");
    setText(find("moves-more"), real.length ? `: ${real.map(({ name }) => name).join(", ")}` : ": nothing real moves");
}

// Whose time runs a graph of several drivers.
function showDrivers({ graph }) {
    const drivers = graph?.drivers ?? [];
    const names = drivers.map(({ name }) => name).join(" and ");
    const isOne = drivers.every(({ simulated }) => simulated);
    const says = isOne ? `${names} run on one clock, their rings are simulated` : `${names} run by their own clocks`;
    find("drivers").hidden = drivers.length < 2;
    setText(find("drivers"), drivers.length < 2 ? "" : says);
    find("drivers").title = isOne ? "No device is real: the crystals of both sides do not drift here" : "";
}

// Latency from the pointer to the ear, or to the engine without sound.
function showLatency(studio) {
    const pointer = studio.status?.pointer;
    const element = find("latency");
    if (!pointer?.count) return setText(element, "");
    const sound_s = studio.sound.latency_s;
    setText(
        element,
        sound_s === null
            ? `${pointer.p50_ms.toFixed(1)} ms to engine`
            : `${(pointer.p50_ms + 1000 * sound_s).toFixed(0)} ms to ear`,
    );
    element.title =
        `Pointer to engine: median ${pointer.p50_ms.toFixed(1)} ms, largest ${pointer.max_ms.toFixed(1)} ms.` +
        (sound_s === null
            ? ""
            : ` Sound: buffer ${(1000 * studio.sound.report.fill_s).toFixed(0)} ms and ${(1000 * (sound_s - studio.sound.report.fill_s)).toFixed(0)} ms in the browser and the card. The network is not included.`);
}

function figures(studio, { counts }) {
    const { status } = studio;
    if (!status) return "";
    const parts = [
        `${status.time_s.toFixed(1)} s`,
        ...(studio.blind ? [] : [`processor ${(100 * status.cost).toFixed(0)} %`]),
        `${status.late} late`,
        `${status.lost} lost`,
    ];
    if (status.xruns !== null) parts.push(counted(status.xruns, "xrun"));
    if (status.faults) parts.push(`${status.faults} NaN`);
    if (studio.sound.on) parts.push(counted(counts.underruns, "gap"));
    if (Number.isFinite(studio.sound.report?.edit_ms)) parts.push(`edit ${studio.sound.report.edit_ms} ms`);
    if (status.pages > 1) parts.push(`${status.pages} pages`);
    return [...parts, `${frameRate()} fps`].join("   ");
}
