// A recording by ear, beside surfaces along its motion: one sounds at a time, all go on, so that a switch has no gap; all are
// brought to one level.
import { Abx } from "./abx.js";
import { find, make } from "./dom.js";

const SWITCH_S = 0.005;
const RMS = 0.1;
const TRIALS = [10, 16, 24];

// Gains that bring all to one level, none above full scale.
export function gainsOf(samples) {
    const powers = samples.map((each) => Math.sqrt(each.reduce((sum, x) => sum + x * x, 0) / Math.max(1, each.length)));
    const gains = powers.map((rms) => (rms > 0 ? RMS / rms : 0));
    const peak = Math.max(...samples.map((each, i) => gains[i] * each.reduce((most, x) => Math.max(most, Math.abs(x)), 0)));
    return gains.map((gain) => gain / Math.max(1, peak));
}

const decoded = (base64) => {
    const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    return new Float32Array(bytes.buffer);
};

// Voices in a loop, of which one sounds.
class Player {
    constructor(voices, level) {
        this.context = new AudioContext();
        this.master = new GainNode(this.context, { gain: level });
        this.master.connect(this.context.destination);
        const samples = voices.map((voice) => decoded(voice.samples));
        const gains = gainsOf(samples);
        this.levels_db = gains.map((gain) => 20 * Math.log10(gains[0] / gain));
        this.seconds = Math.min(...samples.map((each, i) => each.length / voices[i].rate_hz));
        this.switches = samples.map((each, i) => this.#begin(each.map((x) => gains[i] * x), voices[i].rate_hz));
        this.begun_s = this.context.currentTime;
    }

    #begin(samples, sampleRate) {
        const buffer = new AudioBuffer({ length: samples.length, sampleRate });
        buffer.copyToChannel(samples, 0);
        const source = new AudioBufferSourceNode(this.context, { buffer, loop: true, loopEnd: this.seconds });
        const gain = new GainNode(this.context, { gain: 0 });
        source.connect(gain).connect(this.master);
        source.start();
        return gain.gain;
    }

    get place_s() {
        return (this.context.currentTime - this.begun_s) % this.seconds;
    }

    // Only the voice of this number sounds; null: none.
    play(number) {
        this.switches.forEach((gain, i) => gain.setTargetAtTime(i === number ? 1 : 0, this.context.currentTime, SWITCH_S));
    }

    close() {
        this.context.close();
    }
}

// Asks for the voices of a recording, { name, csv, mapping, path } with the surface that was learned of it, and shows them.
export async function listen(studio, recording) {
    const host = find("listen");
    const close = () => (state.player?.close(), host.replaceChildren(), (host.hidden = true), (studio.silence = () => {}));
    const state = { recording, other: "", player: null, playing: null, abx: null, close };
    studio.silence();
    studio.silence = () => choose(state, null);
    host.hidden = false;
    await load(studio, state);
}

async function load(studio, state) {
    const { name, csv, mapping, path } = state.recording;
    const host = find("listen");
    host.replaceChildren(make("p", { role: "status", text: `Rendering ${name}…` }));
    state.player?.close();
    state.player = state.abx = null;
    const surfaces = [path, state.other].filter(Boolean);
    const reply = await studio.connection.request({ type: "listen", name, csv, mapping, surfaces });
    if (!reply.ok) {
        host.replaceChildren(make("p", { class: "error", role: "alert", text: reply.error }), make("button", { text: "Close", onclick: state.close }));
        return;
    }
    state.voices = reply.voices;
    state.player = new Player(reply.voices, studio.sound.gainAtLevel);
    show(studio, state);
}

function show(studio, state) {
    const { player, voices, recording } = state;
    const names = ["Recorded", ...voices.slice(1).map(({ name }, i) => (i === 0 && recording.path ? `Rendered: ${name}` : name))];
    state.buttons = names.map((name, i) => make("button", { text: name, "aria-pressed": "false", onclick: () => choose(state, state.playing === i ? null : i) }));
    const others = studio.graph.surfaces.filter(({ path }) => path !== recording.path);
    const other = make("select", { "aria-label": "Another surface" }, make("option", { value: "", text: "Another surface…" }), ...others.map(({ path, name }) => make("option", { value: path, text: name })));
    other.value = state.other;
    other.addEventListener("change", () => ((state.other = other.value), load(studio, state)));
    const levels = names.map((name, i) => `${name} ${player.levels_db[i] < 0 ? "−" : "+"}${Math.abs(player.levels_db[i]).toFixed(1)} dB`);
    const note = `The first ${player.seconds.toFixed(1)} s, in a loop, all at one level. Their own, against the recorded: ${levels.slice(1).join(", ")}.`;
    const trials = make("select", { "aria-label": "Number of trials" }, ...TRIALS.map((count) => make("option", { value: String(count), text: `${count} trials` })));
    const begin = make("button", { text: "ABX", title: "Can you tell recorded and rendered apart?", disabled: names.length < 2 });
    state.test = make("div", { class: "abx" });
    begin.addEventListener("click", () => {
        state.abx = new Abx(Number(trials.value));
        choose(state, null);
        showTest(state);
    });
    find("listen").replaceChildren(
        make("div", { class: "listen-row", role: "group", "aria-label": "What sounds" }, ...state.buttons, other),
        make("p", { class: "soft", text: note }),
        make("div", { class: "listen-row" }, begin, trials, make("span", { class: "grow" }), make("button", { class: "quiet", text: "Close", onclick: state.close })),
        state.test,
    );
}

// Sounds a voice; one that sounds is silenced by null.
function choose(state, number, button = number) {
    if (!state.player) return;
    state.player.context.resume();
    state.player.play(number);
    state.playing = number;
    [...state.buttons, ...(state.letters ?? [])].forEach((each) => each.setAttribute("aria-pressed", "false"));
    const pressed = typeof button === "number" ? state.buttons[button] : button;
    pressed?.setAttribute("aria-pressed", "true");
}

// A is the recorded, B the first rendered voice.
function showTest(state) {
    const { abx } = state;
    for (const button of state.buttons) button.disabled = !abx.isOver;
    if (abx.isOver) return state.test.replaceChildren(make("p", { role: "status", text: `${abx.result} A study with people is made by \`haptograph study\`.` }));
    const answers = ["A", "B"].map((name, i) => make("button", { text: `X is ${name}`, disabled: true, onclick: () => (abx.answer(i), choose(state, null), showTest(state)) }));
    const hear = (number) => (event) => {
        choose(state, number, event.currentTarget);
        if (event.currentTarget.textContent === "X") for (const answer of answers) answer.disabled = false;
    };
    state.letters = [["A", 0], ["B", 1], ["X", abx.x]].map(([text, number]) => make("button", { text, "aria-pressed": "false", onclick: hear(number) }));
    const trial = make("span", { role: "status", text: `Trial ${abx.answers.length + 1} of ${abx.trials}: A is recorded, B rendered; which is X?` });
    state.test.replaceChildren(make("div", { class: "listen-row", role: "group", "aria-label": "ABX" }, ...state.letters, ...answers, trial));
}
