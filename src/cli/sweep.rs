//! `haptograph sweep`: runs one graph with several settings over the same strokes and writes a page that
//! compares the runs.

use super::placing::{Force, RunFolder};
use super::result::{CommandResult, indented, show};
use super::run::summary::Summary;
use super::run::{self, offline_options, timed};
use super::terminal::is_coloured;
use super::{Failure, GraphArguments, eprint, warnings};
use crate::engine::diagnostic::render;
use crate::engine::graph::Graph;
use crate::engine::registry::Registry;
use crate::engine::run::FileSinks;
use crate::report::plot_request::RunTraces;
use crate::report::plotted::{PlottedSignals, textures};
use crate::report::record::friction;
use crate::report::sweep::{SweepPage, SweptRun};
use clap::ArgGroup;
use serde::{Serialize, Serializer};
use serde_json::json;
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Run a graph once for each of several settings and compare the runs on a page
///
/// `--over gain=0.5,1,2` runs it for each value. Several `--over` run it for every combination. `--case
/// gain=2,seed=3` adds one run with these settings; with `--case` alone, the graph with its defaults runs
/// first.
#[derive(Debug, clap::Args)]
#[command(group = ArgGroup::new("varied").args(["over", "case"]).required(true).multiple(true))]
pub(super) struct Arguments {
    #[command(flatten)]
    pub graph: GraphArguments,
    /// A parameter of the graph and its values; can be repeated
    #[arg(long, value_name = "NAME=VALUE,...", value_parser = values)]
    pub over: Vec<(String, Vec<String>)>,
    /// Settings of one run; can be repeated
    #[arg(long, value_name = "NAME=VALUE,...", value_parser = case)]
    pub case: Vec<Case>,
    /// Duration of each run, in its own time
    #[arg(long = "for", value_name = "SECONDS", default_value_t = run::DURATION_S, value_parser = run::seconds)]
    pub duration_s: f64,
    /// The seed of all random streams, in place of the graph's own
    #[arg(long, value_parser = super::seed)]
    pub seed: Option<u64>,
    /// The folder to write, with a subfolder for each run; default: `out/GRAPH-sweep`
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Print the facts of the sweep as JSON
    #[arg(long)]
    pub json: bool,
}

/// Parameters and values of one run.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Case(Vec<(String, String)>);

impl Case {
    /// Name of the case: `gain=2, seed=3`; only the value if all cases set the same single parameter.
    fn name(&self, short: bool) -> String {
        match self.0.as_slice() {
            [(_, value)] if short => value.clone(),
            _ => self.joined("="),
        }
    }

    /// The settings, with this sign between names and values.
    fn joined(&self, sign: &str) -> String {
        let all: Vec<String> = self.0.iter().map(|(name, value)| format!("{name}{sign}{value}")).collect();
        if all.is_empty() { "as it is".to_owned() } else { all.join(", ") }
    }
}

/// Splits at commas that are outside of brackets and strings.
fn parts(text: &str) -> Vec<String> {
    let (mut parts, mut depth, mut quoted) = (vec![String::new()], 0_i32, false);
    for letter in text.chars() {
        match letter {
            '"' => quoted = !quoted,
            '(' | '[' | '{' if !quoted => depth += 1,
            ')' | ']' | '}' if !quoted => depth -= 1,
            ',' if !quoted && depth == 0 => {
                parts.push(String::new());
                continue;
            }
            _ => {}
        }
        if let Some(last) = parts.last_mut() {
            last.push(letter);
        }
    }
    parts.iter().map(|part| part.trim().to_owned()).collect()
}

fn values(text: &str) -> Result<(String, Vec<String>), String> {
    let (name, values) = super::assignment(text)?;
    let values = parts(&values);
    if values.iter().any(String::is_empty) {
        return Err("a value is missing: write it as NAME=VALUE,VALUE".to_owned());
    }
    Ok((name, values))
}

fn case(text: &str) -> Result<Case, String> {
    let settings: Result<_, _> = parts(text).iter().map(|part| super::assignment(part)).collect();
    settings.map(Case)
}

impl Arguments {
    /// Every combination of the values of `--over`, then the cases of `--case`.
    fn cases(&self) -> Vec<Case> {
        let mut cases = vec![Case(Vec::new())];
        for (name, values) in &self.over {
            let longer = cases.iter().flat_map(|case| {
                values.iter().map(|value| {
                    let setting = (name.clone(), value.clone());
                    Case(case.0.iter().cloned().chain([setting]).collect())
                })
            });
            cases = longer.collect();
        }
        cases.extend(self.case.iter().cloned());
        cases
    }

    /// Number of finished runs, in words.
    fn count(&self, done: usize) -> String {
        let plural = |count: usize| if count == 1 { "" } else { "s" };
        match (self.over.is_empty(), done) {
            // The first run has no settings.
            (true, 2..) => format!("as it is + {} case{}", done - 1, plural(done - 1)),
            _ => format!("{done} time{}", plural(done)),
        }
    }
}

/// A finished run.
struct Done {
    name: String,
    label: String,
    graph: Graph,
    plotted: PlottedSignals,
    summary: Summary,
}

/// Maximum number of runs; each is kept in memory for the page.
const MAX_RUNS: usize = 200;

pub(super) fn run(arguments: &Arguments, registry: &Registry) -> Result<(), Failure> {
    refuse_unclear(arguments)?;
    let cases = arguments.cases();
    let graphs = checked(arguments, &cases, registry)?;
    let target = arguments.out.clone().unwrap_or_else(|| {
        let name = format!("{}-sweep", arguments.graph.name());
        PathBuf::from("out").join(name)
    });
    let mut folder = RunFolder::beside(&target)?;
    let (stop, planned) = (run::stop_on_interrupt()?, graphs.len());
    folder.begin();
    let mut done = Vec::new();
    for (number, checked) in graphs.into_iter().enumerate() {
        done.push(run_one(arguments, checked, &folder, number + 1, &stop)?);
        if stop.load(Ordering::Relaxed) {
            break;
        }
    }
    folder.write("report.html", &page(arguments, &done))?;
    let swept = Swept { arguments, done: &done, planned, page: target.join("report.html") };
    folder.write("run.json", &indented(&swept))?;
    let (placed, _) = folder.commit(&[], Force::default())?;
    placed.lines().iter().for_each(|line| eprint(&format!("note: {line}\n")));
    let stopped = stop.load(Ordering::Relaxed);
    if done.len() < planned || stopped {
        eprint(&format!(
            "warning: stopped after {} of {planned} runs; the last one is shorter than --for\n",
            done.len()
        ));
    }
    show(&swept, arguments.json)?;
    if stopped { Err(Failure::Interrupted) } else { Ok(()) }
}

/// Refuses repeated names and values, and too many runs.
fn refuse_unclear(arguments: &Arguments) -> Result<(), Failure> {
    arguments.graph.refuse_repeated()?;
    super::refuse_repeated("--over", arguments.over.iter().map(|(name, _)| name.as_str()))?;
    for (name, values) in &arguments.over {
        super::refuse_repeated(&format!("--over {name}=..."), values.iter().map(String::as_str))?;
    }
    let combined =
        arguments.over.iter().try_fold(1_usize, |count, (_, values)| count.checked_mul(values.len()));
    match combined.is_none_or(|count| count.saturating_add(arguments.case.len()) > MAX_RUNS) {
        true => Err(Failure::Message(format!(
            "these values have more than {MAX_RUNS} combinations; sweep over fewer"
        ))),
        false => Ok(()),
    }
}

/// A case with the arguments of its run and its graph.
type Checked<'a> = (&'a Case, run::Arguments, Graph);

/// Checks the graphs of all cases before the first one runs. A warning common to several is printed once.
fn checked<'a>(
    arguments: &Arguments,
    cases: &'a [Case],
    registry: &Registry,
) -> Result<Vec<Checked<'a>>, Failure> {
    let check = |case| {
        let run = arguments_of(arguments, case);
        let graph = run.graph.load(registry, run.seed).map_err(Failure::Graph)?;
        Ok((case, run, graph))
    };
    let graphs: Vec<Checked<'_>> = cases.iter().map(check).collect::<Result<_, Failure>>()?;
    let mut warned: Vec<String> = Vec::new();
    for (_, _, graph) in graphs.iter().filter(|(.., graph)| !graph.warnings().is_empty()) {
        let text = render(&warnings(graph), is_coloured(&std::io::stderr()));
        if !warned.contains(&text) {
            eprint(&text);
            warned.push(text);
        }
    }
    Ok(graphs)
}

/// Runs one case and writes its files, facts and page into its subfolder.
fn run_one(
    arguments: &Arguments,
    (case, run_arguments, graph): Checked<'_>,
    folder: &RunFolder,
    number: usize,
    stop: &Arc<AtomicBool>,
) -> Result<Done, Failure> {
    let place = folder.path().join(format!("{number:02}"));
    fs::create_dir(&place).map_err(Failure::doing("make the folder", &place))?;
    let mut file_sinks = FileSinks::new(&graph);
    file_sinks.open_files(&place).map_err(Failure::message)?;
    let mut plotted = run::plotted_signals(&graph, &mut file_sinks);
    let options = offline_options(&run_arguments, arguments.duration_s, stop);
    let (outcome, took_s) = timed(file_sinks, &options)?;
    let mut summary = Summary::of(&run_arguments, &graph, &outcome, took_s);
    summary.add(Vec::new(), run::unreached(&graph));
    folder.write(&format!("{number:02}/run.json"), &summary.to_json())?;
    let page = summary.page(&graph, &plotted, plotted.sound().as_ref());
    folder.write(&format!("{number:02}/report.html"), &page)?;
    plotted.forget_sound();
    let short = arguments.case.is_empty() && arguments.over.len() == 1;
    Ok(Done { name: case.name(short), label: case.joined(" = "), graph, plotted, summary })
}

fn arguments_of(arguments: &Arguments, case: &Case) -> run::Arguments {
    let GraphArguments { graph, set, endpoints } = &arguments.graph;
    run::Arguments {
        graph: GraphArguments {
            graph: graph.clone(),
            // The last value of a parameter counts.
            set: set.iter().chain(&case.0).cloned().collect(),
            endpoints: endpoints.clone(),
        },
        duration_s: Some(arguments.duration_s),
        seed: arguments.seed,
        block: 64,
        ..run::Arguments::default()
    }
}

fn page(arguments: &Arguments, done: &[Done]) -> String {
    let Some(first) = done.first() else {
        return String::new();
    };
    let plots: Vec<_> = done.iter().map(|run| run.plotted.plots()).collect();
    let over = match (&*arguments.over, &*arguments.case) {
        ([(name, _)], []) => Some(name.clone()),
        _ => None,
    };
    let runs = done.iter().zip(&plots).enumerate().map(|(number, (run, plots))| SweptRun {
        name: run.label.clone(),
        head: match over {
            Some(_) => run.name.clone(),
            None => run.label.clone(),
        },
        page: Some(format!("{:02}/report.html", number + 1)),
        signals: run.plotted.signals(),
        drawn: plots.iter().map(|(_, traces)| RunTraces { name: &run.label, traces }).collect(),
        warnings: run.summary.warnings().to_vec(),
    });
    let fact = |name: &str, value: String| (name.to_owned(), value);
    let names: Vec<&str> = done.iter().map(|run| run.label.as_str()).collect();
    let swept: Vec<&str> = arguments.over.iter().map(|(name, _)| name.as_str()).collect();
    let mut facts = vec![
        fact("Graph", arguments.graph.graph.display().to_string()),
        fact("Runs", names.join("; ")),
        fact("Seconds", arguments.duration_s.to_string()),
        fact("Seed", first.graph.seed().to_string()),
    ];
    if !swept.is_empty() {
        facts.insert(1, fact("Over", swept.join(", ")));
    }
    SweepPage {
        title: format!("{}, {} runs", arguments.graph.name(), done.len()),
        about: first.graph.about().to_owned(),
        over: over.clone(),
        simulation: first.summary.simulation(),
        friction: friction(&first.graph),
        facts,
        requests: plots.first().into_iter().flatten().map(|(request, _)| *request).collect(),
        runs: runs.collect(),
        textures: textures(&first.graph),
    }
    .to_html()
}

/// A finished sweep.
struct Swept<'a> {
    arguments: &'a Arguments,
    done: &'a [Done],
    planned: usize,
    page: PathBuf,
}

impl Serialize for Swept<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self { arguments, done, planned, .. } = self;
        let runs = done.iter().enumerate();
        let runs = runs.map(|(i, run)| json!({ "name": run.name, "folder": format!("{:02}", i + 1) }));
        json!({
            "graph": arguments.graph.graph.to_string_lossy(), "seconds": arguments.duration_s,
            "planned": planned,
            "stopped": done.len() < *planned || done.iter().any(|run| run.summary.was_stopped()),
            "runs": runs.collect::<Vec<_>>(), "haptograph": env!("CARGO_PKG_VERSION"),
        })
        .serialize(serializer)
    }
}

impl CommandResult for Swept<'_> {
    const INDENTED: bool = true;

    fn text(&self) -> String {
        let (name, count) = (self.arguments.graph.name(), self.arguments.count(self.done.len()));
        let page = self.page.display();
        format!("ran {name} {count}\nlook at {page}; each run's own page has its sound\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commas_in_brackets_and_strings_separate_nothing() {
        assert_eq!(
            parts(r#"Force, [Plane(), Sphere(a: 1, b: 2)],"a,b""#),
            ["Force", "[Plane(), Sphere(a: 1, b: 2)]", r#""a,b""#]
        );
        assert_eq!(values("a=1,2").unwrap(), ("a".into(), vec!["1".into(), "2".into()]));
        assert!(values("a=1,,2").is_err() && values("a").is_err() && case("a=1,b").is_err());
    }

    #[test]
    fn values_combine_and_cases_stand_alone() {
        let sweep = |over: &[&str], cases: &[&str]| {
            let arguments = Arguments {
                graph: GraphArguments { graph: "g.ron".into(), set: Vec::new(), endpoints: None },
                over: over.iter().map(|text| values(text).unwrap()).collect(),
                case: cases.iter().map(|text| case(text).unwrap()).collect(),
                duration_s: 1.0,
                seed: None,
                out: None,
                json: false,
            };
            arguments.cases().iter().map(|c| c.name(false)).collect::<Vec<_>>()
        };
        assert_eq!(sweep(&["a=1,2", "b=3,4"], &[]), ["a=1, b=3", "a=1, b=4", "a=2, b=3", "a=2, b=4"]);
        assert_eq!(sweep(&[], &["a=0", "b=0,c=1"]), ["as it is", "a=0", "b=0, c=1"]);
        assert_eq!(Case(vec![("a".into(), "7".into())]).name(true), "7");
    }
}
