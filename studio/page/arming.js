// Real actuators: they get zeros until they are armed here, and stay armed only while this page is visible and is the
// owner.
import { find, setText } from "./dom.js";

const HOLD_MS = 50;
const MOST_APART_MS = 1000;
const FIRST_DB = -20;
const HEARD_MS = 500; // a status that is older does not tell what moves now

const gainOf = (db) => 10 ** (db / 20);
const decibels = (gain) => `${(20 * Math.log10(gain)).toFixed(0).replace("-", "−")} dB`;
const isArmed = (studio) => studio.connection.open && studio.status?.armed_gain > 0;

export function mountArming(studio) {
    const send = (message) => studio.connection.send(message);
    const level = find("arm-level");
    find("arm").addEventListener("click", () => send({ type: isArmed(studio) ? "disarm" : "arm" }));
    level.addEventListener("input", () => isArmed(studio) && send({ type: "gain", gain: gainOf(Number(level.value)) }));
    const holds = () => studio.hello?.can.arm && studio.status?.owner && drivenOf(studio.graph).length > 0;
    const sees = () => studio.runs && isRecent(studio.heard_ms, performance.now());
    const leave = () => holds() && send({ type: "disarm" });
    document.addEventListener("visibilitychange", () => document.hidden && leave());
    window.addEventListener("pagehide", leave);
    // If this page hangs, the engine disarms the actuators; after a suspend, which stops both, this page does.
    let last_ms = Date.now();
    setInterval(() => {
        const passed_ms = Date.now() - last_ms;
        last_ms += passed_ms;
        if (passed_ms > MOST_APART_MS) leave();
        else if (holds() && sees() && !document.hidden) send({ type: "hold" });
    }, HOLD_MS);
    for (const turn of ["graph", "status"]) studio.on(turn, () => show(studio, level));
}

// True if a status received at `heard_ms` is still current.
export const isRecent = (heard_ms, now_ms) => now_ms - heard_ms < HEARD_MS;

function show(studio, level) {
    const real = drivenOf(studio.graph);
    // The page of a site drives no device.
    const none = !real.length || studio.hello?.host === "page";
    find("real").hidden = none;
    if (none) return;
    const armed = isArmed(studio);
    if (!armed) level.value = String(FIRST_DB);
    const mayArm = mayBeArmed(studio);
    level.disabled = !armed || !mayArm;
    setText(find("arm-level-text"), armed ? decibels(studio.status.armed_gain) : "off");
    find("real").dataset.armed = String(armed);
    find("arm").disabled = !armed && !mayArm;
    setText(find("arm"), armed ? "Disarm" : "Arm");
    setText(find("real-text"), said(studio, real.map(named).join(" and "), armed));
}

// The driven devices that are neither simulated nor in this page, each once.
export function drivenOf(graph) {
    const driven = new Set((graph?.actuators ?? []).map(({ endpoint }) => endpoint));
    return (graph?.devices ?? []).filter(({ name, simulated }) => !simulated && driven.has(name));
}

const named = ({ name, kind, at }) => `${name} (${kind}${at ? `, ${at}` : ""})`;

const mayBeArmed = ({ hello, status }) =>
    Boolean(hello?.can.arm && status?.owner && status.state === "running" && status.replay === null);

function said({ hello, status }, who, armed) {
    if (armed && status.state === "stopping") return `STOP was sent: ${who} falls to zero`;
    if (armed) return `Armed: ${who} moves. STOP, Disarm, or leaving this page takes it to zero`;
    const before = `Not armed: ${who} gets zeros.`;
    if (!hello?.can.arm) return `${before} It is armed on a page of the studio's own machine`;
    if (status?.state !== "running") return `${before} Resume first`;
    if (status.replay !== null) return `${before} A replay is running`;
    if (!status.owner) return `${before} Another page owns it: take over first`;
    return `${before} Keep clear of it, then press Arm: it rises to a tenth of what the graph asks for`;
}
