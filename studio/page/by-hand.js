// What opens in the drawing while a hand changes the graph there: the form of a node, the choice of a wire's ends, and why a change was
// refused, at the place where it was made.
import { find, make } from "./dom.js";
import { prose } from "./prose.js";

const MARGIN_PX = 8;

// Boxes over the drawing; `open` shows one at a place of the window, in the place of the one before.
export function mountBoxes(studio) {
    const host = find("graph-tab");
    let box = null,
        came = null; // where the focus was
    const close = () => {
        const had = box?.contains(document.activeElement);
        box?.remove();
        box = null;
        if (had) (came?.isConnected ? came : find("graph")).focus();
        return had !== undefined;
    };
    const open = (label, [x, y], ...children) => {
        const before = document.activeElement;
        const isWithin = box?.contains(before);
        box?.remove();
        if (!isWithin) came = before;
        box = make("section", { class: "by-hand", role: "dialog", "aria-label": label, tabindex: "-1" }, ...children);
        host.append(box);
        place(host, box, x, y);
        return box;
    };
    host.addEventListener("keydown", (event) => {
        const way = (event.ctrlKey || event.metaKey) && !event.altKey && { z: event.shiftKey ? "Mod-y" : "Mod-z", y: "Mod-y" }[event.key.toLowerCase()];
        if (!way || !studio.edits.may() || event.composedPath()[0].dataset?.isTyped) return;
        event.preventDefault();
        studio.edits.undo(way).then((reply) => reply.ok || studio.say("bad", `The text went back, the graph did not: ${reply.error}`));
    });
    studio.closeByHand = () => close();
    return { open, close, place: (x, y) => box && place(host, box, x, y) };
}

function place(host, box, x, y) {
    const room = host.getBoundingClientRect();
    const within = (value, size, most) => Math.max(MARGIN_PX, Math.min(value, most - size - MARGIN_PX));
    box.style.left = `${within(x - room.left, box.offsetWidth, room.width)}px`;
    box.style.top = `${within(y - room.top, box.offsetHeight, room.height)}px`;
}

// Why a change was refused, whole: every message of the engine with its help, and what can be done here.
export function refusal(reply, ...actions) {
    const errors = (reply.diagnostics ?? []).filter(({ severity }) => severity !== "warning");
    const says = errors.map(({ code, message, help }) => [
        make("p", {}, make("strong", { class: "error", text: `${code} ` }), ...prose(message)),
        ...[help ?? []].flat().map((each) => make("p", { class: "soft" }, ...prose(each))),
    ]);
    const others = [...(errors.length ? [] : [reply.error ?? "The engine refused it."]), ...(reply.beyond ?? [])];
    return make(
        "div",
        { class: "refusal", role: "alert" },
        ...says.flat(),
        ...others.map((text) => make("p", {}, ...prose(text))),
        make("p", { class: "soft", text: reply.isKept ? "The change is in the text, which does not run yet." : "The text is as it was." }),
        ...actions.filter(Boolean),
    );
}

// What is said of a change that stays but does not run: the text has others.
export const pendingNote = (studio) =>
    make(
        "p",
        { class: "soft" },
        "The change is in the text, beside others that are not applied. ",
        make("button", { text: "Apply all", onclick: () => studio.edits.apply() }),
    );

// A button that goes to a place of the text.
export const jumpButton = (studio, label, { from, to }) =>
    make("button", { class: "quiet", text: label, onclick: () => studio.edits.jump(from, Math.min(to, studio.edits.text().length)) });
