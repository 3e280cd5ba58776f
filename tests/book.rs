//! The book and the README are true: what they show was made by the program as it is, and their graphs run.
#![allow(clippy::unwrap_used)]

use haptograph::engine::bridges::BridgeEntry;
use haptograph::engine::document::Document;
use haptograph::engine::frame::OneKind;
use haptograph::engine::graph::{CheckOptions, check};
use haptograph::engine::node::NodeEntry;
use haptograph::engine::registry::Registry;
use haptograph::engine::run::{FileSinks, Session, SessionOptions};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

#[allow(dead_code)]
#[path = "../examples/custom_kind.rs"]
mod custom_kind;
#[allow(dead_code)]
#[path = "../examples/custom_node.rs"]
mod custom_node;
#[allow(dead_code)]
#[path = "../examples/named_ports.rs"]
mod named_ports;
#[path = "../examples/sample_recording.rs"]
mod sample_recording;
#[allow(dead_code)]
#[path = "../examples/stateful_node.rs"]
mod stateful_node;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn pages() -> Vec<PathBuf> {
    let book = fs::read_dir(root().join("docs")).unwrap().map(|entry| entry.unwrap().path());
    let pages = book.filter(|path| path.extension().is_some_and(|e| e == "md"));
    pages.chain([root().join("README.md")]).collect()
}

#[test]
fn the_reference_of_nodes_is_current() {
    let made = haptograph::report::reference::book(&haptograph::nodes::registry());
    let kept = fs::read_to_string(root().join("docs/nodes.md")).unwrap();
    assert!(kept == made, "docs/nodes.md is out of date: haptograph nodes --markdown > docs/nodes.md");
}

#[test]
fn the_picture_in_the_readme_is_current() {
    let text = fs::read_to_string(root().join("graphs/texturepad.ron")).unwrap();
    let document = Document::parse(root().join("graphs/texturepad.ron"), &text).unwrap();
    let graph = check(&document, &haptograph::nodes::registry(), &CheckOptions::default()).unwrap();
    let made = haptograph::report::drawing::standalone_svg(&graph, "texturepad");
    let kept = fs::read_to_string(root().join("docs/texturepad.svg")).unwrap();
    assert!(
        kept == made,
        "out of date: haptograph draw graphs/texturepad.ron --force -o docs/texturepad.svg"
    );
}

/// The kinds that the book uses: the shipped ones, and those of the program that the page on nodes shows.
fn registry() -> Registry {
    let mut registry = custom_node::registry();
    registry.add(NodeEntry::processor::<stateful_node::Bristle>());
    registry.add(NodeEntry::processor::<named_ports::Grip>());
    registry
        .add_kind(custom_kind::Orientation::KIND)
        .add_bridge(BridgeEntry::of::<custom_kind::Slerp>())
        .add(NodeEntry::processor::<custom_kind::Turn>())
        .add(NodeEntry::processor::<custom_kind::Pointing>());
    registry
}

fn example(file: &str) -> String {
    fs::read_to_string(root().join("examples").join(file)).unwrap()
}

/// Programs and graphs on the page about nodes are parts of the examples that are run here, and the page shows or links to each.
#[test]
fn code_on_the_page_about_nodes_comes_from_the_examples() {
    let page = fs::read_to_string(root().join("docs/writing-a-node.md")).unwrap();
    let names = ["custom_node", "stateful_node", "custom_kind", "named_ports"];
    for (language, ending) in [("rust", "rs"), ("ron", "ron")] {
        let texts = names.map(|name| example(&format!("{name}.{ending}")));
        let fence = format!("```{language}\n");
        let blocks = page.split(&fence).skip(1);
        for part in blocks.filter_map(|rest| rest.split("```").next()) {
            assert!(texts.iter().any(|text| text.contains(part)), "no example has\n{part}");
        }
        for (name, text) in names.iter().zip(&texts) {
            let link = format!("../examples/{name}.{ending}");
            assert!(page.contains(&link) || page.contains(text.as_str()), "{link} is missing");
        }
    }
}

/// The page shows the whole of one program and its graph, which `cargo test` builds and which are run here.
#[test]
fn the_program_in_the_book_is_the_example_and_has_every_command() {
    let page = fs::read_to_string(root().join("docs/writing-a-node.md")).unwrap();
    for (language, file) in [("rust", "custom_node.rs"), ("ron", "custom_node.ron")] {
        let text = example(file);
        assert!(page.contains(&format!("```{language}\n{text}```")), "{file} is another on the page");
    }
    let folder = tempfile::tempdir().unwrap();
    let program = PathBuf::from(env!("CARGO_BIN_EXE_haptograph"));
    let program = program.with_file_name("examples").join("custom_node");
    let does = |arguments: &[&str]| {
        // `cargo test --test book` alone builds no example: `cargo build --examples` does.
        let done = Command::new(&program).args(arguments).current_dir(folder.path()).output().unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        String::from_utf8(done.stdout).unwrap()
    };
    let graph = root().join("examples/custom_node.ron");
    does(&["run", graph.to_str().unwrap(), "--for", "1"]);
    let rows = fs::read_to_string(folder.path().join("out/custom_node/detents.csv")).unwrap();
    let forces = rows.lines().filter_map(|row| row.rsplit(',').next()?.parse::<f64>().ok());
    let strongest = forces.fold(0.0, |most: f64, force| most.max(force.abs()));
    assert!((0.799..=0.8).contains(&strongest), "{strongest} N");
    assert!(does(&["nodes", "Detents"]).contains("pitch_mm"));
}

/// An example program of the book, with its graph.
struct Program {
    path: PathBuf,
    text: String,
    folder: tempfile::TempDir,
}

impl Program {
    fn of(name: &str) -> Self {
        let examples = PathBuf::from(env!("CARGO_BIN_EXE_haptograph")).with_file_name("examples");
        Self {
            path: examples.join(name),
            text: fs::read_to_string(root().join(format!("examples/{name}.ron"))).unwrap(),
            folder: tempfile::tempdir().unwrap(),
        }
    }

    /// Runs a graph for two seconds in blocks of a length, into a folder of that name.
    fn runs(&self, text: &str, block: &str) -> Output {
        fs::write(self.folder.path().join("graph.ron"), text).unwrap();
        let arguments = ["run", "graph.ron", "--for", "2", "--block", block, "--out", block];
        let mut command = Command::new(&self.path);
        command.args(arguments).current_dir(&self.folder);
        command.output().unwrap()
    }

    /// The rows of a file of its graph, the same in blocks of both lengths.
    fn rows(&self, file: &str, blocks: [&str; 2]) -> Vec<Vec<f64>> {
        let [one, other] = blocks.map(|block| {
            let done = self.runs(&self.text, block);
            assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
            fs::read_to_string(self.folder.path().join(block).join(file)).unwrap()
        });
        assert_eq!(one, other);
        let numbers = |row: &str| row.split(',').map(|cell| cell.parse().ok()).collect();
        one.lines().filter_map(numbers).collect()
    }
}

/// The kind, the bridge and the nodes of the page: the tool turns at a steady speed between what is seen of it, however time is cut into blocks,
/// and without the bridge the check offers it.
#[test]
fn the_kind_of_frames_in_the_book_is_turned_and_not_averaged() {
    let program = Program::of("custom_kind");
    let rows = program.rows("tip.csv", ["64", "1"]);
    assert_eq!(rows.len(), 2000);
    // Seen at k / 20 s, one such period late.
    let seen = |k: f64| 1.5 * (std::f64::consts::PI * (k / 20.0)).sin();
    for row in &rows[50..] {
        let [time_s, x, y, z] = row[..] else { panic!("{row:?}") };
        let late = 20.0 * time_s - 1.0;
        let (k, part) = ((late + 1e-9).floor(), (late + 1e-9).fract());
        let angle = seen(k) + part * (seen(k + 1.0) - seen(k));
        assert!((x - angle.cos()).abs() < 1e-6 && (y - angle.sin()).abs() < 1e-6, "{row:?}");
        assert!((x.hypot(y) - 1.0).abs() < 1e-6 && z == 0.0, "{row:?}");
    }
    for (written, code) in [("\"tool\"", "E0405"), ("Linear(\"tool\")", "E0406")] {
        let text = program.text.replace("Slerp(\"tool\")", written);
        let wrong = program.runs(&text, "8");
        let said = String::from_utf8_lossy(&wrong.stderr);
        assert!(!wrong.status.success() && said.contains(code), "{said}");
        assert!(said.contains("Slerp(...)"), "{said}");
    }
}

/// The node of the page whose ports the graph names: the shares add up to one, and a share of no finger is refused.
#[test]
fn the_node_with_named_ports_in_the_book_shares_what_it_adds() {
    let program = Program::of("named_ports");
    let rows = program.rows("grip.csv", ["64", "7"]);
    assert_eq!(rows.len(), 2000);
    for row in &rows {
        let [_, whole_n, index, thumb] = row[..] else { panic!("{row:?}") };
        assert!((index + thumb - 1.0).abs() < 1e-6 && (thumb * whole_n - 3.0).abs() < 1e-5, "{row:?}");
    }
    let text = program.text.replace("[\"index\", \"thumb\"]", "[\"index\", \"ring\"]");
    let wrong = program.runs(&text, "8");
    let said = String::from_utf8_lossy(&wrong.stderr);
    assert!(!wrong.status.success() && said.contains("E0304") && said.contains("E0203"), "{said}");
}

/// The bristle of the page: its force is a loop, and the same however time is cut into blocks.
#[test]
fn the_node_with_state_in_the_book_remembers_and_needs_no_block() {
    let folder = tempfile::tempdir().unwrap();
    let program = PathBuf::from(env!("CARGO_BIN_EXE_haptograph"));
    let program = program.with_file_name("examples").join("stateful_node");
    let graph = root().join("examples/stateful_node.ron");
    let rows = |block: &str| {
        let done = Command::new(&program)
            .args(["run", graph.to_str().unwrap(), "--for", "2", "--block", block, "--out", block])
            .current_dir(folder.path())
            .output()
            .unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        fs::read_to_string(folder.path().join(block).join("drag.csv")).unwrap()
    };
    let found = rows("64");
    assert_eq!(rows("7"), found);
    let forces: Vec<f64> = found.lines().filter_map(|row| row.rsplit(',').next()?.parse().ok()).collect();
    // At the same place, a quarter and three quarters into a stroke to and fro, it drags against the motion.
    assert!(
        (forces[250] + 0.6).abs() < 1e-9 && (forces[750] - 0.6).abs() < 1e-9,
        "{} {}",
        forces[250],
        forces[750]
    );
}

/// The largest sample of the WAV file that a run left, in twentieths of its full scale, or else of the CSV file's last columns.
fn loudest(folder: &Path) -> f64 {
    let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, |most: f64, x| most.max(x.abs()));
    if let Ok(mut wav) = hound::WavReader::open(folder.join("vibration.wav")) {
        return 20.0 * largest(&mut wav.samples::<f32>().map(|x| f64::from(x.unwrap())));
    }
    let text = fs::read_to_string(folder.join("force.csv")).unwrap();
    let cells = text.lines().flat_map(|row| row.rsplit(',').take(3));
    largest(&mut cells.filter_map(|cell| cell.parse().ok()))
}

/// Every pipeline of the cookbook is on its page with its picture as it is drawn now, runs, and is neither silent nor held
/// down by its limiter.
#[test]
fn the_cookbook_is_current_and_every_pipeline_of_it_runs() {
    let page = fs::read_to_string(root().join("docs/cookbook.md")).unwrap();
    let mut seen = 0;
    for entry in fs::read_dir(root().join("graphs/cookbook")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap();
        let document = Document::load(&path, &Default::default()).unwrap();
        let graph = check(&document, &registry(), &CheckOptions::default()).unwrap();
        assert!(graph.warnings().is_empty(), "{name}: {:?}", graph.warnings());
        let drawn = haptograph::report::drawing::standalone_svg(&graph, name);
        let kept = fs::read_to_string(root().join(format!("docs/cookbook/{name}.svg"))).unwrap_or_default();
        assert!(drawn == kept, "haptograph draw {} --force -o docs/cookbook/{name}.svg", path.display());
        assert!(
            page.contains(&format!("(cookbook/{name}.svg)"))
                && page.contains(&format!("(../graphs/cookbook/{name}.ron)"))
        );
        let folder = tempfile::tempdir().unwrap();
        let mut outlets = FileSinks::new(&graph);
        outlets.open_files(folder.path()).unwrap();
        let outcome =
            Session::run_offline(outlets, &SessionOptions::default().block(64).seconds(4.0), &mut |_| {})
                .unwrap();
        for actuator in &outcome.actuators {
            let held = actuator.clipped.peak + actuator.clipped.continuous;
            assert!(held * 20 < actuator.clipped.ticks, "{name}: {actuator:?}");
        }
        let loudest = loudest(folder.path());
        assert!((0.2..20.0).contains(&loudest), "{name}: {loudest}");
        seen += 1;
    }
    assert_eq!(seen, 16);
}

/// Blocks of RON.
fn blocks(text: &str) -> impl Iterator<Item = &str> {
    let begun = text.split("```ron\n").skip(1);
    begun.filter_map(|rest| rest.split_once("\n```")).map(|(block, _)| block)
}

/// Every block of RON that is a whole graph is sound.
#[test]
fn every_graph_in_the_book_is_sound() {
    let mut seen = 0;
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        for block in blocks(&text) {
            if !block.lines().any(|line| line.starts_with("Graph(")) {
                continue;
            }
            seen += 1;
            // Files that it names are looked for where the shipped graphs are.
            let place = root().join("graphs").join(page.file_name().unwrap());
            let graph = Document::parse(place, block)
                .and_then(|document| check(&document, &registry(), &CheckOptions::default()));
            if let Err(diagnostics) = graph {
                panic!("{}: {diagnostics}", page.display());
            }
        }
    }
    assert!(seen > 0);
}

/// Nodes and devices in pieces of graphs exist, as those of whole graphs do.
#[test]
fn every_kind_in_the_book_exists() {
    let registry = registry();
    let mut seen = 0;
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        let parts = |block| str::split(block, "\": ").skip(1).map(move |part| (block, part));
        // Plans of data sets and studies have motions and phases where graphs have nodes.
        let graphs = blocks(&text).filter(|block| {
            !["Batch(", "Study(", "People(", "opens_when"].iter().any(|of| block.starts_with(of))
        });
        for (block, part) in graphs.flat_map(parts) {
            let part = part.trim_start();
            let kind = part.split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default();
            let is_kind = kind.starts_with(char::is_uppercase) && part[kind.len()..].starts_with('(');
            if !is_kind || ["Template", "Driver", "Derived", "Expr", "Param", "Setting"].contains(&kind) {
                continue;
            }
            seen += 1;
            let known = registry.node(kind).is_some() || registry.device(kind).is_some();
            let is_template = block.contains(&format!("\"{kind}\": Template("));
            assert!(known || is_template, "{}: there is no `{kind}`", page.display());
        }
    }
    assert!(seen > 20);
}

/// The template on the page about the format is one, in a graph that gives it what it reads.
#[test]
fn the_template_in_the_book_is_sound() {
    let page = fs::read_to_string(root().join("docs/format.md")).unwrap();
    let template = blocks(&page).find(|block| block.starts_with("templates:")).unwrap();
    let sources = r#"nodes: {
    "stylus": Tablet(clock: "tablet", endpoint: "stylus"),
    "speed": SpeedEstimator(position: "stylus.position"),
    "texture""#;
    let template = template
        .replace("nodes: {\n    \"texture\"", sources)
        .replace("canvas.ron", "surfaces/t2-canvas.ron");
    let graph = format!(
        r#"Graph(format: 1, clocks: {{ "synth": Driver(rate_hz: 10000), "tablet": Derived(of: "synth", rate_hz: 125) }},
        endpoints: {{ "simulated": {{ "stylus": SimulatedTablet() }} }},
        {template})"#
    );
    let place = root().join("graphs/format.ron");
    let registry = registry();
    Document::parse(place, &graph)
        .and_then(|document| check(&document, &registry, &CheckOptions::default()))
        .unwrap_or_else(|wrong| panic!("{wrong}"));
}

/// The sample that the page on recording learns from, as its program makes it; BLESS=1 writes it. Another machine may round a
/// last digit the other way.
#[test]
fn the_sample_recording_is_what_its_program_makes() {
    let path = root().join("examples/data/t3-tile-drag-simulated.csv");
    let made = sample_recording::table().unwrap();
    if std::env::var_os("BLESS").is_some() {
        fs::write(&path, &made).unwrap();
    }
    let kept = fs::read_to_string(&path).unwrap();
    assert!(kept.len() < 300_000 && kept.starts_with("# SIMULATED"));
    assert_eq!(kept.lines().count(), made.lines().count());
    for (kept, made) in kept.lines().zip(made.lines()) {
        let cells = |row: &str| row.split(',').map(str::parse).collect::<Result<Vec<f64>, _>>();
        match (cells(kept), cells(made)) {
            (Ok(kept), Ok(made)) => assert!(
                kept.len() == 4 && kept.iter().zip(&made).all(|(a, b)| (a - b).abs() < 0.11),
                "{kept:?} {made:?}"
            ),
            _ => assert_eq!(kept, made),
        }
    }
}

/// Every key that a surface file may have is on the page about the format, in the part of it that is about its table.
#[test]
fn every_key_of_a_surface_file_is_in_the_book() {
    let page = fs::read_to_string(root().join("docs/surface-format.md")).unwrap();
    let layers = fs::read_dir(root().join("surfaces/src/layers")).unwrap().map(|entry| entry.unwrap().path());
    let sources = layers.chain([root().join("surfaces/src/files/native/document.rs")]);
    let source: String = sources.map(|path| fs::read_to_string(path).unwrap()).collect();
    let section = |name: &str| {
        let (_, section) =
            page.split_once(&format!("\n## {name}\n")).unwrap_or_else(|| panic!("no `## {name}`"));
        section.split("\n## ").next().unwrap_or_default()
    };
    let mut seen = 0;
    for part in source.split("struct ").skip(1) {
        let (name, fields) = part.split_once(" {\n").unwrap_or_default();
        let name = name.split('<').next().unwrap_or_default();
        let Some(name) = name.strip_suffix("Document") else {
            continue;
        };
        let fields = fields.split("\n}").next().unwrap_or_default().lines().map(str::trim);
        let fields = fields.filter(|line| !line.starts_with(['/', '#']));
        for key in fields.filter_map(|line| Some(line.split_once(": ")?.0.trim_start_matches("pub "))) {
            assert!(section(name).contains(&format!("| `{key}`")), "{name} has `{key}`");
            seen += 1;
        }
    }
    for layer in haptograph::surfaces::layers::LAYERS {
        assert!(section("Texture").contains(&format!("| `{}`", layer.name)), "{}", layer.name);
        seen += 1;
    }
    assert!(seen > 35, "{seen}");
}

/// What is told in numbers on the page about learning, and drawn beside it, are the numbers of the page about texture models.
#[test]
fn the_comparison_of_methods_is_the_measured_one() {
    let read = |page: &str| fs::read_to_string(root().join("docs").join(page)).unwrap();
    let (learning, measured, drawn) =
        (read("learning.md"), read("texture-models.md"), read("learning-comparison.svg"));
    let begin = learning.find("| log-spectral distance, dB |").unwrap();
    let table = learning[begin..].split("\n\n").next().unwrap();
    let mut seen = 0;
    for number in table.split(['|', ' ', '*', '\n']) {
        if number.parse::<f64>().is_ok_and(|_| number.contains('.')) {
            assert!(measured.contains(number), "{number} was not measured");
            assert!(drawn.contains(&format!(">{number}<")), "{number} is not drawn");
            seen += 1;
        }
    }
    assert_eq!(seen, 36);
}

#[test]
fn links_between_pages_lead_somewhere() {
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        for target in
            text.split("](").skip(1).filter_map(|rest| rest.split_once(')')).map(|(target, _)| target)
        {
            let file = target.split('#').next().unwrap_or_default();
            if file.is_empty() || file.starts_with("http") {
                continue;
            }
            let folder = page.parent().unwrap_or(Path::new("."));
            assert!(folder.join(file).exists(), "{} links to {target}", page.display());
        }
    }
}
