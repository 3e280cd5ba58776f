// The experimenter's page of a study: who takes part, what is to be done now, and what an experimenter may do about it.
import { Connection } from "./connection.js";
import { find, make, save, setText, takesText } from "./dom.js";
import { zip } from "./zip.js";
import { letIn } from "./study-windows.js";

const HOLD_MS = 50;
const MOST_APART_MS = 1000;
const connection = new Connection();
const { engine } = connection; // in an exported site
let view = null;
let certain = null; // the button that was pressed once and asks for a second press

function say(message) {
    setText(find("problem"), "");
    connection.send({ type: "study", ...message });
}

// Browsers let an engine run only once a person has pressed something.
function openParticipant() {
    engine.start();
    window.open("participant.html", "haptograph-participant", "popup,width=1100,height=800");
}

connection.on("experimenter", (next) => {
    view = next;
    show();
});
connection.on("refused", ({ error }) => setText(find("problem"), error));
connection.on("lost", ({ reason }) => {
    view = null;
    setText(find("who"), "not connected");
    setText(find("now"), reason || "The connection to haptograph is lost. Is it still running? What was answered is on disk.");
    for (const id of ["main", "begin", "actions", "note", "conditions", "limits"]) find(id).hidden = true;
});

// What is to be done now, and the button for it.
function task({ session, to_confirm, participant_is_there, pressed_n }) {
    if (!participant_is_there && engine) return ["The participant has a window of its own. Put it where only they see it.", "Open the participant's page", openParticipant];
    if (!participant_is_there) return ["Open the participant's page: its address is in the terminal."];
    if (engine?.waits) return ["The page was reloaded. Browsers let its engine go on once something is pressed.", "Go on", () => engine.start()];
    if (!session) return ["Who takes part?"];
    const { state, held, laid, is_pair } = session;
    if (state === "consent") return ["The participant reads the consent. Nothing is kept before they agree."];
    if (state === "done") return ["All trials are done.", "Next participant", { say: "leave" }];
    if (to_confirm)
        return ["Look at the actuators. Are these their limits, and does the power switch work?", "They are, and it does", { say: "confirm" }];
    if (state === "preparing") {
        const why = held && held !== "lay out" ? `${held[0].toUpperCase()}${held.slice(1)}.\n` : "";
        const goesOn = /^(STOP|paused|the actuators|the run)/.test(held ?? "");
        return [why + toLay(laid, is_pair, held), goesOn ? "Go on with the trial" : "Ready", { say: "ready" }];
    }
    if (state === "prepared") return ["The participant takes the tool free and starts the trial."];
    if (session.trial.kind === "recordings") return ["The take is being recorded."];
    return [pressed_n > 0 ? `The participant presses with ${pressed_n.toFixed(1)} N.` : "The participant feels and answers."];
}

function toLay([left, right], isPair, held) {
    if (held === "lay out" && !left && !right) return "Take away what lies there: nothing real is felt in this trial.";
    const parts = [];
    if (left) parts.push(isPair && right !== null ? `left ${left}` : isPair ? `left ${left}, nothing on the right` : left);
    if (right) parts.push(left || !isPair ? `right ${right}` : `right ${right}, nothing on the left`);
    return parts.length ? `Lay out: ${parts.join(", ")}` : "Nothing real lies there in this trial.";
}

function show() {
    const { session } = view;
    setText(find("about"), view.about || view.file);
    document.title = `${session?.code ?? "Experimenter"} – haptograph`;
    setText(find("who"), view.participant_is_there ? "participant's page: here" : "participant's page: not open");
    showDevices();
    const [text, label, message] = task(view);
    setText(find("now"), text);
    find("main").hidden = !label;
    setText(find("main"), label ?? "");
    find("main").onclick = typeof message === "function" ? message : message ? () => say(message) : null;
    find("limits").hidden = !view.to_confirm || !session;
    find("limits").replaceChildren(...view.driven.map((text) => make("li", { text })));
    find("begin").hidden = Boolean(session) || !view.participant_is_there;
    find("actions").hidden = find("note").hidden = !session;
    const trial = session?.trial;
    for (const id of ["pause", "open", "skip"]) find(id).disabled = !trial;
    find("open").disabled = session?.state !== "felt" || trial?.open;
    find("pause").disabled = session?.state !== "felt" && session?.state !== "prepared";
    find("repeat").disabled = !view.participants.some(({ code, done }) => code === session?.code && done > 0);
    const scale = [trial?.training && "training", trial?.scale, trial?.forced && "opened", trial?.open && "may answer"];
    const felt = trial?.felt_s > 0 && `for ${trial.felt_s} s`;
    const where = trial && [`trial ${trial.trial} of ${session.of}`, trial.phase, trial.kind, ...scale, felt];
    setText(find("where"), session ? [session.code, `group ${session.group}`, ...(where ?? [])].filter(Boolean).join(" · ") : "");
    showConditions(session?.state === "felt" ? trial.conditions : []);
    find("recorded").hidden = view.recorded.length === 0;
    setText(find("recorded"), view.recorded.join("\n"));
    showPeople();
    if (view.trouble) setText(find("problem"), view.trouble);
}

function showDevices() {
    const real = view.driven.length > 0;
    const consent = view.has_consent_text ? "" : " The study has no consent text of its own (`page`): the participant's consent is to be on paper.";
    find("devices").dataset.real = String(real);
    setText(
        find("devices"),
        (real
            ? "Real actuators. They get zeros but in trials, and only while this page is in front and connected. STOP takes them to zero."
            : "A rehearsal: all devices are simulated, nothing real moves. The participant's page takes the place of the tablet.") + consent,
    );
}

function showConditions(conditions) {
    find("conditions").hidden = conditions.length === 0;
    const items = conditions.map(({ name, part }) => {
        const item = make("li", { text: `${name} ${Math.round(100 * part)} %` });
        item.style.setProperty("--part", String(part));
        item.dataset.done = String(part >= 1);
        return item;
    });
    find("conditions").replaceChildren(...items);
}

function showPeople() {
    const { groups, participants } = view;
    setText(find("groups"), groups.map(({ name, wanted, there }) => `${name}: ${there}${wanted ? ` of ${wanted}` : ""}`).join(", "));
    const rows = participants.map(({ code, group, done, finished, withdrawn }) =>
        make("tr", {}, ...[code, group, String(done), withdrawn ? "withdrawn" : finished ? "finished" : ""].map((text) => make("td", { text }))),
    );
    find("people").tBodies[0].replaceChildren(...rows);
    setText(find("folder"), engine ? "The data are in this browser alone. Download them after each session." : view.folder);
    const names = groups.map(({ name }) => name);
    if ([...find("group").options].map(({ value }) => value).join() !== names.join()) {
        find("group").replaceChildren(...names.map((name) => make("option", { value: name, text: name })));
    }
    find("group").parentElement.hidden = names.length < 2;
    if (find("code").value === "") chooseGroup();
    showKnown();
}

// The group that lacks most people.
function chooseGroup() {
    const lack = ({ wanted, there }) => (wanted ?? 0) - there;
    const most = view.groups.reduce((most, group) => (lack(group) > lack(most) ? group : most));
    find("group").value = most.name;
}

function showKnown() {
    const code = find("code").value.trim();
    const known = view?.participants.find((known) => known.code === code);
    if (known) find("group").value = known.group || find("group").value;
    find("group").disabled = Boolean(known);
    const alike = view?.participants.find((other) => other.code.toLowerCase() === code.toLowerCase());
    const isCode = /^[A-Za-z0-9_-]*$/.test(code);
    const says = known?.withdrawn
        ? "has withdrawn"
        : known?.finished
          ? "has finished"
          : known
            ? `continues after ${known.done} trials`
            : !isCode
              ? "letters, digits, - and _ only"
              : alike
                ? `a new participant; ${alike.code} is another`
                : code && "a new participant";
    setText(find("known"), says || "");
}

// What cannot be taken back is pressed twice.
function twice(button, message) {
    const label = button.textContent;
    button.addEventListener("click", () => {
        if (certain === button) {
            if (typeof message === "function") message();
            else say(message);
            certain = null;
        } else {
            certain = button;
            setText(button, "Really?");
            setTimeout(() => {
                if (certain === button) certain = null;
                setText(button, label);
            }, 3000);
        }
    });
}

find("begin").addEventListener("submit", (event) => {
    event.preventDefault();
    say({ say: "begin", code: find("code").value.trim(), group: find("group").value });
    find("code").value = "";
});
find("code").addEventListener("input", showKnown);
find("note").addEventListener("submit", (event) => {
    event.preventDefault();
    const text = find("note-text").value.trim();
    if (!text) return;
    say({ say: "note", text });
    find("note-text").value = "";
    setText(find("noted"), "kept");
    setTimeout(() => setText(find("noted"), ""), 2000);
});
find("pause").addEventListener("click", () => say({ say: "pause" }));
find("open").addEventListener("click", () => say({ say: "open" }));
find("repeat").addEventListener("click", () => say({ say: "repeat" }));
find("leave").addEventListener("click", () => say({ say: "leave" }));
twice(find("skip"), { say: "skip" });
twice(find("withdraw"), { say: "withdraw" });
const stop = () => connection.send({ type: "stop" });
find("stop").addEventListener("click", stop);
window.addEventListener("keydown", (event) => {
    if (event.repeat) return;
    if (event.key === "Escape") return stop();
    if (event.key === "Enter" && !takesText(event.target) && event.target.tagName !== "BUTTON") find("main").onclick?.();
});
// If this page hangs or is hidden, the actuators fall to zero and the trial waits.
let last_ms = Date.now();
setInterval(() => {
    const passed_ms = Date.now() - last_ms;
    last_ms += passed_ms;
    if (view?.driven.length && !document.hidden && passed_ms < MOST_APART_MS) connection.send({ type: "hold" });
}, HOLD_MS);
if (engine) {
    letIn(engine);
    find("kept").hidden = false;
    connection.on("waiting", () => view && show());
    engine.onfailure = (why) => setText(find("problem"), `The browser cannot keep the data, so the participant waits: ${why}. Free room on the disk.`);
    find("download").addEventListener("click", async () => save(`${view?.file ?? "study"}.zip`, zip(await engine.kept())));
    twice(find("forget"), async () => {
        await engine.store?.clear();
        location.reload();
    });
}
connection.connect();
window.experimenter = { engine, get view() { return view; } }; // for tests
