// The participant's page of a study: one thing at a time. It knows what the engine tells it, and that has no name, order or setting of
// a surface or version.
import { Connection } from "./connection.js";
import { find, make, setText, takesText } from "./dom.js";
import { Emitter } from "./events.js";
import { Masking } from "./masking.js";
import { Sound } from "./sound.js";
import { mountStudyPad } from "./study-pad.js";

// What the player of sound reads of a studio.
class Participant extends Emitter {
    constructor() {
        super();
        this.connection = new Connection();
        this.hello = this.graph = this.view = null;
        this.answer = {}; // what is marked so far
    }

    // True while something is felt.
    get runs() {
        return this.connection.open && this.view?.state === "trial" && !this.view.begins && Boolean(this.view.pad);
    }

    say(message) {
        this.connection.send({ type: "study", ...message });
    }
}

const participant = new Participant();
const { connection } = participant;
const masking = new Masking();
const sound = new Sound(participant);
const pad = mountStudyPad(connection, () => participant.runs);

connection.on("hello", (hello) => (participant.hello = hello));
connection.on("participant", (view) => show(view));
connection.on("refused", () => setText(find("problem"), participant.view?.texts?.problem ?? ""));
connection.on("lost", ({ reason }) => {
    show({ ...participant.view, state: "wait" });
    // Whoever was never told anything is not in a session.
    if (!participant.hello) setText(find("problem"), reason ?? "");
});

const LEAST_MS = 400; // a second press of a button is no answer to what comes next
let asked_ms = -Infinity;

const PLACES = [0, 1, 2];
// What two stimuli are called, or A, B and X.
const names = ({ turns, texts = {} }) => (turns?.felt.length === 3 ? [texts.a, texts.b, texts.x] : [texts.first, texts.second]);

// What makes an answer anew, and not only its surroundings.
const asked = (view) => JSON.stringify([view?.state, view?.trial, view?.input]);
const pending = (view) => view.state === "trial" && view.begins;

function show(view) {
    const before = participant.view;
    participant.view = view;
    const isNew = asked(before) !== asked(view);
    const { texts = {}, turns, input } = view;
    setText(find("stop"), texts.stop ?? "");
    setText(find("feedback"), view.feedback ?? (view.training ? texts.training : ""));
    setText(find("feel"), texts.feel ?? "");
    setText(find("instruction"), view.state === "consent" ? texts.consent : input?.ask ? view.text || (turns ? texts.compare : "") : "");
    document.documentElement.lang = texts.language ?? "";
    const { welcome, wait, start, stopped, thanks } = texts;
    const says = { consent: welcome, trial: input?.ask || view.text, start, stopped, done: thanks };
    setText(find("ask"), says[view.state] ?? wait ?? "");
    find("progress").value = view.state === "done" ? 1 : view.of ? (view.trial - 1) / view.of : find("progress").value;
    find("turns").hidden = !turns;
    for (const place of PLACES) {
        const button = find(`turn-${place}`);
        button.hidden = place >= names(view).length;
        setText(button, names(view)[place] ?? "");
        button.setAttribute("aria-pressed", String(turns?.now === place));
        button.dataset.felt = String(Boolean(turns?.felt[place]));
    }
    find("pad").hidden = find("pad-tools").hidden = !view.pad;
    find("pad").setAttribute("aria-label", texts.pad ?? "");
    pad.label(texts.force ?? "");
    if (view.pads) pad.setPads(view.pads);
    find("lamp").hidden = view.lamp === null || view.lamp === undefined;
    find("lamp").dataset.on = String(view.lamp === true);
    showConditions(view.conditions ?? []);
    if (isNew) ask(view);
    showSound(view);
    if (!participant.runs) pad.hands.liftAll();
    if (pending(before ?? {}) !== pending(view) || before?.state !== view.state) {
        if (participant.runs) participant.emit("graph", participant.graph);
        else sound.cut();
    }
    enable();
}

function showSound({ sound_hz, texts = {}, masking: colour }) {
    participant.graph = { sound: sound_hz ? { rate_hz: sound_hz } : null };
    find("noise-label").hidden = !colour;
    setText(find("noise-text"), texts.noise ?? "");
}

// Each condition is a circle that fills, and turns green.
function showConditions(conditions) {
    find("conditions").hidden = conditions.length === 0;
    const items = [...find("conditions").children];
    if (items.length !== conditions.length) {
        items.splice(0, items.length, ...conditions.map(() => make("li")));
        find("conditions").replaceChildren(...items);
    }
    conditions.forEach(({ name, part }, i) => {
        setText(items[i], name);
        items[i].style.setProperty("--part", String(part));
        items[i].dataset.done = String(part >= 1);
    });
}

// Lays out what is asked for.
function ask({ state, texts = {}, input }) {
    participant.answer = {};
    asked_ms = performance.now();
    setTimeout(enable, LEAST_MS);
    setText(find("problem"), "");
    const kinds = { line, which, choice, number, words };
    const made = state === "consent" ? [agreement(texts)] : state === "trial" ? (kinds[input?.kind]?.(input, texts) ?? []) : [];
    find("answer").replaceChildren(...made);
    const goes = ["consent", "trial", "start"].includes(state) && input?.kind !== "record"; // which ends by itself
    find("next").hidden = !goes;
    setText(find("next"), texts.next ?? "");
}

const set = (answer) => {
    Object.assign(participant.answer, answer);
    enable();
};

function agreement(texts) {
    const box = make("input", { type: "checkbox", onchange: ({ target }) => set({ agrees: target.checked }) });
    return make("label", { class: "agree" }, box, texts.agree);
}

// The line of the thesis: without a mark until it is clicked, and to be changed until Next.
function line({ ask, from, to }) {
    const mark = make("i", { hidden: true });
    const bar = make("div", { class: "line", role: "slider", tabindex: "0", "aria-label": ask, "aria-valuemin": "0", "aria-valuemax": "1" }, mark);
    bar.setAttribute("aria-valuetext", "–");
    const put = (rating) => {
        if (!mayAnswer()) return;
        const within = Math.max(0, Math.min(1, rating));
        mark.hidden = false;
        mark.style.left = `${100 * within}%`;
        bar.setAttribute("aria-valuenow", within.toFixed(3));
        bar.setAttribute("aria-valuetext", `${Math.round(100 * within)} %`);
        set({ rating: within });
    };
    const follow = (event) => {
        const { left, width } = bar.getBoundingClientRect();
        put((event.clientX - left) / width);
    };
    bar.addEventListener("pointerdown", (event) => {
        event.preventDefault();
        bar.focus({ preventScroll: true });
        bar.setPointerCapture(event.pointerId);
        follow(event);
    });
    bar.addEventListener("pointermove", (event) => bar.hasPointerCapture(event.pointerId) && follow(event));
    bar.addEventListener("keydown", (event) => {
        const steps = { ArrowLeft: -0.01, ArrowDown: -0.01, ArrowRight: 0.01, ArrowUp: 0.01, PageDown: -0.1, PageUp: 0.1 };
        const ends = { Home: 0, End: 1 };
        if (!(event.key in steps) && !(event.key in ends)) return;
        event.preventDefault();
        const now = participant.answer.rating;
        put(ends[event.key] ?? (now === undefined ? 0.5 : now + steps[event.key]));
    });
    return [bar, make("div", { class: "ends" }, make("span", { text: from }), make("span", { text: to }))];
}

function buttons(names, label = null) {
    const made = names.map((text, choice) =>
        make("button", {
            text,
            "aria-pressed": "false",
            onclick: () => {
                if (!mayAnswer()) return;
                for (const button of made) button.setAttribute("aria-pressed", String(button === made[choice]));
                set({ choice });
            },
        }),
    );
    return [make("div", { class: "choices", role: "group" }, label && make("span", { class: "soft", text: label }), ...made)];
}

const which = (_, texts) => buttons(names(participant.view).slice(0, 2), texts.answer);
const choice = ({ of }) => buttons(of);

function number({ ask, from, to }) {
    const value = ({ target }) => set({ rating: target.value === "" ? undefined : Number(target.value) });
    return [make("input", { type: "number", min: String(from), max: String(to), step: "any", "aria-label": ask, oninput: value })];
}

function words({ ask, optional }) {
    participant.answer.text = optional ? "" : undefined;
    return [make("textarea", { "aria-label": ask, maxlength: "2000", oninput: ({ target }) => set({ text: target.value }) })];
}

const mayAnswer = () => participant.view?.state === "trial" && participant.view.open;

// True if the answer is complete.
function isComplete({ state, input }) {
    const { agrees, rating, choice, text } = participant.answer;
    if (state === "consent") return agrees === true;
    if (state === "start") return true;
    if (!mayAnswer()) return false;
    switch (input?.kind) {
        case "line":
            return rating !== undefined;
        case "number":
            return rating !== undefined && rating >= input.from && rating <= input.to;
        case "which":
        case "choice":
            return choice !== undefined;
        case "words":
            return input.optional || Boolean(text?.trim());
        default:
            return true;
    }
}

function enable() {
    const { view } = participant;
    if (!view) return;
    find("next").disabled = !connection.open || !isComplete(view) || performance.now() - asked_ms < LEAST_MS;
    for (const bar of find("answer").querySelectorAll(".line")) bar.setAttribute("aria-disabled", String(!mayAnswer()));
    for (const button of find("answer").querySelectorAll("button")) button.disabled = !mayAnswer();
}

function next() {
    const { view, answer } = participant;
    if (find("next").hidden || find("next").disabled) return;
    find("next").disabled = true; // a second press is of the next trial
    if (view.state === "consent") return participant.say({ say: "agree" });
    if (view.state === "start") return participant.say({ say: "start", trial: view.trial });
    const { rating = null, choice = null, text = null } = answer;
    participant.say({ say: "answer", trial: view.trial, rating, choice, text });
}

function stop() {
    connection.send({ type: "stop" });
    sound.cut();
    pad.hands.liftAll();
}

// Browsers begin to play after a press only.
function beginSound() {
    if (participant.view?.sound_hz && !sound.on) sound.toggle();
    masking.begin(participant.view?.masking);
}

find("next").addEventListener("click", next);
find("stop").addEventListener("click", stop);
find("noise").addEventListener("input", ({ target }) => masking.set(Number(target.value)));
for (const place of PLACES) find(`turn-${place}`).addEventListener("click", () => participant.say({ say: "feel", place }));
for (const type of ["pointerup", "keydown"]) window.addEventListener(type, beginSound);
window.addEventListener("keydown", (event) => {
    if (event.key === "Escape") return event.repeat || stop();
    if (takesText(event.target) || event.repeat) return;
    if (event.key === "Enter" && event.target.tagName !== "BUTTON") next();
    const place = Number(event.key) - 1;
    if (participant.view?.turns?.felt[place] !== undefined) participant.say({ say: "feel", place });
});
connection.connect();
window.participant = participant; // for tests
