// Records hands and settings from the first frame of a new run, and replays them.
import { find, make, save, setText } from "./dom.js";
import { everyFrame } from "./frame.js";
import { reportLink } from "./surfaces.js";

export function mountRecorder(studio) {
    const [record, replay, keep] = ["record", "replay", "keep"].map(find);
    let recording = null;
    let replayed = null; // what the replay that goes on is
    let was = null; // its part
    let shown = 0; // the moves that the pad has shown
    const { hands } = studio.pad;
    everyFrame(() => {
        if (was !== null && replayed) shown = showMoves(hands, recording, shown, studio.taps.now_s());
    });
    const use = (taken) => {
        recording = taken;
        replay.hidden = keep.hidden = false;
    };
    record.addEventListener("click", () => studio.connection.send({ type: "record", on: studio.status?.recording_s === null }));
    replay.addEventListener("click", async () => {
        const reply = await studio.connection.request({ type: "replay", recording });
        replayed = reply.ok ? reply.change : null;
        shown = 0;
        if (!reply.ok) studio.say("bad", reply.error);
    });
    keep.addEventListener("click", () => download(recording));
    studio.connection.on("recording", (message) => {
        use(message.recording);
        const where = message.saved ? `in ${message.saved}` : "press Keep to download it";
        find("recording-report").replaceChildren(...(message.report ? [reportLink(message.report)] : []));
        studio.say(message.error ? "bad" : "good", message.error ?? `${message.seconds.toFixed(1)} s were recorded: ${where}`);
    });
    studio.loadRecording = use;
    studio.on("graph", () => (find("recorded").hidden = true));
    studio.on("status", ({ recording_s, recorded, replay: part, state }) => {
        if (recording_s !== null && recorded.length) {
            find("recorded").hidden = false;
            setText(find("recorded"), recorded.join("\n"));
        }
        // Where a STOP came first, it did not end.
        if (was !== null && part === null && replayed && state === "running") studio.say("good", `Replayed: ${replayed}`);
        if (part === null && was !== null) {
            hands.hide("replay");
            replayed = null;
        }
        was = part;
        record.setAttribute("aria-pressed", String(recording_s !== null));
        setText(record, recording_s === null ? "Record" : `End ${recording_s.toFixed(1)} s`);
        const cannot = studio.hello?.can.record === false;
        const stopped = state !== "running";
        for (const button of [record, replay]) button.title = stopped ? "The run is stopped: resume it first" : "";
        record.disabled = cannot || stopped || part !== null;
        replay.disabled = cannot || stopped || recording_s !== null || part !== null;
        setText(replay, part === null ? "Replay" : `${Math.round(100 * part)} %`);
    });
}

// Shows the moves that are due at a time of the run, and the next ones when they are; how many that are.
function showMoves(hands, { moves }, from, now_s) {
    const AHEAD_S = 0.1;
    let to = from;
    const [page_ms, tilts] = [performance.now() - 1000 * now_s, [0, 0]];
    for (; to < moves.length && moves[to][2] * 1e-6 < now_s + AHEAD_S; to++) {
        const [, number, due_us, [x_nm, y_nm], force_un, [right, towards] = tilts] = moves[to];
        const at = { x_mm: x_nm * 1e-6, y_mm: y_nm * 1e-6, tilt_x_deg: right * 1e-6, tilt_y_deg: towards * 1e-6 };
        hands.show("replay", number, [{ ...at, force_n: force_un * 1e-6, time_ms: page_ms + due_us * 1e-3 }]);
    }
    return to;
}

function download(recording) {
    save(`${recording.graph}-strokes.json`, new Blob([JSON.stringify(recording)], { type: "application/json" }));
}
