#!/usr/bin/env python3
"""What a binary answers and writes: samples, reports, JSON, help, errors, surfaces, data sets. For changes that must change nothing.

    python3 tests/goldens.py target/release/haptograph OUT [--only PART]     runs every case and keeps what came out
    python3 tests/goldens.py --compare OUT_A OUT_B                           says what differs; exit code 1 if anything does

Run both binaries on one machine: samples are compared bit for bit. Times, paths of folders and versions are masked.
"""
import glob, json, os, re, shutil, subprocess, sys, tempfile

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
GRAPHS = sorted(glob.glob("graphs/*.ron", root_dir=ROOT)) + sorted(glob.glob("graphs/cookbook/*.ron", root_dir=ROOT))
WRONG = sorted(glob.glob("engine/tests/wrong/*.ron", root_dir=ROOT)) + sorted(glob.glob("nodes/tests/wrong/*.ron", root_dir=ROOT))
# Inputs of the cases, copied beside them so that both binaries read the same.
DATA = ["graphs", "engine/tests/wrong", "engine/tests/right", "nodes/tests/wrong", "examples/data", "docs/cookbook.md"]
# What no two runs have in common: durations, dates, process numbers.
MASKED = [
    (r'"(took_s|elapsed_s|wall_s|render_s|seconds_taken|started|finished|date|version|host|processor)": *("[^"]*"|[-+.e0-9]+)', r'"\1": MASKED'),
    (r'"real_time_factor": *[-+.e0-9]+', '"real_time_factor": MASKED'),
    (r'"([0-9/]*(?:report.html|run.json)|sweep.json|index.html)": *"[0-9a-f]{64}"', r'"\1": MASKED'),
    (r"<dt>(Time taken \(s\)|Times faster than real time)</dt><dd>[^<]*</dd>", r"<dt>\1</dt><dd>MASKED</dd>"),
    (r"\bin [0-9.]+ (ms|s|us)\b", "in MASKED"),
    (r"\b[0-9.,]+ (times|x) (faster than )?real time\b", "MASKED real time"),
    (r"\b20[0-9][0-9]-[01][0-9]-[0-3][0-9][ T][0-9:.]+Z?", "MASKED"),
]
BATCH = """Batch(surfaces: ["graphs/surfaces/t1-*.ron", "graphs/surfaces/t2-canvas.ron"],
    motions: { "walk": RandomWalk(seconds: 0.5, speed_mm_s: (5, 170), force_n: (0.1, 2.8)) },
    jobs: Product(seeds: (1, 4)), jobs_per_chunk: 2)"""


def cases():
    """(part, name, list of argument lists). The cases of a part share a folder, in order."""
    for graph in GRAPHS:
        name = graph.replace("/", "_")[:-4]
        yield "graphs", f"run {name}", [["run", graph, "--for", "3", "--out", f"out/{name}", "--json"]]
        yield "check", f"check {name}", [["check", graph, "--plan"], ["check", graph, "--json"], ["check", graph, "--endpoints", "live"]]
        yield "draw", f"draw {name}", [["draw", graph, "-o", f"{name}.{form}"] for form in ("svg", "dot", "mmd")]
    yield "graphs", "run with settings", [
        ["run", "graphs/texturepad.ron", "--for", "1", "--block", "7", "--seed", "9", "--out", "out/seven", "--probe", "speed.speed=speed.csv"],
        ["run", "graphs/omni.ron", "--for", "1", "--set", "texture=0", "--out", "out/omni-0"],
        ["run", "graphs/texturepad.ron", "--for", "1", "--set", "surface=graphs/surfaces/t3-tile.ron", "--out", "out/tile"],
        ["sweep", "graphs/ar-pen.ron", "--for", "1", "--over", "mu=0.2,0.4", "--out", "out/sweep"],
        ["run", "graphs/texturepad.ron", "--set", "nothing=1"],
        ["run", "graphs/none.ron"],
    ]
    for wrong in WRONG:
        yield "errors", wrong, [["check", wrong], ["check", wrong, "--json"]]
    commands = ["run", "check", "studio", "recover", "sweep", "batch", "batch merge", "batch wav", "bench", "identify", "draw", "nodes", "new",
                "simulate-recording", "convert-recording", "devices", "doctor", "learn", "segment", "surface", "surface show", "surface convert",
                "surface resample", "surface select", "surface interpolate", "surface leave-one-out", "surface image", "compare", "export", "evaluate",
                "evaluate merge", "lsp", "completions", "man"]
    yield "help", "help", [["--help"]] + [[*command.split(), "--help"] for command in commands]
    yield "help", "reference", [["nodes"], ["nodes", "--json"], ["nodes", "--markdown"], ["nodes", "LowPass"], ["nodes", "--find", "envelope"],
                                ["nodes", "Tapping", "--json"], ["completions", "bash"], ["man", "--out", "man1"], ["new", "mine.ron"], ["new", "mine.ron"],
                                ["devices", "--formats"], ["nodes", "LowPas"], ["rum"]]
    yield "learning", "recordings", [
        ["simulate-recording", "--material", "T2", "--motion", "drag", "-o", "recordings/canvas.a.1.npz"],
        ["simulate-recording", "--material", "T2", "--motion", "drag", "--seed", "2", "-o", "recordings/canvas.b.1.csv"],
        ["simulate-recording", "--material", "T3", "--motion", "drag", "-o", "recordings/tile.a.1.npz"],
        ["simulate-recording", "--material", "T3", "--motion", "circle", "-o", "circle.csv"],
        ["simulate-recording", "--material", "T3", "--motion", "tap", "-o", "taps.csv"],
        ["convert-recording", "recordings/canvas.a.1.npz", "Accel_canvas.xml"],
        ["convert-recording", "recordings/canvas.a.1.npz", "canvas.csv"],
        ["simulate-recording", "--material", "T2", "--motion", "drag", "--seed", "3", "-o", "recordings/canvas.a.2.npz"],
        ["simulate-recording", "--material", "T3", "--motion", "drag", "--seed", "4", "-o", "recordings/tile.a.2.npz"],
        ["segment", "recordings/canvas.b.1.csv", "--column", "accel_x_m_s2"],
        ["segment", "recordings/canvas.b.1.csv", "--column", "force_z_n", "--json"],
    ]
    for method in (["law"], ["thesis"], ["thesis", "--fit", "burg", "--variance", "burg"]):
        name = "-".join(method)
        yield "learning", f"learn {name}", [["learn", "recordings/canvas.a.1.npz", "-o", f"{name}.ron", "--method", *method, "--json"]]
    yield "learning", "learn", [
        ["learn", "examples/data/t3-tile-drag-simulated.csv", "-o", "tile.ron", "--report", "out/tile"],
        ["learn", "recordings/tile.a.1.npz", "--circle", "circle.csv", "--tap", "taps.csv", "-o", "tile-all.ron", "--json"],
        ["learn", "recordings", "-o", "surfaces"], ["learn", "recordings", "-o", "surfaces"], ["learn", "nowhere.csv", "-o", "x.ron"],
    ]
    yield "learning", "evaluate", [
        ["evaluate", "recordings", "--json"], ["evaluate", "recordings", "--report", "out/evaluation"], ["evaluate", "recordings", "--holdout", "--json"],
        ["evaluate", "recordings", "--shard", "1/2", "-o", "parts/1.ron"], ["evaluate", "recordings", "--shard", "2/2", "-o", "parts/2.ron"],
        ["evaluate", "merge", "parts/1.ron", "parts/2.ron"], ["compare", "recordings/canvas.a.1.npz", "recordings/tile.a.1.npz", "--json"],
        ["compare", "graphs/sounds/canvas-simulated.wav", "graphs/sounds/canvas-simulated.wav"],
    ]
    yield "learning", "surfaces", [
        ["surface", "show", "graphs/surfaces/t2-canvas.ron"], ["surface", "show", "graphs/surfaces/t2-canvas.ron", "--json"], ["surface", "show", "tile-all.ron"],
        ["surface", "convert", "thesis.ron", "thesis.xml"], ["surface", "convert", "thesis.xml", "again.ron"],
        ["surface", "convert", "tile-all.ron", "tile.xml"], ["surface", "interpolate", "--help"], ["surface", "resample", "graphs/surfaces/t3-tile.ron", "--rate", "1000", "--method", "zoh", "-o", "tile.1k.ron"],
        ["surface", "resample", "tile-all.ron", "--rate", "2000", "--method", "spectral", "-o", "tile.2k.ron"],
        ["surface", "select", "graphs/surfaces", "--count", "3"], ["surface", "select", "graphs/surfaces", "--count", "3", "--json"],
        ["surface", "show", "recordings/canvas.a.1.npz"], ["surface", "show", "graphs/omni.ron"],
    ]
    yield "batch", "batch", [
        ["batch", "plan.ron", "-o", "whole", "--json"], ["batch", "plan.ron", "-o", "part-1", "--shard", "1/2"], ["batch", "plan.ron", "-o", "part-2", "--shard", "2/2"],
        ["batch", "merge", "part-1", "part-2", "-o", "merged", "--json"], ["batch", "wav", "plan.ron", "0", "3", "-o", "heard"], ["batch", "plan.ron", "-o", "whole"],
        ["batch", "merge", "part-1", "-o", "half"],
    ]
    yield "identify", "identify", [
        ["run", "graphs/identify.ron", "--out", "out/identify"],
        ["identify", "out/identify/sweep.csv", "--magnet-g", "6", "--force-n-per-a", "2.9", "--report", "out/actuator", "--json"],
        ["identify", "out/identify/sweep.csv", "--magnet-g", "6", "--force-n-per-a", "2.9"],
    ]
    yield "lsp", "lsp", [["lsp"]]


def lsp_session():
    """Opens a right and a wrong graph; asks for completions and hovers on every seventh place of each."""
    messages = [{"id": 0, "method": "initialize", "params": {"capabilities": {}}}, {"method": "initialized", "params": {}}]
    number = 1
    for path in ("graphs/texturepad.ron", "engine/tests/wrong/names_without_quotes.ron"):
        text = open(os.path.join(ROOT, path)).read()
        document = {"uri": f"file:///nowhere/{os.path.basename(path)}"}
        messages.append({"method": "textDocument/didOpen", "params": {"textDocument": {**document, "languageId": "ron", "version": 1, "text": text}}})
        for line, row in enumerate(text.split("\n")):
            for column in range(0, len(row), 7):
                at = {"textDocument": document, "position": {"line": line, "character": column}}
                for method in ("completion", "hover"):
                    messages.append({"id": number, "method": f"textDocument/{method}", "params": at})
                    number += 1
    messages += [{"id": number, "method": "shutdown"}, {"method": "exit"}]
    bodies = [json.dumps({"jsonrpc": "2.0", **message}) for message in messages]
    return "".join(f"Content-Length: {len(body.encode())}\r\n\r\n{body}" for body in bodies).encode()


def masked(data, folder):
    try:
        text = data.decode()
    except UnicodeDecodeError:
        return data
    text = text.replace(folder, "FOLDER")
    for pattern, by in MASKED:
        text = re.sub(pattern, by, text)
    return text.encode()


def record(binary, out, only):
    binary = os.path.abspath(binary)
    # The text of its path is masked in what came out; its length is always the same.
    work = tempfile.mkdtemp(prefix="goldens-")
    shutil.rmtree(out, ignore_errors=True)
    fresh = None
    for part, name, calls in cases():
        if only and part != only:
            continue
        if part != fresh:
            keep_files(work, fresh, out)
            shutil.rmtree(work)
            os.makedirs(work)
            for path in DATA:
                place = os.path.join(work, path)
                os.makedirs(os.path.dirname(place), exist_ok=True)
                (shutil.copytree if os.path.isdir(os.path.join(ROOT, path)) else shutil.copy)(os.path.join(ROOT, path), place)
            os.makedirs(f"{work}/recordings"), os.makedirs(f"{work}/parts")
            with open(f"{work}/plan.ron", "w") as plan:
                plan.write(BATCH)
            fresh = part
        for index, call in enumerate(calls):
            given = lsp_session() if call == ["lsp"] else b""
            environment = {**os.environ, "NO_COLOR": "1", "COLUMNS": "100", "SOURCE_DATE_EPOCH": "0"}
            done = subprocess.run([binary, *call], cwd=work, input=given, capture_output=True, timeout=600, env=environment)
            place = os.path.join(out, part, "said", name.replace("/", "_").replace(" ", "_"))
            os.makedirs(place, exist_ok=True)
            said = f"$ {' '.join(call)}\nexit code {done.returncode}\n--- stderr\n".encode() + masked(done.stderr, work) + b"--- stdout\n" + masked(done.stdout, work)
            open(f"{place}/{index:02}", "wb").write(said)
    keep_files(work, fresh, out)
    shutil.rmtree(work, ignore_errors=True)


def keep_files(work, part, out):
    """Everything the part's commands wrote, masked."""
    if part is None:
        return
    given = {os.path.join(work, path) for path in DATA}
    for folder, _, files in os.walk(work):
        for file in files:
            path = os.path.join(folder, file)
            if any(path == data or path.startswith(data + "/") for data in given):
                continue
            place = os.path.join(out, part, "files", os.path.relpath(path, work))
            os.makedirs(os.path.dirname(place), exist_ok=True)
            open(place, "wb").write(masked(open(path, "rb").read(), work))


def compare(a, b):
    listed = [{os.path.relpath(os.path.join(folder, file), out) for folder, _, files in os.walk(out) for file in files} for out in (a, b)]
    different = [f"only in {a}: {path}" for path in listed[0] - listed[1]] + [f"only in {b}: {path}" for path in listed[1] - listed[0]]
    different += [f"differs: {path}" for path in listed[0] & listed[1]
                  if open(os.path.join(a, path), "rb").read() != open(os.path.join(b, path), "rb").read()]
    print("\n".join(sorted(different)))
    print(f"{len(listed[0] | listed[1])} outputs, {len(different)} differ")
    return 1 if different else 0


if __name__ == "__main__":
    arguments = sys.argv[1:]
    if arguments[:1] == ["--compare"] and len(arguments) == 3:
        sys.exit(compare(*arguments[1:]))
    only = None
    if "--only" in arguments:
        place = arguments.index("--only")
        only = arguments[place + 1]
        del arguments[place:place + 2]
    if len(arguments) != 2:
        sys.exit(__doc__)
    record(*arguments, only)
