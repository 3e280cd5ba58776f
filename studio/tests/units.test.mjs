// What of the page needs no browser: node --test
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { readdirSync, readFileSync } from "node:fs";
import test from "node:test";
import { Abx, guessing } from "../page/abx.js";
import { drivenOf, isRecent } from "../page/arming.js";
import { commandOf } from "../page/bundle.js";
import { candidates, firstScopes, Motion, replacements } from "../page/choices.js";
import { Connection } from "../page/connection.js";
import { scaleFor } from "../page/control.js";
import { PageEngine } from "../page/engine.js";
import { Emitter } from "../page/events.js";
import { density } from "../page/fft.js";
import { pointers, read } from "../page/frames.js";
import { Hands, tiltOf } from "../page/hands.js";
import { completions, helpOf } from "../page/help.js";
import { GESTURES, Stroke } from "../page/gestures.js";
import { GRAPH } from "../page/keys.js";
import { headOf } from "../page/mapping.js";
import { Levels } from "../page/levels.js";
import { gainsOf } from "../page/listen.js";
import { axesFor, isExtrapolated, locate } from "../page/locate.js";
import { digits, quantity, roundUp, ticks, tickText } from "../page/numbers.js";
import { unmoved } from "../page/pads.js";
import { axisRange, equalRanges, extentOf, framesOf, isConstant, Points } from "../page/plotting.js";
import { placeOf, treeOf } from "../page/ron.js";
import { closeUp, limitsOf, sidesIn } from "../page/scene.js";
import * as edit from "../page/text-changes.js";
import { Trace } from "../page/trace.js";
import { patternOf, wavOf } from "../page/wav.js";
import { zip } from "../page/zip.js";

test("every module of the page is a module", () => {
    const folder = new URL("../page/", import.meta.url);
    for (const name of readdirSync(folder).filter((each) => each.endsWith(".js"))) {
        const { status, stderr } = spawnSync(process.execPath, ["--input-type=module", "--check"], {
            input: readFileSync(new URL(name, folder)),
        });
        assert.equal(status, 0, `${name}: ${stderr}`);
    }
});

test("who guesses in an ABX is right as often as a coin falls", () => {
    // Binomial(10, 1/2): P(8 or more) = 56/1024, P(0 or more) = 1.
    assert.ok(Math.abs(guessing(8, 10) - 56 / 1024) < 1e-12);
    assert.equal(guessing(0, 10), 1);
    let isA = false;
    const abx = new Abx(4, () => (isA = !isA));
    for (const answer of [0, 0, 0, 1, 1]) abx.answer(answer); // X is A, B, A, B
    assert.deepEqual(abx.answers, [true, false, true, true]);
    assert.ok(abx.isOver);
});

test("sounds that are compared have one level, and none is beyond full scale", () => {
    const rms = (samples, gain) => gain * Math.sqrt(samples.reduce((sum, x) => sum + x * x, 0) / samples.length);
    const [steady, peaked, silent] = [[1, -1, 1, -1], [0, 0, 0, 50], [0, 0, 0, 0]];
    const [one, other, none] = gainsOf([steady, peaked, silent]);
    assert.ok(Math.abs(rms(steady, one) / rms(peaked, other) - 1) < 1e-12);
    assert.ok(50 * other <= 1 && none === 0);
});

test("the kept sound is a WAV file of floats that says its full scale", async () => {
    const bytes = await wavOf(Float32Array.of(0.5, -1), 48_000, "odd").arrayBuffer();
    const view = new DataView(bytes);
    const name = (at) => String.fromCharCode(...new Uint8Array(bytes, at, 4));
    assert.deepEqual([name(0), view.getUint32(4, true), name(8)], ["RIFF", bytes.byteLength - 8, "WAVE"]);
    const chunks = {};
    for (let at = 12; at < bytes.byteLength; at += 8 + view.getUint32(at + 4, true) + (view.getUint32(at + 4, true) % 2)) chunks[name(at)] = at + 8;
    assert.deepEqual(Object.keys(chunks), ["fmt ", "fact", "LIST", "data"]);
    assert.deepEqual([view.getUint16(chunks["fmt "], true), view.getUint32(chunks["fmt "] + 4, true)], [3, 48_000]);
    assert.deepEqual([view.getFloat32(chunks.data, true), view.getFloat32(chunks.data + 4, true)], [0.5, -1]);
});

test("a long message about the kept sound begins with its type, and has every sample", () => {
    const samples = Float32Array.from({ length: 20_000 }, (_, i) => i);
    const message = patternOf("ahap", samples, { rate_hz: 48_000, full_scale: 2, unit: "A" });
    assert.ok(JSON.stringify({ ...message, request: 1 }).startsWith('{"type":"export"'));
    const bytes = Uint8Array.from(atob(message.samples), (letter) => letter.charCodeAt(0));
    assert.deepEqual(new Float32Array(bytes.buffer), samples);
    assert.deepEqual([message.format, message.rate_hz, message.full_scale, message.unit], ["ahap", 48_000, 2, "A"]);
});

test("the columns of a foreign recording are named and drawn", () => {
    const { names, columns } = headOf('# a note\n"clock";pressing;v_tip;vib\n0,5;1;60;-0,25\n1;x;61;0\n');
    assert.deepEqual(names, ["clock", "pressing", "v_tip", "vib"]);
    assert.deepEqual(columns, [[0.5, 1], [1, NaN], [60, 61], [-0.25, 0]]);
    for (const none of ["", "1,2\n3,4\n", "one column\n"]) assert.equal(headOf(none), null);
});

test("an archive has its files with their checksums", async () => {
    const text = (value) => new TextEncoder().encode(value);
    const archive = new DataView(
        await zip([
            { path: "a/é.csv", bytes: text("123456789") },
            { path: "b", bytes: text("") },
        ]).arrayBuffer(),
    );
    assert.equal(archive.getUint32(14, true), 0xcbf43926); // the check value of CRC-32
    assert.deepEqual([archive.getUint32(18, true), archive.getUint16(26, true)], [9, 8]);
    const end = archive.byteLength - 22;
    assert.deepEqual([archive.getUint32(end, true), archive.getUint16(end + 10, true)], [0x06054b50, 2]);
    assert.equal(archive.getUint32(archive.getUint32(end + 16, true), true), 0x02014b50);
});

test("pointers stand in the message as the protocol says", () => {
    const view = new DataView(
        pointers(3, [
            { time_ms: 1, x_mm: 2, y_mm: 3, force_n: 4, tilt_x_deg: 5, tilt_y_deg: 6 },
            { time_ms: 1.5, x_mm: -2.5, y_mm: 0, force_n: 0, tilt_x_deg: 0, tilt_y_deg: -60 },
        ]),
    );
    assert.equal(view.byteLength, 8 + 2 * 28);
    assert.deepEqual([view.getUint8(0), view.getUint8(1), view.getUint16(2, true), view.getUint32(4, true)], [1, 3, 2, 0]);
    assert.deepEqual(
        [view.getFloat64(8, true), ...[16, 20, 24, 28, 32].map((at) => view.getFloat32(at, true))],
        [1, 2, 3, 4, 5, 6],
    );
    assert.deepEqual(
        [view.getFloat64(36, true), ...[44, 48, 52, 56, 60].map((at) => view.getFloat32(at, true))],
        [1.5, -2.5, 0, 0, 0, -60],
    );
});

// A message of samples as the engine writes it.
function samples(lanes, thinned, time_s, interval_s, numbers) {
    const view = new DataView(new ArrayBuffer(24 + 4 * numbers.length));
    [2, 7, lanes, thinned ? 1 : 0].forEach((byte, i) => view.setUint8(i, byte));
    view.setUint32(4, numbers.length / lanes / (thinned ? 2 : 1), true);
    view.setFloat64(8, time_s, true);
    view.setFloat64(16, interval_s, true);
    numbers.forEach((number, i) => view.setFloat32(24 + 4 * i, number, true));
    return view.buffer;
}

test("samples are read, cut ones and unknown ones are passed over", () => {
    const frame = read(samples(2, true, 1.5, 0.25, [1, 2, 3, 4, 5, 6, 7, 8]));
    assert.deepEqual(
        { ...frame, values: [...frame.values] },
        {
            kind: "samples",
            place: 7,
            lanes: 2,
            thinned: true,
            count: 2,
            time_s: 1.5,
            interval_s: 0.25,
            values: [1, 2, 3, 4, 5, 6, 7, 8],
        },
    );
    assert.equal(read(samples(1, false, 0, 1, [1, 2]).slice(0, 28)), null);
    assert.equal(read(new Uint8Array(32).fill(9).buffer), null);
    assert.equal(read(new ArrayBuffer(3)), null);
});

test("a trace keeps the latest, fills gaps with nothing, and begins anew when time goes back", () => {
    const trace = new Trace("a.b", true);
    const push = (time_s, ...numbers) => trace.push(read(samples(1, false, time_s, 0.001, numbers)));
    push(0, 1, 2, 3);
    push(0.003, 4);
    assert.deepEqual([trace.count, trace.latest(), trace.end_s], [4, 4, 0.004]);
    push(0.006, 5);
    assert.deepEqual(
        [3, 2, 1, 0].map((back) => trace.most[trace.place(back)]),
        [4, NaN, NaN, 5],
    );
    push(0.001, 9);
    assert.deepEqual([trace.count, trace.latest()], [1, 9]);
    for (let i = 0; i < 5000; i++) push(0.002 + i * 0.001, i);
    assert.equal(trace.count, trace.capacity);
    assert.equal(trace.latest(), 4999);
});

test("the density of a sine holds its power, and that of noise its variance", () => {
    const size = 4096,
        rate_hz = 10_000;
    const power = (signal) => density(signal, rate_hz).reduce((sum, value) => sum + (value * rate_hz) / size, 0);
    assert(
        Math.abs(
            power(Float64Array.from({ length: size }, (_, i) => 3 * Math.sin((2 * Math.PI * 440 * i) / rate_hz))) / 4.5 - 1,
        ) < 0.01,
    );
    let seed = 1;
    const random = () => (seed = (seed * 48271) % 2147483647) / 2147483647;
    const noise = Float64Array.from({ length: size }, () => random() + random() + random() - 1.5); // variance 3/12
    assert(Math.abs(power(noise) / 0.25 - 1) < 0.15);
});

test("axes have round numbers", () => {
    assert.deepEqual([0.3, 2, 2.1, 7].map(roundUp), [0.5, 2, 5, 10]);
    assert.deepEqual(ticks(-1, 1, 4), [-1, -0.5, 0, 0.5, 1]);
    assert.deepEqual(
        [
            [0.5, 0.5],
            [2, 1],
            [-0, 0.1],
            [0.00002, 0.00001],
        ].map(([value, step]) => tickText(value, step)),
        ["0.5", "2", "0.0", "2e-5"],
    );
    assert.deepEqual(
        [quantity(0.0125, "A"), quantity(0.132, "m/s"), quantity(1.5, "N"), digits(0), digits(NaN)],
        ["12.5 mA", "132 mm/s", "1.50 N", "0", "–"],
    );
});

test("a slider is logarithmic where the range is wide, and none where it means nothing", () => {
    const log = scaleFor({ min: 1, max: 10_000, value: 5, whole: false });
    assert.deepEqual([log.to(0), log.to(0.5), log.to(1), log.from(100)], [1, 100, 10_000, 0.5]);
    const line = scaleFor({ min: 0, max: 10, value: 5, whole: true });
    assert.deepEqual([line.to(0.24), line.from(5)], [2, 0.5]);
    assert.equal(scaleFor({ min: null, max: 3, value: 1 }), null);
    assert.equal(scaleFor({ min: 0, max: 1e9, value: 0.5 }), null);
});

test("the editor knows where in the text it is", () => {
    const text = 'Graph(nodes: { // "no(\n "a": Gain(input: "b.out", factor: 2), "c": Ga';
    const at = (mark, more = 0) => placeOf(text, text.indexOf(mark) + more);
    const around = ({ open }) => open.map(({ bracket, name }) => name + bracket);
    assert.deepEqual(around(at("input")), ["Graph(", "{", "Gain("]);
    assert.equal(at("input").key, null);
    const string = at("b.out", 2);
    assert.deepEqual([string.key, text.slice(string.string)[0]], ["input", "b"]);
    assert.equal(at("no(", 1).comment, true);
    const end = placeOf(text, text.length);
    assert.deepEqual([around(end), end.key], [["Graph(", "{"], "c"]);
});

// A text in which everything stands that could mislead: comments in comments, brackets in strings, raw strings.
const MISLEADING = `#![enable(implicit_some)]
Graph( /* not /* a */ "node": X( */
    nodes: {
        "a": Gain(input: Linear("b.out"), gain: 2 /* ) */),   // "a": Gain(gain: 3)
        "s": Sum(inputs: ["x",
            "y", // the second
        ]),
        "m": Mix(
            path: r#"a "quoted" (]"#,
            name: "(\\")", // of it
            limit: (peak: 1.0,), depth: Some(2)
        ),
        "bare": Noise,
        "d": Add(inputs: ["a", Delay(from: "m", frames: 3)], names: ["one", "two"]),
        "e": Expression(inputs: {"u": "a", "v": Hold("b")}),
        "p": Gain(input: "a", gain: Param("g")),
        "t": Twice(of: "a", by: 3),
    },
    parameters: { "g": 1.5 },
    templates: { "Twice": Template(nodes: { "inner": Gain(gain: Setting("by")) }) },
)
`;

test("a change of the text is the smallest, and leaves comments and alignment as they are", () => {
    const at = (path) => edit.nodeAt(MISLEADING, path).value;
    const given = (path, name, source) => edit.fieldChange(MISLEADING, at(path), name, source);
    const is = (changes, from, to) => assert.equal(edit.changed(MISLEADING, changes), MISLEADING.replace(from, () => to));
    is(given("a", "gain", "5"), "gain: 2 /*", "gain: 5 /*");
    is(given("a", "more", "5"), "gain: 2 /*", "gain: 2, more: 5 /*");
    is(given("m", "path", '"b"'), 'r#"a "quoted" (]"#', '"b"');
    is(given("m", "depth", "4"), "Some(2)", "Some(4)");
    is(given("m", "new", "4"), "Some(2)", "Some(2), new: 4");
    is(given("bare", "seed", "4"), "Noise,", "Noise(seed: 4),");
    is(edit.fieldChange(MISLEADING, edit.itemOf(at("m"), "limit").value, "window", "9"), "1.0,)", "1.0, window: 9,)");
    is(edit.removed(MISLEADING, at("a"), "gain"), ', gain: 2 /*', ' /*');
    is(edit.removed(MISLEADING, at("m"), "path"), '            path: r#"a "quoted" (]"#,\n', "");
    is(edit.removed(MISLEADING, at("m"), "name"), 'name: "(\\")", // of it', "// of it");
    const connect = (path, input, output, wrapped) => edit.connection(MISLEADING, at(path), input, output, wrapped);
    is(connect("a", { name: "input" }, "q.r"), '"b.out"', '"q.r"');
    is(connect("a", { name: "input" }, "q.r", 'Hold("q.r")'), 'Linear("b.out")', 'Hold("q.r")');
    is(connect("s", { name: "inputs", isSeveral: true }, "z"), "// the second\n", '// the second\n            "z",\n');
    is(connect("d", { name: "inputs", slot: 1, isSeveral: true }, "z"), 'from: "m"', 'from: "z"');
    is(connect("e", { name: "inputs", slot: 1, isSeveral: true }, "z"), 'Hold("b")', 'Hold("z")');
    is(connect("bare", { name: "inputs", isSeveral: true }, "z"), "Noise,", 'Noise(inputs: ["z"]),');
    assert.equal(connect("e", { name: "inputs", slot: null, isSeveral: true }, "z"), null);
    assert.deepEqual(edit.inputAt(at("d"), [{ name: "inputs" }], "two", 0), { name: "inputs", slot: 1 });
    assert.deepEqual(edit.inputAt(at("e"), [{ name: "inputs" }], "v", 0), { name: "inputs", slot: 1 });
    assert.deepEqual([edit.parameterIn(edit.itemOf(at("p"), "gain").value), edit.contentOf(edit.parameterAt(MISLEADING, "g").value)], ["g", "1.5"]);
    const inner = edit.nodeAt(MISLEADING, "t/inner");
    assert.deepEqual([inner.template, edit.sortOf(edit.itemOf(inner.value, "gain").value), inner.use.key], ["Twice", "computed", "t"]);
    const devices = 'Graph(endpoints: { "live": { "pen": Udp() }, "simulated": { "pen": Hand(force_n: 1) } })';
    for (const [kind, set, found] of [["Hand", "live", "Hand"], ["Host", "simulated", "Hand"], ["Host", "live", "Udp"]])
        assert.equal(edit.nameOf(edit.deviceAt(devices, "pen", kind, set).value), found);
    for (const broken of ["", "Graph(", 'Graph(nodes: {"a": ', ")", "Graph(nodes: { : , ( )", '"', "/*"]) edit.nodeAt(broken, "a");
});

test("in every shipped graph each written scalar is replaced alone", () => {
    const folder = new URL("../../graphs/", import.meta.url);
    const graphs = readdirSync(folder, { recursive: true }).filter((name) => name.endsWith(".ron"));
    let count = 0;
    for (const name of graphs) {
        const text = readFileSync(new URL(name, folder), "utf8");
        if (!/^Graph\(/m.test(text)) continue;
        for (const { key: node } of edit.itemsIn(text, "nodes")) {
            const { value } = edit.nodeAt(text, node);
            for (const { key, value: written } of value.items ?? []) {
                if (edit.sortOf(written) === "other") continue;
                const source = text.slice(written.from, written.to);
                assert.equal(edit.changed(text, edit.fieldChange(text, value, key, source)), text, `${name} ${node}.${key}`);
                const other = edit.sortOf(written) === "number" ? "12.5" : '"another, (one"';
                const changed = edit.changed(text, edit.fieldChange(text, value, key, other));
                assert.equal(changed, text.slice(0, written.from) + other + text.slice(written.to));
                const again = edit.itemOf(edit.nodeAt(changed, node).value, key).value;
                assert.equal(changed.slice(again.from, again.to), other);
                // Taken out and written again, it is there with all others.
                const without = edit.changed(text, edit.removed(text, value, key));
                const keys = (of) => edit.nodeAt(of, node).value.items.map((item) => item.key);
                assert.deepEqual(keys(without), keys(text).filter((each) => each !== key), `${name} ${node}.${key}`);
                const back = edit.changed(without, edit.fieldChange(without, edit.nodeAt(without, node).value, key, source));
                assert.deepEqual(keys(back).sort(), keys(text).sort());
                assert.equal(back.match(/\/\/.*/g)?.join(), text.match(/\/\/.*/g)?.join(), "no comment is lost");
                count++;
            }
        }
        assert.equal(treeOf(text).name, "Graph");
    }
    assert(count > 300, `${count} settings`);
});

// What an engine says that it has, for the editor.
const limit = {
    name: "limit",
    doc: "The limit.",
    required: true,
    choices: [],
    parts: [
        {
            choice: null,
            doc: "",
            fields: [
                { name: "peak_a", doc: "The peak.", unit: "A", required: true, choices: [], parts: [] },
                { name: "window_s", doc: "The window.", unit: "s", default: "10.0", choices: [], parts: [] },
            ],
        },
    ],
};
const radius = { name: "radius_mm", doc: "The radius.", unit: "mm", default: "30.0", min: 1, max: 100, choices: [], parts: [] };
const stroke = {
    name: "stroke",
    doc: "The path.",
    choices: ["Still", "Circles"],
    parts: [
        { choice: "Still", doc: "Nowhere.", fields: [] },
        { choice: "Circles", doc: "Round and round.", fields: [radius] },
    ],
};
const quantitySetting = { name: "quantity", doc: "What it is.", default: '"number"', is_quantity: true, choices: [], parts: [] };
const writing = {
    hello: {
        kinds: [
            {
                name: "Sine",
                group: "sources",
                doc: "A tone.",
                inputs: [],
                outputs: [{ name: "value", doc: "The tone's value.", unit: "" }],
                settings: [quantitySetting],
            },
            {
                name: "Sink",
                group: "sinks",
                doc: "An end.",
                inputs: [{ name: "current", doc: "What drives it.", unit: "A" }],
                outputs: [{ name: "delivered", doc: "What the limits let through.", unit: "A" }],
                settings: [limit],
            },
            {
                name: "Bands",
                group: "filters",
                doc: "Adds and splits.",
                inputs: [{ name: "parts", doc: "What is added.", unit: "", named: true }],
                outputs: [{ name: "bands", doc: "A band.", unit: "A", named_by: "names" }],
                settings: [],
            },
            { name: "Tablet", group: "devices", doc: "A tablet.", inputs: [], outputs: [], settings: [stroke] },
        ],
        bridges: [{ name: "Hold", gives: "the latest frame" }],
        quantities: [
            { name: "number", unit: "" },
            { name: "angular speed", unit: "rad/s" },
        ],
    },
    graph: {
        ports: [{ name: "tone.value", node: "tone", quantity: "number", kind: "scalar", unit: "", rate_hz: 48000 }],
        parameters: [
            { name: "gain", value: "0.5", default: "1.0", doc: "How much.", unit: "", min: 0, max: 2, is_surface: false },
        ],
        surfaces: [],
    },
};
const WRITTEN =
    'Graph(format: 1, clocks: { "audio": Driver(rate_hz: 48000), "slow": Derived(of: "audio", rate_hz: 125) }, ' +
    'nodes: { "tone": Sine(clock: "audio", quantity: "angular speed"), "end": Sink(current: Hold("tone.value"), ' +
    'gain: Param("gain"), limit: (peak_a: 1)) }, endpoints: { "simulated": { "tone": Tablet(stroke: Circles(radius_mm: 3)) } })';

// What is inserted where `text` has its bar.
const applied = (text) => optionsAt(text).map(({ apply }) => apply);

// What is offered there, by label, with the details.
const offered = (text) => Object.fromEntries(optionsAt(text).map(({ label, detail }) => [label, detail ?? ""]));

function optionsAt(text, of = writing) {
    const at = text.indexOf("|");
    const doc = text.replace("|", "");
    const from = at - doc.slice(0, at).match(/\w*$/)[0].length;
    const context = { state: { doc: { toString: () => doc } }, pos: at, explicit: true, matchBefore: () => ({ from, to: at }) };
    return completions(of)(context)?.options ?? [];
}

test("a kind is found by its names in other programs", () => {
    const [sine] = writing.hello.kinds.filter(({ name }) => name === "Sine");
    const kinds = [{ ...sine, doc: "A tone. Elsewhere: SinOsc, os.osc, rate limiter." }];
    const of = { ...writing, hello: { ...writing.hello, kinds } };
    const text = 'Graph(nodes: { "a": Sin|(gain: 1)';
    const found = optionsAt(text, of).map(({ label, apply, detail }) => [label, apply, detail]);
    assert.deepEqual(found.slice(1), ["SinOsc", "os.osc", "rate limiter"].map((label) => [label, "Sine", "Sine"]));
});

test("the editor completes what can stand at a place, with units, and nothing else", () => {
    const nodes = (text) => offered(`Graph(format: 1, clocks: { "audio": Driver(rate_hz: 48000) }, nodes: { ${text}`);
    assert.deepEqual(nodes('"a": Sine(quantity: "|"'), { number: "1", "angular speed": "rad/s" });
    assert.deepEqual(Object.keys(nodes('"a": Sink(limit: (pe|')), ["peak_a", "window_s"]);
    assert.equal(nodes('"a": Sink(limit: (|').window_s, "s");
    assert.equal(nodes('"a": Sink(limit: (window_s: |')["10.0"], "(s)");
    assert.deepEqual(nodes('"a": Sine(clock: "|"'), { audio: "48000 Hz" });
    // An output of the graph that runs, and one of a node that was just written.
    assert.deepEqual(nodes('"b": Sink(), "a": Sink(current: "|"'), {
        "tone.value": "48000 Hz",
        "b.delivered": "A, Sink",
        "a.delivered": "A, Sink",
    });
    assert.deepEqual(nodes('"a": Sink(current: |'), { Hold: "the latest frame", Param: "gain" });
    assert.deepEqual(nodes('"a": Sink(gain: Param("|"'), { gain: "0.5" });
    assert.deepEqual(Object.keys(nodes('"a": |')), ["Sine", "Sink", "Bands"]);
    // Connections with names, to outputs that a setting names.
    assert.deepEqual(nodes('"a": Bands(|'), { parts: "inputs by name", clock: nodes('"a": Sine(|').clock });
    const split = '"b": Bands(names: ["low", "high"]), "a": Bands(parts: {"x": ';
    assert.deepEqual(nodes(`${split}"|"`), { "tone.value": "48000 Hz", "b.low": "A, Bands", "b.high": "A, Bands" });
    assert.deepEqual(nodes(`${split}"tone", "|"`), {});
    assert.deepEqual(nodes('"|"'), {});
    const device = 'Graph(endpoints: { "simulated": { "p": ';
    assert.deepEqual(Object.keys(offered(`${device}|`)), ["Tablet"]);
    // What follows already is not inserted again.
    assert.deepEqual(applied('Graph(nodes: { "a": Si|'), ["Sine(", "Sink(", "Bands("]);
    assert.deepEqual(applied('Graph(nodes: { "a": Si| (gain: 1)'), ["Sine", "Sink", "Bands"]);
    assert.deepEqual(applied('Graph(nodes: { "a": Sink(current: |("b"))'), ["Hold", "Param"]);
    assert.deepEqual(applied('Graph(nodes: { "a": Sink(limit: (pe| : 1'), ["peak_a", "window_s"]);
    assert.deepEqual(Object.keys(offered(`${device}Tablet(stroke: |`)), ["Still", "Circles"]);
    assert.deepEqual(offered(`${device}Tablet(stroke: Circles(|`), { radius_mm: "mm" });
    assert.deepEqual(Object.keys(offered("Graph(|")), Object.keys(GRAPH));
    assert.deepEqual(Object.keys(offered('Graph(clocks: { "a": |')), ["Driver", "Derived"]);
    assert.deepEqual(Object.keys(offered('Graph(clocks: { "a": Derived(|')), ["of", "rate_hz"]);
    assert.deepEqual(offered('Graph(about: "|"'), {});
});

test("the editor explains settings, outputs, bridges, clocks, parameters and quantities", () => {
    const at = (mark, more = 1) => {
        const { title, doc, more: rest } = helpOf(writing, WRITTEN, WRITTEN.indexOf(mark) + more) ?? {};
        return title && [title, doc, rest ?? ""].join("; ");
    };
    assert.equal(at("format"), `format; ${GRAPH.format}; of Graph`);
    assert.match(at("rate_hz: 125"), /^rate_hz;.* ?of Derived$/);
    assert.match(at("Driver("), /^Driver \(clock\)/);
    assert.match(at('"slow"'), /^slow \(Derived\); .*; 125 Hz$/);
    assert.match(at('clock: "audio"', 9), /^audio \(Driver\).* ?48000 Hz$/);
    assert.match(at("angular speed", 9), /^angular speed; .*rad\/s/);
    assert.match(at('"tone.value"', 3), /^tone.value; The tone's value.; .*48000 Hz$/);
    assert.match(at("Hold("), /^Hold \(bridge\).* ?the latest frame/);
    assert.match(at('Param("gain")', 8), /^gain \(0 to 2, default 1.0\); How much.; now 0.5$/);
    assert.match(at("peak_a"), /^peak_a \(A, required\); The peak.; of limit$/);
    assert.match(at("Circles("), /^Circles; Round and round.; fields: radius_mm$/);
    assert.match(at("radius_mm"), /^radius_mm \(1 to 100 mm, default 30.0\).* ?of Circles$/);
    assert.match(at("Sink("), /^Sink \(sinks\).* ?outputs: delivered/);
    assert.equal(at("48000"), undefined);
});

test("the map's weights are those of the engine, within the map and beyond it", () => {
    const { points, triangles, cases } = JSON.parse(readFileSync(new URL("weights.json", import.meta.url), "utf8"));
    const most = [0, 1].map((axis) => Math.max(...points.map((point) => point[axis])));
    let beyond = 0;
    for (const [speed, force, weights] of cases) {
        const { corners, clamped } = locate({ points, triangles }, speed, force);
        const isBeyond = speed < 0 || force < 0 || speed > most[0] || force > most[1];
        assert.equal(clamped, isBeyond);
        beyond += isBeyond;
        // On a side of two triangles either is right: what counts is the weight of each model.
        const apart = new Map(weights);
        for (const { vertex, weight } of corners) apart.set(vertex, (apart.get(vertex) ?? 0) - weight);
        const worst = Math.max(...[...apart.values()].map(Math.abs));
        assert(worst < 1e-9, `${worst} apart at ${speed} m/s and ${force} N`);
    }
    assert(cases.length === 100 && beyond > 20, `${beyond} of ${cases.length} points are beyond the map`);
});

test("tilt is what the browser says, by either way of saying it", () => {
    assert.deepEqual(tiltOf({ tiltX: 30, tiltY: -10 }), { tilt_x_deg: 30, tilt_y_deg: -10 });
    assert.deepEqual(tiltOf({}), { tilt_x_deg: 0, tilt_y_deg: 0 });
    const tilted = (degrees, azimuth) => {
        const { tilt_x_deg, tilt_y_deg } = tiltOf({ altitudeAngle: ((90 - degrees) * Math.PI) / 180, azimuthAngle: azimuth });
        return [tilt_x_deg, tilt_y_deg].map((tilt) => Math.round(tilt * 1e6) / 1e6);
    };
    assert.deepEqual(
        [tilted(0, 1), tilted(30, 0), tilted(30, Math.PI / 2)],
        [
            [0, 0],
            [30, 0],
            [0, 30],
        ],
    );
    assert(Object.values(tiltOf({ altitudeAngle: 0, azimuthAngle: 0.5 })).every((tilt) => tilt > 0 && tilt < 90));
});

const quiet = { ports: {}, not_finite: {}, limits: {}, costs: null, origin: null };
const counts = { ticks: 100, peak: 0, continuous: 0, slew: 0, fault: 0 };

test("a wire is as wide as its port is strong against its strongest, and says what it carries", () => {
    const levels = new Levels();
    levels.restart({ levels: [{ name: "a.b", what: "level", unit: "N" }] });
    levels.take({ ...quiet, ports: { "a.b": [2, 3] } }, 0);
    const { width: most, isFaulty, text } = levels.wire("a.b");
    assert.deepEqual([isFaulty, text], [false, "a.b: level 2.00 N rms, 3.00 N peak"]);
    levels.take({ ...quiet, ports: { "a.b": [0.5, 1] } }, 100);
    const { width: less } = levels.wire("a.b");
    levels.take({ ...quiet, not_finite: { "a.b": 4 } }, 200);
    const { width: least, ...faulty } = levels.wire("a.b");
    assert(least < less && less < most, `${least} ${less} ${most}`);
    assert.equal(levels.wire("unknown.port").width, least);
    assert(faulty.isFaulty && faulty.text.includes("in 4 frames"), faulty.text);
});

test("a node shows its part of the cost and what happened there, and for how long ago", () => {
    const levels = new Levels();
    levels.restart({ levels: [] });
    const at = (now_ms, more) => {
        levels.take({ ...quiet, ...more }, now_ms);
        return levels.node("out", now_ms);
    };
    assert.deepEqual(at(0, {}), { cost: null, mark: null });
    assert.equal(levels.hasCosts, false);
    assert.equal(at(100, { costs: { out: 0.3, other: 0.7 } }).cost, 0.3);
    assert.equal(at(200, { costs: { out: 0.001 } }).cost, null);
    const held = (continuous) => ({ limits: { out: { ...counts, continuous } } });
    assert.equal(at(300, held(0)).mark, null);
    const now = at(400, held(5)).mark;
    assert.deepEqual([now.kind, now.isRecent, now.text], ["limit", true, "limited: heat 5.00 % of its ticks"]);
    assert.equal(at(1500, held(5)).mark.isRecent, true);
    assert.equal(at(4000, held(5)).mark.isRecent, false);
    assert.equal(at(4100, held(6)).mark.isRecent, true);
    const fault = at(4200, { ...held(6), not_finite: { "out.delivered": 2, "out/inner.x": 9 }, origin: "out" }).mark;
    assert.equal(fault.kind, "fault");
    assert(fault.text.includes("2 frames of out.delivered") && fault.text.endsWith("it was the first"), fault.text);
    assert.equal(levels.node("out/other", 4200).mark, null);
});

test("endpoints that nobody moves are named, with why", () => {
    const others = ["coil", "probe"];
    const devices = [{ name: "probe", simulated: false }];
    assert.deepEqual(unmoved({ others, devices }), ["coil answers what the graph drives.", "probe is real: a hand moves it, not a pointer."]);
    assert.deepEqual(unmoved(null), []);
});

test("what is armed is what an actuator drives and is real, once each", () => {
    const actuators = [{ endpoint: "coil" }, { endpoint: "coil" }, { endpoint: "motor" }];
    const devices = [
        { name: "coil", simulated: false },
        { name: "motor", simulated: true },
        { name: "sensor", simulated: false },
    ];
    assert.deepEqual(drivenOf({ actuators, devices }), [devices[0]]);
    assert.deepEqual(drivenOf(null), []);
});

// The globals of a browser that `work` needs, as long as it runs.
async function within(globals, work) {
    const before = Object.keys(globals).map((name) => [name, Object.getOwnPropertyDescriptor(globalThis, name)]);
    for (const [name, value] of Object.entries(globals))
        Object.defineProperty(globalThis, name, { value, configurable: true, writable: true });
    try {
        return await work();
    } finally {
        for (const [name, descriptor] of before) {
            if (descriptor) Object.defineProperty(globalThis, name, descriptor);
            else delete globalThis[name];
        }
    }
}

// As in a page whose colours are their own names.
const inTheme = (work) => {
    const globals = {
        matchMedia: () => ({ addEventListener: () => {} }),
        document: { documentElement: {} },
        getComputedStyle: () => ({ getPropertyValue: (name) => name }),
    };
    return within(globals, work);
};

// A connection whose worker is the test: what it was told to send, and what comes from the engine.
function connectionOf(work, globals = {}) {
    const sent = [];
    let worker;
    class Worker {
        constructor() {
            worker = this;
        }
        postMessage({ what, message }) {
            if (what === "send") sent.push(JSON.parse(message).type);
        }
    }
    return within({ Worker, document: { querySelector: () => null }, ...globals }, () => {
        const connection = new Connection();
        const comes = (data) => worker.onmessage({ data });
        const says = (message) => comes({ what: "message", data: JSON.stringify(message) });
        return work(connection, { sent, comes, says });
    });
}

test("a STOP without a connection is sent first when there is one, and until the engine says that it is stopped", (t) =>
    connectionOf((connection, { sent, comes, says }) => {
        t.mock.timers.enable({ apis: ["setTimeout"] });
        connection.on("open", () => connection.send({ type: "levels", on: true }));
        connection.send({ type: "set", name: "a", value: 1 });
        connection.send({ type: "stop" });
        assert.deepEqual([sent, connection.stopping], [[], true]);
        comes({ what: "open" });
        assert.deepEqual(sent.splice(0), ["stop", "levels"]);
        says({ type: "status", state: "running" }); // was under way
        assert.equal(connection.stopping, true);
        comes({ what: "close", reason: "" });
        comes({ what: "open" });
        assert.deepEqual(sent.splice(0), ["stop", "levels"]);
        says({ type: "status", state: "stopped" });
        assert.equal(connection.stopping, false);
        comes({ what: "close", reason: "" });
        comes({ what: "open" });
        assert.deepEqual(sent, ["levels"]);
    }));

test("a page of a studio that was restarted says so and tries no more, one without a studio tries again", async (t) => {
    t.mock.timers.enable({ apis: ["setTimeout"] });
    for (const [answer, again] of [
        [async () => ({ status: 403 }), false],
        [async () => ({ status: 200 }), true],
        [async () => Promise.reject(new TypeError("refused")), true],
    ]) {
        let lost = null;
        const run = async (connection, { comes }) => {
            connection.on("lost", (how) => (lost = how));
            comes({ what: "close", reason: "" });
            assert(lost.wait_s !== null, "it does not wait for that to say so");
            await new Promise(setImmediate);
        };
        await connectionOf(run, { fetch: answer, location: { href: "http://127.0.0.1:1/?token=0" } });
        assert.equal(lost.wait_s !== null, again);
        assert.equal(lost.isAnother, !again);
    }
});

test("who resumes takes a STOP back that was not confirmed", () =>
    connectionOf((connection, { sent, comes }) => {
        connection.send({ type: "stop" });
        connection.send({ type: "resume" });
        comes({ what: "open" });
        assert.deepEqual([sent, connection.stopping], [[], false]);
    }));

test("actuators are held only while statuses come", () => {
    assert.deepEqual(
        [isRecent(1000, 1100), isRecent(1000, 1499), isRecent(1000, 1500), isRecent(-Infinity, 0)],
        [true, true, false, false],
    );
});

test("a drawer or a listener that fails is reported, and the others go on", async () => {
    const [next, errors, seen] = [[], [], []];
    const globals = { requestAnimationFrame: (call) => next.push(call), reportError: (error) => errors.push(error.message) };
    await within(globals, async () => {
        const { everyFrame } = await import("../page/frame.js");
        everyFrame(() => {
            throw new Error("drawer");
        });
        everyFrame((now_ms) => seen.push(now_ms));
        for (const now_ms of [1, 2, 3]) next.shift()(now_ms);
        assert.deepEqual([seen, errors, next.length], [[1, 2, 3], ["drawer"], 1]);
        const emitter = new Emitter();
        emitter.on("a", () => {
            throw new Error("listener");
        });
        emitter.on("a", (value) => seen.push(value));
        emitter.emit("a", 4);
        assert.deepEqual([seen.at(-1), errors.at(-1)], [4, "listener"]);
    });
});

// Hands on pads, and what they sent: [pad, force].
function handsOn(t, pads) {
    t.mock.timers.enable({ apis: ["setInterval"] });
    const sent = [];
    const hands = new Hands({
        sendBinary: (buffer) => {
            const view = new DataView(buffer);
            sent.push([view.getUint8(1), Math.round(view.getFloat32(24, true) * 100) / 100]);
        },
    });
    hands.setPads(pads);
    return { hands, sent };
}

test("each hand presses with the force of its own pad, and a pen keeps its force beside other hands", (t) => {
    const pad = (force_n) => ({ force_n, width_mm: 100, height_mm: 60 });
    const { hands, sent } = handsOn(t, [pad(3), pad(8)]);
    const at = (force_n) => ({ x_mm: 0, y_mm: 0, tilt_x_deg: 0, tilt_y_deg: 0, time_ms: performance.now(), force_n });
    assert.equal(hands.fullForce("pen"), 3);
    assert(hands.press("pen", at(1.5), true));
    assert.equal(hands.fullForce("second pen"), 8);
    assert(hands.press("finger", at(1)));
    assert.deepEqual([hands.fullForce("pen"), hands.fullForce("finger")], [3, 8]);
    assert.equal(hands.press("third", at(1)), false);
    sent.length = 0;
    hands.force_n = 2;
    hands.repress();
    assert.deepEqual(sent, [[1, 2]]);
    hands.lift("pen");
    assert.equal(hands.fullForce("second pen"), 3);
});

test("a pad that nobody touches rests beside one that is touched, and an input is held until it is handed back", (t) => {
    const pad = { force_n: 3, width_mm: 100, height_mm: 60 };
    const level = { endpoint: "level", channel: "value" };
    const { hands, sent } = handsOn(t, [pad, pad]);
    hands.setPads([pad, pad], [level]);
    assert.deepEqual(hands.free().map(({ number, isInput }) => [number, isInput]), [[0, false], [1, false], [2, true]]);
    hands.press(1, { pad: 1, x_mm: 0, y_mm: 0, force_n: 1, tilt_x_deg: 0, tilt_y_deg: 0, time_ms: performance.now() });
    t.mock.timers.tick(10);
    assert.deepEqual(sent, [[1, 1], [0, 0]]);
    hands.lift(1);
    sent.length = 0;
    assert(hands.hold(level, [0.75]));
    hands.liftAll();
    assert(hands.holds(level));
    hands.setPads([pad], [level]);
    hands.release(level);
    assert.deepEqual(sent, [[2, 1], [1, 0]]); // by its number then
    hands.allowed = () => false;
    assert.equal(hands.hold(level, [0]), false);
});

test("a gesture's samples stand at even times of their own, however late they are asked for", () => {
    const pad = { force_n: 3, width_mm: 160, height_mm: 100 };
    for (const gesture of Object.keys(GESTURES)) {
        const hands = [{ number: 0, pad, isInput: false }, { number: 1, pad, isInput: true }];
        const paths = [1, 2].map((number) => {
            const stroke = new Stroke({ hands, gesture, force_n: 1 }, 1000);
            const samples = [];
            for (let now_ms = 1000; now_ms < 5000; now_ms += 7 * number + 40 * Math.abs(Math.sin(now_ms)))
                samples.push(...(stroke.until(now_ms)[0]?.samples ?? []));
            return samples;
        });
        const count = Math.min(...paths.map(({ length }) => length));
        assert(count > 900);
        assert.deepEqual(paths[0].slice(0, count), paths[1].slice(0, count));
        assert(paths[0].every(({ time_ms }, i) => time_ms === 1000 + 4 * i));
        assert(paths[0].some(({ force_n }) => force_n > 0.5) && paths[0].every(({ x_mm, y_mm }) => Math.hypot(x_mm, y_mm) < 90));
    }
});

test("a copy of a trace stays as it was", () => {
    for (const thinned of [false, true]) {
        const trace = new Trace("a.b", !thinned);
        const push = (time_s, ...numbers) => trace.push(read(samples(1, thinned, time_s, 0.001, numbers)));
        push(0, 1, 2, 3, 4);
        const [copy, count] = [trace.copy(), trace.count];
        for (let i = 0; i < 60_000; i++) push(0.001 * (count + i), 9, 9);
        assert.deepEqual([copy.count, copy.latest(), copy.end_s], [count, 4, 0.001 * count]);
        assert.equal(trace.latest(), 9);
    }
});

test("an interval with NaN keeps the peak beside it and is marked, in any order", () =>
    inTheme(async () => {
        const { columnsOf } = await import("../page/draw-time.js");
        const trace = new Trace("a.b", false);
        trace.push(read(samples(1, true, 0, 0.001, [0, 1, NaN, 7, -2, 1, NaN, NaN])));
        const { low, high, faults } = columnsOf(trace, 0.004, 0.004, 1);
        assert.deepEqual([low[0][0], high[0][0], [...faults]], [-2, 7, [0]]);
        const each = columnsOf(trace, 0.004, 0.004, 4);
        assert.deepEqual(
            [[...each.low[0]], [...each.high[0]]],
            [
                [0, 7, -2, NaN],
                [1, 7, 1, NaN],
            ],
        );
        assert.deepEqual([...each.faults], [1]);
        assert.deepEqual([trace.level(1).peak, Math.round(1000 * trace.level(1).rms)], [7, 1225]);
    }));

test("a meter stands against the limit, and holds its peak for a second and a half", () =>
    inTheme(async () => {
        const { drawMeter } = await import("../page/draw-meter.js");
        const [memory, port] = [{}, { unit: "A" }];
        const limits = { peak: 0.5, continuous: 0.25 };
        // What is drawn of a level and peak: bars and marks as [left, width, colour], and texts.
        const drawn = (rms, peak, now_ms, more = { limits, actuator: { heat: 0.3 } }) => {
            const [rects, texts] = [[], []];
            const context = {
                fillRect: (x, y, width) => rects.push([x, width, context.fillStyle]),
                fillText: (text) => texts.push(text),
            };
            context.roundRect = context.fillRect;
            for (const name of ["beginPath", "fill"]) context[name] = () => {};
            const trace = { level: () => ({ rms, peak }) };
            drawMeter(context, { width: 338, height: 120 }, { trace, memory, port, now_ms, paused: false, ...more });
            return { rects, texts, held: rects.at(-1) };
        };
        const LEFT = 52;
        const WIDTH = 200;
        const first = drawn(0.1, 0.4, 0);
        const bars = first.rects.filter(([left, width, colour]) => left === LEFT && width !== 2 && colour !== "--tint6").map(([, width]) => Math.round(width));
        assert.deepEqual(bars, [40, 160, 60], "level, peak and heat, each of its limit");
        assert.deepEqual(
            first.rects.find(([, width]) => width === 2),
            [LEFT + 99, 2, "--bad"],
            "the continuous limit",
        );
        assert.deepEqual(first.held, [LEFT + 160 - 1.5, 3, "--ink"]);
        assert.deepEqual(first.texts, [
            "level",
            "100 mA",
            "peak",
            "400 mA",
            "heat",
            "30 %",
            "limit 500 mA peak, 250 mA continuous",
        ]);
        // The mark holds what was the most, then falls to what is.
        assert.equal(drawn(0.01, 0.02, 1500).held[0], LEFT + 160 - 1.5);
        assert.equal(drawn(0.01, 0.02, 1501).held[0], LEFT + 8 - 1.5);
        assert.equal(drawn(0.01, 0.3, 1502).held[0], LEFT + 120 - 1.5);
        // At the limit it is red; beyond the bar it stays in it.
        assert.deepEqual(drawn(0.2, 0.5, 1600).held, [LEFT + WIDTH - 1.5, 3, "--bad"]);
        assert.deepEqual(drawn(0.2, 0.9, 1700).held, [LEFT + WIDTH - 1.5, 3, "--bad"]);
        // Without a limit the bar is what a round number above the peak is.
        memory.held_ms = -Infinity;
        memory.full = 0;
        const free = drawn(0.1, 0.4, 9000, { limits: null, actuator: null });
        assert.deepEqual([free.held[0], free.texts.at(-1)], [LEFT + 160 - 1.5, "full bar 500 mA"]);
    }));

test("an engine of a page says why it cannot run at an address, and what to do", () => {
    const engine = new PageEngine("site.json");
    const at = (isSecureContext, prototype) => within({ isSecureContext, AudioContext: { prototype } }, () => engine.obstacle);
    return Promise.all([at(true, { audioWorklet: null }), at(false, {}), at(true, {})]).then(([none, plain, old]) => {
        assert.equal(none, null);
        assert.match(plain, /https.*localhost/);
        assert.match(old, /AudioWorklet.*current/);
    });
});

// The colours of a scheme by name, as the style sheet has them.
const STYLE = readFileSync(new URL("../page/style.css", import.meta.url), "utf8");
const PANELS = readFileSync(new URL("../page/panels.css", import.meta.url), "utf8");
const EDITOR = readFileSync(new URL("../page/editor.js", import.meta.url), "utf8");
const coloursIn = (css) =>
    Object.fromEntries([...css.matchAll(/--([\w-]+): *(#[0-9a-f]{6})/g)].map(([, name, value]) => [name, value]));
const DARK_FROM = STYLE.indexOf("@media (prefers-color-scheme: dark)");
const light = coloursIn(STYLE.slice(0, DARK_FROM));
const SCHEMES = { light, dark: { ...light, ...coloursIn(STYLE.slice(DARK_FROM)) } };

const channels = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);
const mixed = (a, b, part) => channels(a).map((x, i) => part * x + (1 - part) * channels(b)[i]);
function contrast(a, b) {
    const luminance = (rgb) =>
        rgb
            .map((part) => (part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4))
            .reduce((sum, part, i) => sum + part * [0.2126, 0.7152, 0.0722][i], 0);
    const [low, high] = [luminance(a), luminance(b)].sort((x, y) => x - y);
    return (high + 0.05) / (low + 0.05);
}

// Rules of the style sheets as { selector, text, ground }: names of colours, null where the rule sets none.
function rulesOf(css) {
    return [...css.matchAll(/([^{}]+)\{([^{}]*)\}/g)].map(([, selector, body]) => ({
        selector: selector.trim(),
        text: body.match(/(?:^|[;\s])color: *var\(--([\w-]+)\)/)?.[1] ?? null,
        ground: body.match(/background(?:-color)?: *var\(--([\w-]+)\)/)?.[1] ?? null,
        border: body.match(/border(?:-color)?: *(?:[\w.]+ +\w+ +)?var\(--([\w-]+)\)/)?.[1] ?? null,
    }));
}

test("every text and every edge of a control stands out from what is behind it, in both schemes", () => {
    const rules = [...rulesOf(STYLE.replaceAll(/\/\*.*?\*\//g, "")), ...rulesOf(PANELS)];
    const isExempt = ({ selector }) => selector.includes(":disabled"); // WCAG 1.4.3 and 1.4.11
    const GROUNDS = ["paper", "panel", "box"]; // of text whose rule sets none
    const inRules = rules
        .filter((rule) => rule.text && !isExempt(rule))
        .flatMap(({ text, ground }) => (ground ? [[text, ground]] : text.startsWith("on-") ? [] : GROUNDS.map((g) => [text, g])));
    const inEditor = [...EDITOR.matchAll(/color: "var\(--([\w-]+)\)"/g)]
        .map(([, text]) => text)
        .filter((text) => !text.startsWith("on-"));
    const drawn = ["ink", "soft"]; // on canvases
    const texts = [
        ...inRules,
        ...drawn.flatMap((text) => GROUNDS.map((ground) => [text, ground])),
        ["on-accent", "accent"],
        ["soft", "tint6"],
    ];
    const edges = rules.filter(({ border }) => ["edge", "accent"].includes(border)).map(({ border }) => border);
    const marks = ["edge", "accent", "good", "warn", "bad", "faint"]; // of what has no text
    assert(
        inRules.length > 40 && inEditor.length > 5 && edges.length > 2,
        `${inRules.length} ${inEditor.length} ${edges.length}`,
    );
    const wrong = [];
    const check = (scheme, least, name, a, b) => {
        const found = contrast(a, b);
        if (found < least) wrong.push(`${scheme}: ${name} ${found.toFixed(2)}, not ${least}`);
    };
    for (const [scheme, colours] of Object.entries(SCHEMES)) {
        for (const [text, ground] of texts)
            check(scheme, 4.5, `${text} on ${ground}`, channels(colours[text]), channels(colours[ground]));
        for (const text of inEditor) {
            check(scheme, 4.5, `${text} in the editor`, channels(colours[text]), channels(colours.box));
            check(scheme, 4.5, `${text} in its active line`, channels(colours[text]), mixed(colours.tint0, colours.box, 0.45));
        }
        for (const mark of marks)
            for (const ground of GROUNDS)
                check(scheme, 3, `${mark} on ${ground}`, channels(colours[mark]), channels(colours[ground]));
        for (const ground of ["tint5", "tint6"])
            check(scheme, 3, `edge on ${ground}`, channels(colours.edge), channels(colours[ground]));
    }
    assert.deepEqual([...new Set(wrong)], []);
});

// A trace with the samples of a function of time, at a rate.
function traceOf(rate_hz, until_s, value, lanes = 1) {
    const trace = new Trace("a.b", false);
    const numbers = Array.from({ length: Math.round(until_s * rate_hz) }, (_, k) => value(k / rate_hz)).flat();
    trace.push(read(samples(lanes, false, 0, 1 / rate_hz, numbers)));
    return trace;
}

test("a plot against another signal pairs each value with the latest of its time, whatever the rates", () => {
    for (const [x_hz, y_hz] of [
        [100, 1000],
        [1000, 100],
        [125, 2000],
        [500, 500],
    ]) {
        const [x, y] = [traceOf(x_hz, 0.5, (time_s) => time_s), traceOf(y_hz, 0.5, (time_s) => time_s)];
        const points = new Points();
        points.takePairs(x, "scalar", y, "scalar");
        assert(points.points.length > 40, `${x_hz} ${y_hz}: ${points.points.length}`);
        for (const [across, up] of points.points)
            assert(up - across > -1e-6 && up - across < 1 / x_hz + 1e-6, `${x_hz} ${y_hz}: ${across} ${up}`);
        const before = points.points.length;
        points.takePairs(x, "scalar", y, "scalar");
        assert.equal(points.points.length, before, "samples are taken twice");
    }
});

test("a pair waits for the signal that is late, and a new run begins anew", () => {
    const [x, y] = [traceOf(100, 0.1, (time_s) => time_s), traceOf(1000, 0.5, (time_s) => time_s)];
    const points = new Points();
    points.takePairs(x, "scalar", y, "scalar");
    assert(points.until_s < 0.11 && points.until_s > 0.09, String(points.until_s));
    const again = traceOf(1000, 0.02, (time_s) => time_s);
    points.takePairs(
        traceOf(1000, 0.02, () => 1),
        "scalar",
        again,
        "scalar",
    );
    assert(points.points.every(([across]) => across === 1));
});

test("a path of a contact is that of the proxy, and is broken where nothing is touched", () => {
    const contact = (time_s) => [time_s < 0.05 ? 0 : 1, 9, 9, 9, time_s, 2 * time_s, 0, 0, 0, 1, 0, 0];
    const points = new Points();
    points.takePlaces(traceOf(1000, 0.1, contact, 12), "contact");
    assert(points.points.some(([x]) => Number.isNaN(x)));
    const touched = points.points.filter(([x]) => Number.isFinite(x));
    assert(touched.length > 8 && touched.every(([x, y]) => Math.abs(y - 2 * x) < 1e-6 && x >= 0.05 - 1e-6));
});

test("axes are round around their values and stay while those fit", () => {
    assert.deepEqual(axisRange([0.3, 9.4]), [0, 10]);
    assert.deepEqual(axisRange([-1.1, 3.9]), [-2, 4]);
    assert.deepEqual(axisRange([2, 2]), [2, 2.5]);
    const before = axisRange([0, 10]);
    assert.equal(axisRange([1, 8], before), before);
    assert.notEqual(axisRange([1, 2], before), before);
    assert.notEqual(axisRange([1, 12], before), before);
    const equal = equalRanges([0, 10], [0, 1], 200, 100);
    assert(Math.abs((equal.x[1] - equal.x[0]) / 200 - (equal.y[1] - equal.y[0]) / 100) < 1e-12);
    assert.equal(equalRanges([1, 9], [0, 1], 200, 100, equal), equal);
    assert.deepEqual([extentOf([NaN, 3, 1]), extentOf([NaN])], [[1, 3], null]);
    assert.deepEqual([isConstant([0, 0]), isConstant([5, 5]), isConstant([0, 1e-9])], [true, true, false]);
});

test("signals of one quantity share a frame over time, fast ones have their own", () => {
    const signal = (name, quantity, rate_hz) => ({ name, quantity, unit: quantity, rate_hz });
    const frames = framesOf([
        signal("a", "force", 1000),
        signal("b", "speed", 1000),
        signal("c", "force", 125),
        signal("d", "force", 10_000),
    ]);
    assert.deepEqual(
        frames.map((frame) => frame.map(({ name }) => name)),
        [["a", "c"], ["b"], ["d"]],
    );
});

const port = (name, quantity = "number", rate_hz = 1000) => ({
    name,
    node: name.split(".")[0],
    quantity,
    rate_hz,
    kind: "scalar",
    unit: "",
});
const WALL = {
    maps: [],
    plots: [{ name: "Force over height", signals: [{ name: "tip.z" }, { name: "spring.output" }] }],
    actuators: [{ name: "push", unit: "N" }],
    pads: [{ channels: ["position"] }],
    ports: [
        port("arm.position", "length"),
        port("tip.z", "length"),
        port("smooth.output", "speed"),
        port("spring.output", "force"),
        port("none.output", "force"),
        port("push.delivered", "force"),
    ],
};

test("a page begins with what is delivered and what the graph names, and with nothing of which no use is known", () => {
    assert.deepEqual(
        firstScopes(WALL).map(({ name, view }) => `${name} ${view}`),
        ["push.delivered time", "push.delivered meter", "arm.position time", "tip.z time", "spring.output time"],
    );
    assert.equal(candidates(WALL).length, WALL.ports.length);
    const only = { ...WALL, plots: [], actuators: [], pads: [], ports: [port("none.output")] };
    assert.deepEqual(firstScopes(only), [{ name: "none.output", view: "time" }]);
});

test("a scope that the page chose and that never moves shows another port, one that a person chose stays", () => {
    const moving = new Set(["spring.output", "tip.z"]);
    const scopes = [
        { name: "push.delivered", isAutomatic: true },
        { name: "push.delivered", isAutomatic: true },
        { name: "smooth.output", isAutomatic: false },
        { name: "arm.position", isAutomatic: true },
    ];
    const moves = (name) => moving.has(name);
    assert.deepEqual(replacements(scopes, WALL, moves), [
        [0, "spring.output", true],
        [1, "spring.output", true],
        [3, "tip.z", true],
    ]);
    assert.deepEqual(
        replacements(scopes, WALL, () => false),
        [],
    );
    assert.deepEqual(replacements([{ name: "smooth.output", isAutomatic: true }], WALL, moves), [[0, "tip.z", false]]);
});

test("what moves has levels that differ; a constant has one", () => {
    const motion = new Motion();
    motion.take({ ports: { constant: [2, 2], tone: [0.7, 1], force: [0, 0] } });
    assert.deepEqual(
        ["constant", "tone", "force", "unknown"].map((name) => motion.moves(name)),
        [false, true, false, false],
    );
    motion.take({ ports: { constant: [2, 2], tone: [0.7, 1], force: [0.5, 0.5] } });
    assert.deepEqual(
        ["constant", "force"].map((name) => motion.moves(name)),
        [false, true],
    );
    motion.restart();
    assert.equal(motion.moves("tone"), false);
});

test("views fill the room, the wanted ones first, and a graph without any shows what moves", () =>
    inTheme(async () => {
        const { roomFor, shownOf, viewsOf } = await import("../page/views.js");
        assert.deepEqual(
            [roomFor(640, 400, 9, false), roomFor(640, 400, 9, true), roomFor(370, 200, 9, false), roomFor(640, 400, 1, false)],
            [4, 1, 1, 1],
        );
        const views = ["a", "b", "c"].map((id) => ({ id }));
        assert.deepEqual(
            shownOf(views, ["c", "gone", "a"], 3).map(({ id }) => id),
            ["c", "a", "b"],
        );
        const graph = {
            ...WALL,
            contacts: [],
            maps: [{ node: "m" }],
            pads: [{ endpoint: "arm", scene: { shapes: [{ form: "plane" }] } }],
        };
        assert.deepEqual(
            viewsOf(graph).map(({ id, form }) => `${id}, ${form}`),
            ["map m, map", "object arm, object", "plot Force over height, undefined"],
        );
        assert.deepEqual(
            viewsOf({ ...graph, maps: [], plots: [], pads: [{ endpoint: "tablet", scene: null }] }).map(({ form }) => form),
            ["moves"],
        );
    }));

test("a scene is seen from the front and from above in one scale, with a larger picture of what is small", () => {
    const ball = { shapes: [{ form: "sphere", centre_mm: [10, 0, 0], diameter_mm: 100 }] };
    const limits = limitsOf(ball, { width_mm: 160, height_mm: 100 });
    assert.deepEqual(limits[0], [-40, 60]);
    const [front, above] = sidesIn(400, 200, limits);
    assert.equal(front.scale, above.scale);
    const [x, z] = front.at([10, 7, 50]);
    const [, y] = above.at([10, 7, 50]);
    assert(Math.abs(x - (front.box.left + front.box.width / 2)) < 1e-9);
    assert(z > front.box.top && z < front.at([10, 7, 0])[1] && y < above.at([10, 0, 50])[1]);
    const close = closeUp(front, [10, 7, 50]);
    assert(close.times > 2);
    assert.deepEqual(close.at([10, 0, 50]), [close.box.left + close.box.width / 2, close.box.top + close.box.height / 2]);
    assert.equal(closeUp({ ...front, scale: 1000 }, [0, 0, 0]), null);
    const floor = { shapes: [{ form: "plane", origin_mm: [0, 0, -5], normal: [0, 0, 1] }] };
    assert.deepEqual(limitsOf(floor, { width_mm: 160, height_mm: 100 })[0], [-80, 80]);
});

test("a point is extrapolated where a model beyond what was recorded takes part", () => {
    const map = {
        points: [
            [0, 0],
            [0, 1],
            [1, 0],
            [1, 1],
            [3, 1],
            [3, 0],
        ],
        kinds: ["edge", "edge", "edge", "fitted", "edge", "edge"],
        triangles: [
            [0, 2, 3],
            [0, 3, 1],
            [2, 5, 4],
            [2, 4, 3],
        ],
    };
    const at = (speed, force) => isExtrapolated(map, locate(map, speed, force));
    assert.deepEqual([at(0.5, 0.5), at(0.1, 0.9), at(2, 0.9), at(9, 0.5)], [false, false, true, true]);
    const trail = (speed, count) => Array.from({ length: count }, () => ({ speed, force: 0.1 }));
    assert.deepEqual(
        [axesFor(map, []), axesFor(map, trail(1.2, 9)), axesFor(map, trail(9, 9))],
        [
            [1, 1],
            [1.5, 1],
            [3, 1],
        ],
    );
    assert.deepEqual(axesFor(map, trail(9, 2)), [1, 1], "an impact widens the axes");
});

// The last report of a player whose sound, in blocks of 10 ms, arrives `delay_ms` after it was sent.
async function played(span_s, delay_ms) {
    const rate_hz = 48_000;
    const Player = await playerOf(rate_hz);
    const player = new Player({ processorOptions: { rate_hz } });
    let reported;
    player.port.postMessage = (report) => (reported = report);
    const sent = new Float32Array(rate_hz / 100).fill(0.5);
    const out = [[new Float32Array(128)]];
    for (let frame = 0, next = 0; frame < span_s * rate_hz; frame += out[0][0].length) {
        for (const now_ms = (1000 * frame) / rate_hz; 10 * next + delay_ms(10 * next) <= now_ms; next++) player.take(sent);
        player.process(null, out);
    }
    return reported;
}

let player;
async function playerOf(rate_hz) {
    globalThis.AudioWorkletProcessor = class {
        port = {};
    };
    Object.assign(globalThis, { registerProcessor: (_, kind) => (player = kind), sampleRate: rate_hz });
    await import("../page/worklet.js");
    return player;
}

test("sound that comes evenly is soon played with little delay, and without a gap", async () => {
    const { underruns, target_s } = await played(400, (sent_ms) => (sent_ms * 7) % 4);
    assert.equal(underruns, 0);
    assert(target_s < 0.025, `${target_s}`);
});

test("a delay that comes again and again is not heard again and again", async () => {
    for (const late_ms of [30, 60]) {
        const { underruns } = await played(600, (sent_ms) => (sent_ms % 37_000 > 36_990 - late_ms ? 36_990 - (sent_ms % 37_000) : 0));
        assert(underruns <= (late_ms > 40 ? 3 : 0), `${underruns} gaps by delays of ${late_ms} ms`);
    }
});

test("what opens a download elsewhere is a line of a shell", () => {
    assert.equal(commandOf({ graph: "graphs/mine.ron", set: [] }), "haptograph studio graphs/mine.ron");
    const set = [["surface", '"it\'s.ron"']];
    assert.equal(commandOf({ graph: "g.ron", set }), `haptograph studio g.ron --set 'surface="it'\\''s.ron"'`);
});
