//! The command line of haptograph. Each command parses its arguments, makes one library call, and prints a
//! result or an error.
//!
//! A program with its own nodes calls [`main`] with its registry and gets every command.

mod batch;
mod bench;
mod beside;
mod built;
mod check;
mod compare;
mod completions;
mod convert_recording;
mod devices;
mod doctor;
mod draw;
mod evaluate;
mod export;
mod failure;
mod identify;
mod import;
mod interrupt;
mod keys;
mod learn;
mod lsp;
mod man;
mod new;
mod nodes;
mod panic_hook;
mod placing;
mod progress;
mod recording;
mod recover;
mod result;
mod run;
mod screen;
mod segment;
mod simulate_recording;
mod snippet;
mod stderr;
mod studio;
mod study;
mod surface;
mod sweep;
mod table;
mod terminal;
mod thesis;

use crate::engine::diagnostic::{Diagnostics, render};
use crate::engine::document::{Document, LoadOptions};
use crate::engine::graph::{CheckOptions, Graph, check};
use crate::engine::registry::Registry;
use crate::signal::files;
use clap::{ArgMatches, Args};
use failure::{ErrorForm, refuse_usage};
pub(crate) use failure::{Failure, print, print_json};
use std::collections::HashSet;
use std::ffi::OsString;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
pub(crate) use stderr::eprint;
use terminal::is_coloured;

/// Runs the command line for the node and device kinds in `registry`: parses the arguments of the process,
/// runs the command, and returns the exit code.
///
/// Installs a panic hook for the process that prints a panic as a bug to report.
///
/// ```no_run
/// fn main() -> std::process::ExitCode {
///     let mut registry = haptograph::nodes::registry();
///     // registry.add(NodeEntry::processor::<MyNode>());
///     haptograph::cli::main(&registry)
/// }
/// ```
pub fn main(registry: &Registry) -> ExitCode {
    #[cfg(unix)]
    if crate::live::guard::is_guard() {
        return crate::live::guard::serve().map_or(ExitCode::FAILURE, |()| ExitCode::SUCCESS);
    }
    panic_hook::install();
    interrupt::listen();
    // A person at a terminal gets the gallery; a script does not wait for one.
    let is_person = std::io::stdin().is_terminal() && std::io::stdout().is_terminal();
    if is_person && std::env::args_os().len() == 1 {
        let code = studio::gallery(registry)
            .map_or_else(|failure| failure.report(ErrorForm::Text), |()| ExitCode::SUCCESS);
        stderr::flush();
        return code;
    }
    let matches = program()
        .try_get_matches_from(with_plain_help(std::env::args_os().collect()))
        .unwrap_or_else(|error| refuse_usage(&error));
    let chosen = matches.subcommand().and_then(|(name, matches)| {
        let command = commands().into_iter().find(|command| command.name == name)?;
        Some((command, matches))
    });
    let result = chosen.as_ref().map_or(Ok(()), |(command, matches)| (command.run)(matches, registry));
    let form = match chosen.is_some_and(|(_, matches)| wants_json(matches)) {
        true => ErrorForm::Json,
        false => ErrorForm::Text,
    };
    let code = result.map_or_else(|failure| failure.report(form), |()| ExitCode::SUCCESS);
    stderr::flush();
    code
}

/// The clap command with all subcommands, arguments and examples.
fn program() -> clap::Command {
    let all = clap::Command::new("haptograph")
        .version(env!("CARGO_PKG_VERSION"))
        .about("Runs graphs that render the feel of real surfaces")
        .after_help(format!("{}\n\n{EXIT_CODES}", listed(FIRST_STEPS)))
        .propagate_version(true)
        .subcommand_required(true)
        .arg_required_else_help(true);
    let all = commands().iter().fold(all, |all, command| {
        let of_command = clap::Command::new(command.name).after_help(listed(&command.examples));
        let of_command = (command.arguments)(of_command).mut_subcommands(|inner| {
            let begin = format!("{} {} ", command.name, inner.get_name());
            let own = command.examples.iter().filter(|line| line.starts_with(&begin));
            let own: Vec<&str> = own.copied().collect();
            inner.after_help(listed(&own))
        });
        all.subcommand(of_command)
    });
    with_negative_numbers(all)
}

/// Example calls, formatted for the help text.
fn listed(examples: &[&str]) -> String {
    let lines: Vec<String> = examples.iter().map(|line| format!("  haptograph {line}")).collect();
    format!("Examples:\n{}", lines.join("\n"))
}

/// Examples at the end of `haptograph --help`.
const FIRST_STEPS: &[&str] = &[
    "studio",
    "run graphs/texturepad.ron --open",
    "new my-graph.ron",
    "check my-graph.ron",
    "nodes --find filter",
];

/// Rewrites `help --help` to `help` and `help run --help` to `help run`.
fn with_plain_help(mut arguments: Vec<OsString>) -> Vec<OsString> {
    let is_help = arguments.get(1).is_some_and(|word| word == "help");
    let asks = arguments.len() > 2 && arguments.last().is_some_and(|word| word == "--help" || word == "-h");
    if is_help && asks {
        arguments.pop();
    }
    arguments
}

const EXIT_CODES: &str = "Exit codes: 0 success, including a live run without --for that ctrl-C ended; 1 failure, explained on \
    standard error; 2 wrong arguments; 130 interrupted by ctrl-C.\n\
    With --json a failure is printed as a JSON object on standard output. NO_COLOR and TERM=dumb turn colours off.";

/// True if `--json` was given to the command or to one of its subcommands.
fn wants_json(matches: &ArgMatches) -> bool {
    let own = matches.try_get_one::<bool>("json").ok().flatten();
    let inner = matches.subcommand().is_some_and(|(_, inner)| wants_json(inner));
    own.copied().unwrap_or(false) || inner
}

fn surface_command() -> Command {
    Command::new("surface", surface::run)
        .example("surface show graphs/surfaces/t2-canvas.ron")
        .example("surface convert brick.xml brick.ron")
        .example("surface resample tile.ron --rate 1000 --method spectral -o tile.1k.ron")
        .example("surface select graphs/surfaces --count 3 --beside thesis")
        .example("surface convert HaTT fifteen --only thesis-4.4")
        .example("surface interpolate tile.ron --json < speeds-and-forces.txt")
        .example("surface leave-one-out Models10000Hz/XML")
        .example("surface image canvas.png --mm 63.5")
        .example("surface constants HaTT --only thesis-4.4")
        .example("surface headroom graphs/texturepad.ron graphs/surfaces/t2-canvas.ron graphs/surfaces/t3-tile.ron")
}

/// All commands, in the order in which the help lists them.
fn commands() -> Vec<Command> {
    vec![
        Command::new("run", run::run)
            .example("run graphs/texturepad.ron --for 10 --open --play")
            .example("run graphs/texturepad.ron --live --watch"),
        Command::new("check", check::run).example("check graphs/omni.ron --plan"),
        Command::new("studio", studio::run).example("studio graphs/texturepad.ron"),
        Command::new("study", study::run)
            .example("study check graphs/studies/first.ron --headroom")
            .example("study plan graphs/studies/first.ron --participant P07")
            .example("study run graphs/studies/first.ron")
            .example("study simulate graphs/studies/first.ron --people 12")
            .example("study simulate graphs/studies/first.ron --people 8,15,30 --repeat 500")
            .example("study analyse out/first-simulated")
            .example("study remove out/first-simulated --participant S001"),
        Command::new("thesis", thesis::run).example("thesis table 4.3").example("thesis study 4.5"),
        Command::new("recover", recover::run).example("recover out/texturepad.partial-1"),
        Command::new("sweep", sweep::run).example("sweep graphs/ar-pen.ron --over mu=0.2,0.3,0.4"),
        Command::new("batch", batch::run)
            .example("batch plan.ron -o data")
            .example("batch merge part-1 part-2 -o data")
            .example("batch wav plan.ron 0 3 -o heard"),
        Command::new("bench", bench::run).example("bench graphs/omni.ron"),
        Command::new("identify", identify::run).example(
            "identify out/identify/sweep.csv --magnet-g 6 --force-n-per-a 2.9 --report out/actuator",
        ),
        Command::new("draw", draw::run).example("draw graphs/omni.ron -o omni.svg"),
        Command::new("nodes", nodes::run)
            .example("nodes LowPass")
            .example("nodes --group filters")
            .example("nodes --find envelope"),
        Command::new("new", new::run).example("new my-graph.ron"),
        Command::new("simulate-recording", simulate_recording::run)
            .example("simulate-recording --material T2 --motion drag -o canvas-drag.npz"),
        Command::new("convert-recording", convert_recording::run)
            .example("convert-recording canvas-drag.npz Accel_canvas.xml"),
        Command::new("devices", devices::run).example("devices --formats"),
        Command::new("doctor", doctor::run).example("doctor"),
        Command::new("learn", learn::run)
            .example("learn drag.csv --circle circle.csv -o cork.ron --report out/cork")
            .example("learn canvas.npz -o canvas.ron --method thesis --beside thesis")
            .example("learn recordings -o surfaces --shard 1/8"),
        Command::new("segment", segment::run).example("segment recording.csv --column accel_m_s2"),
        surface_command(),
        Command::new("compare", compare::run).example("compare recorded.wav played.wav"),
        Command::new("export", export::run)
            .example("export out/texturepad/texture.wav texture.ahap texture.haptic texture.hjif")
            .example("export graphs/surfaces/t2-canvas.ron canvas.ahap --force-n 1 --speed-mm-s 100")
            .example("export graphs/surfaces/t2-canvas.ron canvas.haptic --along take.npz --json"),
        Command::new("evaluate", evaluate::shards::run)
            .example("evaluate recordings --report out/evaluation --beside thesis")
            .example("evaluate recordings --shard 1/8 -o parts/1.ron")
            .example("evaluate merge parts/1.ron parts/2.ron"),
        Command::new("lsp", lsp::run).example("lsp"),
        Command::new("completions", completions::run).example("completions bash"),
        Command::new("man", man::run).example("man run").example("man surface show"),
    ]
}

type Run = dyn Fn(&ArgMatches, &Registry) -> Result<(), Failure>;

/// A command: its name, its arguments, its function, and example calls.
struct Command {
    name: &'static str,
    arguments: fn(clap::Command) -> clap::Command,
    run: Box<Run>,
    examples: Vec<&'static str>,
}

impl Command {
    fn new<A: Args + 'static>(name: &'static str, run: fn(&A, &Registry) -> Result<(), Failure>) -> Self {
        let run = move |matches: &ArgMatches, registry: &Registry| {
            let arguments = A::from_arg_matches(matches).unwrap_or_else(|error| error.exit());
            run(&arguments, registry)
        };
        Self { name, arguments: A::augment_args, run: Box::new(run), examples: Vec::new() }
    }

    fn example(mut self, arguments: &'static str) -> Self {
        self.examples.push(arguments);
        self
    }
}

/// Lets clap read `--seconds -5` as a negative number and not as a flag `-5`.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    command.allow_negative_numbers(true).mut_subcommands(with_negative_numbers)
}

/// The graph file and the values that override its defaults.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct GraphArguments {
    /// The graph file
    pub graph: PathBuf,
    /// Override a parameter of the graph; can be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = assignment)]
    pub set: Vec<(String, String)>,
    /// The set of endpoints to bind the devices to. Default: `simulated`; for `run --live`, `live` if the
    /// graph has it
    #[arg(long, value_name = "SET")]
    pub endpoints: Option<String>,
}

fn assignment(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.split_once('=').ok_or("write it as NAME=VALUE")?;
    if name.is_empty() {
        return Err("the name is missing: write it as NAME=VALUE".to_owned());
    }
    Ok((name.to_owned(), value.to_owned()))
}

/// A seed.
pub(crate) fn seed(text: &str) -> Result<u64, String> {
    let wrong = |_| format!("give a whole number from 0 to {}", u64::MAX);
    text.parse().map_err(wrong)
}

/// Refuses a name that is given twice: the two values contradict each other.
pub(crate) fn refuse_repeated<'a>(
    flag: &str,
    names: impl IntoIterator<Item = &'a str>,
) -> Result<(), Failure> {
    let mut seen = HashSet::new();
    match names.into_iter().find(|name| !seen.insert(*name)) {
        None => Ok(()),
        Some(name) => Err(Failure::Message(format!("{flag} gives `{name}` twice; give it once"))),
    }
}

impl GraphArguments {
    /// Refuses a parameter that `--set` gives twice.
    pub(crate) fn refuse_repeated(&self) -> Result<(), Failure> {
        refuse_repeated("--set", self.set.iter().map(|(name, _)| name.as_str()))
    }

    /// Loads and checks the graph.
    pub(crate) fn load(&self, registry: &Registry, seed: Option<u64>) -> Result<Graph, Diagnostics> {
        let document = Document::load(&self.graph, &LoadOptions::default())?;
        let mut options = CheckOptions::default().endpoints(self.endpoints());
        options.set.clone_from(&self.set);
        options.set_as = "--set";
        options.seed = seed;
        check(&document, registry, &options)
    }

    /// The set of endpoints to bind to.
    pub(crate) fn endpoints(&self) -> &str {
        self.endpoints.as_deref().unwrap_or("simulated")
    }

    /// A copy for a live run: it binds to the `live` endpoints if the graph has them and no other set was
    /// given.
    pub(crate) fn for_live(&self) -> Result<Self, Failure> {
        let mut live = self.clone();
        if live.endpoints.is_none() {
            let document = Document::load(&self.graph, &LoadOptions::default()).map_err(Failure::Graph)?;
            live.endpoints = document.endpoints().find(|set| *set == "live").map(str::to_owned);
        }
        Ok(live)
    }

    /// Loads and checks the graph, and prints its warnings on standard error.
    pub(crate) fn load_and_warn(&self, registry: &Registry, seed: Option<u64>) -> Result<Graph, Failure> {
        let graph = self.load(registry, seed).map_err(Failure::Graph)?;
        warn(&graph);
        Ok(graph)
    }

    /// Refuses an output that would overwrite a file the graph reads.
    pub(crate) fn refuse_inputs(&self, graph: &Graph, output: &Path) -> Result<(), Failure> {
        let read = graph.nodes().iter().flat_map(|node| &node.files);
        refuse_overwrite(read.chain([&self.graph]), output)
    }

    /// The file name without its extension.
    pub(crate) fn name(&self) -> String {
        self.graph.file_stem().map_or_else(|| "graph".to_owned(), |stem| stem.to_string_lossy().into_owned())
    }
}

/// Prints the warnings of a checked graph on standard error.
pub(crate) fn warn(graph: &Graph) {
    if !graph.warnings().is_empty() {
        eprint(&render(&warnings(graph), is_coloured(&std::io::stderr())));
    }
}

/// The warnings of a checked graph.
pub(crate) fn warnings(graph: &Graph) -> Diagnostics {
    Diagnostics { sources: graph.sources().clone(), list: graph.warnings().to_vec() }
}

/// Reads a whole file.
pub(crate) fn read_file(path: &Path) -> Result<Vec<u8>, Failure> {
    files::read(path, files::MAX_RECORDING_BYTES).map_err(|error| Failure::file("read", path, &error))
}

/// Refuses an output path that is also an input.
pub(crate) fn refuse_overwrite(
    inputs: impl IntoIterator<Item: AsRef<Path>>,
    output: &Path,
) -> Result<(), Failure> {
    // A path that cannot be resolved does not exist yet.
    let Ok(target) = output.canonicalize() else {
        return Ok(());
    };
    let is_target = |input: &Path| input.canonicalize().is_ok_and(|input| input == target);
    match inputs.into_iter().any(|input| is_target(input.as_ref())) {
        false => Ok(()),
        true => Err(Failure::Message(format!(
            "{} is an input of this command and would be overwritten; give another output file",
            output.display()
        ))),
    }
}

/// Creates a folder with those above it.
pub(crate) fn make_folder(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(Failure::doing("make the folder", folder))
}

/// The existing folder of an output file. Commands check it before they compute anything.
pub(crate) fn folder_of(path: &Path) -> Result<&Path, Failure> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    if folder.is_dir() {
        return Ok(folder);
    }
    let (file, folder) = (path.display(), folder.display());
    Err(Failure::Message(format!("cannot write {file}: the folder {folder} does not exist; create it first")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_command_has_an_example_that_its_arguments_allow() {
        for command in commands() {
            assert!(!command.examples.is_empty(), "{}", command.name);
            for example in &command.examples {
                // The shell redirects standard input; clap does not see that part.
                let call = example.split(" < ").next().unwrap_or_default();
                let words = std::iter::once("haptograph").chain(call.split(' '));
                let read = program().try_get_matches_from(words);
                assert!(read.is_ok(), "{example}: {}", read.unwrap_err());
                assert!(example.starts_with(command.name), "{example}");
            }
        }
        for example in FIRST_STEPS {
            let words = std::iter::once("haptograph").chain(example.split(' '));
            assert!(program().try_get_matches_from(words).is_ok(), "{example}");
        }
        for command in program().get_subcommands() {
            for inner in command.get_subcommands() {
                let help = inner.get_after_help().map(ToString::to_string);
                let name = format!("haptograph {} {} ", command.get_name(), inner.get_name());
                assert!(help.is_some_and(|help| help.contains(&name)), "{name}");
            }
        }
        program().debug_assert();
    }

    #[test]
    fn help_of_help_is_help() {
        let plain = |words: &[&str]| with_plain_help(words.iter().map(OsString::from).collect());
        assert_eq!(plain(&["haptograph", "help", "--help"]), ["haptograph", "help"]);
        assert_eq!(plain(&["haptograph", "help", "run", "-h"]), ["haptograph", "help", "run"]);
        assert_eq!(plain(&["haptograph", "run", "--help"]), ["haptograph", "run", "--help"]);
    }
}
