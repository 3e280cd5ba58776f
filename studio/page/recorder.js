// Records hands and settings from the first frame of a new run, and replays them.
import { find, make, save, setText } from "./dom.js";
import { reportLink } from "./surfaces.js";

export function mountRecorder(studio) {
    const [record, replay, keep] = ["record", "replay", "keep"].map(find);
    let recording = null;
    let replayed = null; // what the replay that goes on is
    let was = null; // its part
    const use = (taken) => {
        recording = taken;
        replay.hidden = keep.hidden = false;
    };
    record.addEventListener("click", () => studio.connection.send({ type: "record", on: studio.status?.recording_s === null }));
    replay.addEventListener("click", async () => {
        const reply = await studio.connection.request({ type: "replay", recording });
        replayed = reply.ok ? reply.change : null;
        studio.say(reply.ok ? "good" : "bad", reply.ok ? `Replaying: ${reply.change}` : reply.error);
    });
    keep.addEventListener("click", () => download(recording));
    studio.connection.on("recording", (message) => {
        use(message.recording);
        const where = message.saved ? `in ${message.saved}` : "press Keep to download it";
        find("recording-report").replaceChildren(...(message.report ? [reportLink(message.report)] : []));
        studio.say(message.error ? "bad" : "good", message.error ?? `${message.seconds.toFixed(1)} s were recorded: ${where}`);
    });
    studio.loadRecording = use;
    studio.on("status", ({ recording_s, replay: part, state }) => {
        // Where a STOP came first, it did not end.
        if (was !== null && part === null && replayed && state === "running") studio.say("good", `Replayed: ${replayed}`);
        if (part === null && was !== null) replayed = null;
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

function download(recording) {
    save(`${recording.graph}-strokes.json`, new Blob([JSON.stringify(recording)], { type: "application/json" }));
}
