//! What holds for every shipped graph: it loads, its ticks are fit for real time, and it can run for hours.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]
#![expect(clippy::print_stdout, reason = "the figures of a long test are to be read")]
#![expect(unsafe_code, reason = "an allocator that counts can only be written so")]

mod realtime;

use haptograph_engine::diagnostic::Diagnostics;
use haptograph_engine::document::{Document, LoadOptions};
use haptograph_engine::graph::{CheckOptions, Graph, NodeId, check};
use haptograph_engine::plan::{Plan, PlanOptions};
use haptograph_engine::run::{
    Change, FileSinks, NoCrossFade, Run, Session, SessionOptions, VirtualClock, player,
};
use haptograph_surfaces::{Grain, ModelAt, SpatialLine, Surface, files, resampling};
use realtime::allocations;
use std::path::{Path, PathBuf};
use std::sync::Arc;

fn shipped() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs");
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "ron"))
        .collect();
    files.sort();
    assert!(!files.is_empty());
    files
}

fn graph(path: &Path) -> Graph {
    graph_with(path, &CheckOptions::default()).unwrap_or_else(|wrong| panic!("{wrong}"))
}

fn graph_with(path: &Path, options: &CheckOptions) -> Result<Graph, Diagnostics> {
    let document = Document::load(path, &LoadOptions::default()).unwrap_or_else(|wrong| panic!("{wrong}"));
    check(&document, &haptograph_nodes::registry(), options)
}

/// Of another surface where it has one, which leaves its devices as they are; else from another seed.
fn another_graph(path: &Path) -> Graph {
    let surface = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/surfaces/t5-vinyl.ron");
    let surface = CheckOptions::default().set("surface", surface.display().to_string());
    let seed = CheckOptions::default().seed(1);
    graph_with(path, &surface).or_else(|_| graph_with(path, &seed)).unwrap_or_else(|wrong| panic!("{wrong}"))
}

/// All outputs.
fn outputs(graph: &Graph) -> Vec<(NodeId, usize)> {
    let outputs = |node: NodeId| (0..graph.nodes()[node].outputs.len()).map(move |output| (node, output));
    graph.nodes().ids().flat_map(outputs).collect()
}

/// Of every driver, with every output tapped.
fn plans(graph: &Graph, block: usize) -> Vec<Arc<Plan>> {
    let taps = outputs(graph);
    let plans = Plan::of(graph, &PlanOptions::default().block(block).taps(taps));
    plans.into_iter().map(Arc::new).collect()
}

/// A tip that wanders through the origin, and a node that it touches.
fn touching(folder: &Path, touch: &str) -> Result<Graph, Diagnostics> {
    let text = format!(
        r#"Graph(format: 1, clocks: {{ "servo": Driver(rate_hz: 1000) }}, parameters: {{ "is_room": true }}, nodes: {{
            "x": Sine(clock: "servo", frequency_hz: 3, amplitude: 0.06, quantity: "length"),
            "y": Sine(clock: "servo", frequency_hz: 5, amplitude: 0.06, quantity: "length"),
            "z": Sine(clock: "servo", frequency_hz: 7, amplitude: 0.06, quantity: "length"),
            "at": Pack(x: "x", y: "y", z: "z"),
            "touch": {touch},
        }})"#
    );
    let path = folder.join("touching.ron");
    std::fs::write(&path, text).unwrap();
    graph_with(&path, &CheckOptions::default())
}

/// Samples of the contact over half a second.
fn contacts(folder: &Path, touch: &str) -> Vec<f64> {
    let graph = touching(folder, touch).unwrap_or_else(|wrong| panic!("{wrong}"));
    let taps = outputs(&graph);
    let at = taps.iter().position(|(node, output)| graph.nodes()[*node].path == "touch" && *output == 0);
    let (at, mut samples) = (at.unwrap(), Vec::new());
    let mut clock = VirtualClock::of(&plans(&graph, 50));
    while samples.len() < 12 * 500 {
        clock.run_quantum(|_, run| samples.extend_from_slice(run.tap(at)));
    }
    samples
}

/// A folder with a mesh.
fn with_a_mesh() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let wedge = "solid wedge\nfacet normal 0 0 1\nouter loop\nvertex -50 -50 0\nvertex 50 -50 0\nvertex 0 50 0\n\
                 endloop\nendfacet\nendsolid wedge\n";
    std::fs::write(folder.path().join("wedge.stl"), wedge).unwrap();
    folder
}

#[test]
fn former_names_of_contacts_give_the_same_samples() {
    let folder = with_a_mesh();
    for (former, now) in [
        (
            "ContactPlane(position: \"at\", normal: [0, 1, 1])",
            "Contact(position: \"at\", solids: Plane(normal: [0, 1, 1]), proxy_diameter_mm: 0)",
        ),
        (
            "ContactPlane(position: \"at\", proxy_diameter_mm: 3.2)",
            "Contact(position: \"at\", solids: [Plane()])",
        ),
        (
            "ContactSphere(position: \"at\", diameter_mm: 80)",
            "Contact(position: \"at\", solids: Sphere(diameter_mm: 80))",
        ),
        (
            "ContactBox(position: \"at\", size_mm: [90, 90, 50])",
            "Contact(position: \"at\", solids: Box(size_mm: [90, 90, 50]))",
        ),
        (
            "ContactBox(position: \"at\", size_mm: [90, 90, 50], inside: Param(\"is_room\"))",
            "Contact(position: \"at\", solids: [Room(size_mm: [90, 90, 50])])",
        ),
        (
            "ContactMesh(position: \"at\", file: \"wedge.stl\")",
            "Contact(position: \"at\", solids: Mesh(file: \"wedge.stl\"), proxy_diameter_mm: 0)",
        ),
        (
            "ContactScene(position: \"at\", solids: [Plane(), Sphere()])",
            "Contact(position: \"at\", solids: [Plane(), Sphere()])",
        ),
    ] {
        let samples = contacts(folder.path(), former);
        assert!(samples.iter().step_by(12).any(|touching| *touching == 1.0), "{former}");
        let bits = |samples: Vec<f64>| samples.into_iter().map(f64::to_bits).collect::<Vec<_>>();
        assert_eq!(bits(samples), bits(contacts(folder.path(), now)), "{former}");
    }
}

#[test]
fn what_is_wrong_in_a_former_contact_is_said_where_it_stands() {
    let folder = with_a_mesh();
    for (former, code, place) in [
        ("ContactPlane(position: \"at\", normal: [0, 0, 0])", "E0304", "[0, 0, 0]"),
        ("ContactPlane(position: \"at\", norml: [0, 0, 1])", "E0204", "norml"),
        ("ContactSphere(position: \"at\", diameter_mm: -1)", "E0302", "-1"),
        ("ContactSphere(diameter_mm: 5)", "E0401", "ContactSphere"),
        ("ContactBox(position: \"at\")", "E0205", "ContactBox"),
        ("ContactBox(position: \"at\", size_mm: [1, 1, 1], inside: 3)", "E0301", "3"),
        ("ContactBox(position: \"at\", size_mm: Param(\"no\"))", "E0209", "Param(\"no\")"),
        ("ContactMesh(position: \"at\", file: \"wedge.step\")", "E0304", "\"wedge.step\""),
        ("ContactScene(position: \"at\", solids: [])", "E0304", "[]"),
        ("Contact(position: \"at\", solids: [Plane(), Box(size_mm: [0, 1, 1])])", "E0304", "[0, 1, 1]"),
    ] {
        let wrong = touching(folder.path(), former).err().unwrap();
        let span = wrong.list[0].primary.as_ref().unwrap().span;
        let text = &wrong.sources.get(span.source).unwrap().text[span.start..span.end];
        let found: Vec<&str> = wrong.list.iter().map(|one| one.code).collect();
        assert_eq!((&found[..], text), (&[code][..], place), "{former}: {wrong}");
    }
}

/// What an edit from afar must not touch is the limit of an actuator, not any setting of that name.
#[test]
fn only_limits_of_actuators_are_safety() {
    let text = r#"Graph(format: 1, clocks: { "servo": Driver(rate_hz: 1000) },
        parameters: { "soft": 1.0, "hard": 0.5 },
        nodes: {
            "tone": Sine(clock: "servo", frequency_hz: 3, quantity: "current"),
            "clip": SoftClip(input: "tone", limit: Param("soft")),
            "out": ActuatorSink(current: "clip", endpoint: "coil", limit: (peak_a: Param("hard"), continuous_a: 0.25)),
        },
        endpoints: { "simulated": { "coil": SimulatedHaptuator() } })"#;
    let document = Document::parse("limits.ron", text).unwrap_or_else(|wrong| panic!("{wrong}"));
    let registry = haptograph_nodes::registry();
    let found = document.dependent_safety(&registry);
    let texts: Vec<&str> = found.values().map(String::as_str).collect();
    assert_eq!(texts, ["Param(\"hard\")"], "{found:?}");
}

#[test]
fn no_tick_of_a_shipped_graph_allocates() {
    for path in shipped() {
        let graph = graph(&path);
        for block in [1, 64, 1024] {
            let plans = plans(&graph, block);
            // Each driver by itself, in whole blocks, and all of them joined by their rings.
            for plan in &plans {
                let mut run = Run::new(Arc::clone(plan));
                for _ in 0..(20_000 / block).max(20) {
                    assert_eq!(allocations(|| run.advance(block)), 0, "{}", path.display());
                }
            }
            let mut clock = VirtualClock::of(&plans);
            for _ in 0..400 {
                let allocated = allocations(|| clock.run_quantum(|_, _| {}));
                assert_eq!(allocated, 0, "{}", path.display());
            }
            assert!(clock.rings().iter().all(|ring| ring.counts().fill_s.is_some()));
        }
    }
}

/// As every signal stays a number within what a body can do, and no tick allocates, nothing grows.
#[test]
#[ignore = "an hour of each graph's time: minutes"]
fn every_graph_runs_for_an_hour_without_a_fault() {
    for path in shipped() {
        let graph = graph(&path);
        let plans = plans(&graph, 1024);
        let mut clock = VirtualClock::of(&plans).ending_after(3600.0);
        let mut largest: Vec<Vec<f64>> =
            plans.iter().map(|plan| vec![0.0; plan.tap_streams().count()]).collect();
        let mut first_minute = Vec::new();
        while !clock.is_over() {
            clock.run_quantum(|driver, run| {
                for (tap, largest) in largest[driver].iter_mut().enumerate() {
                    for x in run.tap(tap) {
                        assert!(x.is_finite(), "{}: tap {tap}", path.display());
                        *largest = largest.max(x.abs());
                    }
                }
            });
            let first = clock.runs().next().unwrap();
            if first_minute.is_empty() && first.driver_frames() as f64 > 60.0 * first.rate_hz() {
                first_minute.clone_from(&largest);
            }
        }
        for run in clock.runs() {
            assert_eq!(run.faults().ticks, 0, "{}", path.display());
        }
        for ring in clock.rings() {
            let counts = ring.counts();
            let troubles = (counts.underruns, counts.overruns, counts.lost_frames);
            assert_eq!(troubles, (0, 0, 0), "{}: {ring:?}", path.display());
        }
        println!("{}: largest values after a minute and after an hour:", path.display());
        for (minute, hour) in first_minute.iter().flatten().zip(largest.iter().flatten()) {
            println!("  {minute:12.6} {hour:12.6}");
        }
    }
}

/// A cross-fade, or, where simulated devices become others, zero between.
#[test]
fn no_callback_of_a_swap_allocates() {
    let mut faded = 0;
    for path in shipped() {
        let graphs = [graph(&path), another_graph(&path)];
        if graphs[0].drivers().len() > 1 {
            continue;
        }
        let next = || Arc::clone(&plans(&graphs[1], 64)[0]);
        let (mut live, mut control) = player(Arc::clone(&plans(&graphs[0], 64)[0]));
        live.process(1000);
        let change = control.swap(next()).unwrap();
        // All of the fade, and a swap to the same graph in the middle of it, which waits.
        assert_eq!(control.swap(next()), Ok(Change::Settings(0)));
        for _ in 0..40 {
            let allocated = allocations(|| live.process(64));
            assert_eq!(allocated, 0, "{}", path.display());
        }
        control.poll();
        assert_eq!(control.freed(), 2, "{} {change:?}", path.display());
        faded += usize::from(change == Change::CrossFade);
    }
    assert!(faded >= 3, "{faded} graphs faded into another");
}

/// Surfaces of every kind and rate: as shipped; with grain and a line; the thesis's at a lower rate, and with a line.
fn surfaces_of_every_kind(folder: &Path) -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let canvas = root.join("graphs/surfaces/t2-canvas.ron");
    let with_structure = |surface: &Surface| {
        let mut surface = surface.clone();
        surface.texture = surface.texture.map(|texture| {
            let rests = |at: &ModelAt| at.speed_m_s == 0.0 || at.force_n == 0.0;
            let powers = texture.models().iter().map(|at| if rests(at) { 0.0 } else { 0.5 });
            let line = SpatialLine::new(900.0, 20.0, powers.collect()).unwrap();
            let grain = Grain::of_crackle(0.8, 0.008).unwrap();
            texture.with_grain(Some(grain)).with_lines(vec![line]).unwrap()
        });
        surface
    };
    let shipped = files::load(&canvas).unwrap();
    let thesis = files::load(&root.join("tests/data/canvas-thesis.ron")).unwrap();
    let (slow, _) = resampling::resample_surface(&thesis, 2500.0, resampling::Method::Spectral).unwrap();
    let made = [with_structure(&shipped), slow.clone(), with_structure(&slow)];
    let written = made.iter().enumerate().map(|(number, surface)| {
        let path = folder.join(format!("{number}.ron"));
        std::fs::write(&path, files::native::write(surface)).unwrap();
        path
    });
    std::iter::once(canvas).chain(written).collect()
}

/// From each kind of surface to each other one, while the hand moves: cross-fades without a fault or an allocation.
#[test]
fn surfaces_of_every_kind_fade_into_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/texturepad.ron");
    let surfaces = surfaces_of_every_kind(folder.path());
    let plan_of = |surface: &Path| {
        let options = CheckOptions::default().set("surface", surface.display().to_string());
        let graph = graph_with(&path, &options).unwrap_or_else(|wrong| panic!("{wrong}"));
        Arc::clone(&plans(&graph, 64)[0])
    };
    for from in &surfaces {
        for to in surfaces.iter().filter(|to| *to != from) {
            let plan = plan_of(from);
            let taps = plan.tap_streams().count();
            let (mut live, mut control) = player(plan);
            live.process(20_000);
            assert_eq!(control.swap(plan_of(to)).unwrap(), Change::CrossFade);
            let mut largest = 0.0_f64;
            for _ in 0..200 {
                let allocated = allocations(|| {
                    live.process_with(64, |run, _| {
                        for x in (0..taps).flat_map(|tap| run.tap(tap)) {
                            assert!(x.is_finite());
                            largest = largest.max(x.abs());
                        }
                    });
                });
                assert_eq!(allocated, 0, "{} to {}", from.display(), to.display());
            }
            control.poll();
            assert_eq!(live.faults().ticks, 0);
            assert!(largest > 0.0);
        }
    }
}

/// With other rings between its drivers.
fn with_other_rings(path: &Path) -> Graph {
    let longer = CheckOptions::default().set("latency_ms", "14");
    graph_with(path, &longer).unwrap_or_else(|wrong| panic!("{wrong}"))
}

/// Every driver's callback, with its looks at the rings, what it keeps for a replay, a setting that glides, and graphs
/// that take over: one with the same rings and one with others.
#[test]
fn no_callback_of_several_drivers_allocates() {
    let folder = tempfile::tempdir().unwrap();
    let mut met = 0;
    for path in shipped() {
        let graph = graph(&path);
        if graph.drivers().len() == 1 {
            continue;
        }
        met += 1;
        let outlets = FileSinks::new(&graph);
        let (mut lives, mut session) =
            Session::open_all(outlets, &SessionOptions::default(), Some(folder.path())).unwrap();
        let setting = session.settings().next().unwrap().name();
        for wake in 0..600 {
            if wake == 300 {
                session.set_by_name(&setting, 0.5).unwrap();
            }
            let next = match wake {
                100 => Some(another_graph(&path)),
                200 => Some(with_other_rings(&path)),
                _ => None,
            };
            if let Some(next) = next {
                let changed = session.change(&next, folder.path()).unwrap();
                assert_eq!(changed.change, Change::FadeThroughZero(NoCrossFade::Drivers));
            }
            for (driver, live) in lives.iter_mut().enumerate() {
                let frames = (live.run().rate_hz() / 1000.0) as usize;
                // At the end each of them alone: rings run dry, and over.
                if wake < 400 || (wake < 500) == (driver == 0) {
                    let allocated = allocations(|| live.process(frames));
                    assert_eq!(allocated, 0, "{}", path.display());
                }
            }
        }
        session.poll();
        assert_eq!(session.freed(), 2 * lives.len() as u64);
        let ended = session.finish_all(lives);
        assert!(ended.outcome.rings.iter().all(|ring| ring.counts.fill_s.is_some()));
    }
    assert!(met > 0, "no shipped graph has several drivers");
}

#[test]
fn an_hour_of_drift_goes_by_between_two_drivers() {
    let text = r#"Graph(format: 1,
        clocks: { "servo": Driver(rate_hz: 1000), "other": Driver(rate_hz: 500) },
        nodes: {
            "one": Constant(clock: "servo", value: 1, quantity: "number"),
            "there": Gain(clock: "other", input: Ring(from: "one", latency_ms: 30), gain: 1),
            "back": Gain(clock: "servo", input: Ring(from: "there", latency_ms: 30), gain: 1),
        })"#;
    let graph = Document::parse("drift.ron", text)
        .and_then(|document| check(&document, &haptograph_nodes::registry(), &CheckOptions::default()))
        .unwrap_or_else(|wrong| panic!("{wrong}"));
    let mut clock = VirtualClock::of(&plans(&graph, 64)).drifting(&[60.0, -40.0]);
    for rounds in 0..3_600_000_u64 {
        clock.run_quantum(|_, run| {
            // A constant stays what it is, but for the pass band: nothing is skipped and nothing is missing.
            let right = |y: &f64| rounds < 200 || (y - 1.0).abs() < 2e-4;
            assert!((0..2).all(|tap| run.tap(tap).iter().all(right)), "round {rounds}");
        });
    }
    for ring in clock.rings() {
        let counts = ring.counts();
        assert_eq!((counts.underruns, counts.overruns, counts.lost_frames), (0, 0, 0), "{ring:?}");
        let (least_s, most_s) = counts.range_s.unwrap();
        assert!(least_s > 0.025 && most_s < 0.035, "{counts:?}");
    }
}
