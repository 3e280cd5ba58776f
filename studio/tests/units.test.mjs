// What of the page needs no browser: node --test
import assert from "node:assert/strict";
import test from "node:test";
import { drivenOf } from "../page/arming.js";
import { scaleFor } from "../page/control.js";
import { density } from "../page/fft.js";
import { pointers, read } from "../page/frames.js";
import { tiltOf } from "../page/hands.js";
import { Levels } from "../page/levels.js";
import { digits, quantity, roundUp, ticks, tickText } from "../page/numbers.js";
import { simulatedAlone } from "../page/pads.js";
import { placeOf } from "../page/ron.js";
import { Trace } from "../page/trace.js";

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

test("tilt is what the browser says, by either way of saying it", () => {
    assert.deepEqual(tiltOf({ tiltX: 30, tiltY: -10 }), { tilt_x_deg: 30, tilt_y_deg: -10 });
    assert.deepEqual(tiltOf({}), { tilt_x_deg: 0, tilt_y_deg: 0 });
    const tilted = (degrees, azimuth) => {
        const { tilt_x_deg, tilt_y_deg } = tiltOf({ altitudeAngle: ((90 - degrees) * Math.PI) / 180, azimuthAngle: azimuth });
        return [tilt_x_deg, tilt_y_deg].map((tilt) => Math.round(tilt * 1e6) / 1e6);
    };
    assert.deepEqual([tilted(0, 1), tilted(30, 0), tilted(30, Math.PI / 2)], [[0, 0], [30, 0], [0, 30]]);
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

test("endpoints that no pointer can be are named, with what a pad does not give them", () => {
    const others = [
        { endpoint: "tool", lacks: ["acceleration"] },
        { endpoint: "probe", lacks: [] },
    ];
    assert.deepEqual(simulatedAlone({ others }), [
        "tool stays simulated: a pad gives no acceleration.",
        "probe stays simulated: what it touches is not known.",
    ]);
    assert.deepEqual(simulatedAlone(null), []);
    const devices = [{ name: "probe", simulated: false }];
    assert.deepEqual(simulatedAlone({ others: others.slice(1), devices }), ["probe is real: a hand moves it, not a pointer."]);
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
