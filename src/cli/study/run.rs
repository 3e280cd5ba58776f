//! `haptograph study run`: serves the pages of participant and experimenter.

use super::super::run::{present, stop_on_interrupt};
use super::super::studio;
use super::super::{Failure, print};
use super::{StudyFile, failure};
use crate::engine::registry::Registry;
use haptograph_studio::{Options, Studio, export_study};
use haptograph_study::conduct::Conductor;
use haptograph_study::data::Folder;
use std::path::{Path, PathBuf};

/// What `study run` takes.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    study: StudyFile,
    /// The folder of the data; default: out/NAME
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    #[command(flatten)]
    pages: studio::Pages,
    /// Write both pages with their engine as a static site, for any web server; simulated devices, the data stay in the browser until they
    /// are downloaded
    #[arg(long, value_name = "DIR", conflicts_with_all = ["surfaces", "output", "port", "no_open", "lan", "live", "endpoints"])]
    export: Option<PathBuf>,
}

pub(super) fn run(arguments: &Arguments, registry: &Registry) -> Result<(), Failure> {
    if let Some(folder) = &arguments.export {
        let exported = export_study(&arguments.study.study, folder, registry).map_err(studio::failure)?;
        return studio::say_exported(exported, folder);
    }
    let mut checked = arguments.study.load()?;
    if let Some(endpoints) = arguments.pages.endpoints() {
        checked.study.endpoints = endpoints;
    }
    checked.check_graph(registry).map_err(failure)?;
    let output = arguments.output.clone().unwrap_or_else(|| {
        let name = arguments.study.study.file_stem().unwrap_or_default();
        Path::new("out").join(name)
    });
    let folder = Folder::open(&output, &checked.identity(None)).map_err(Failure::message)?;
    let (graph, set) = Conductor::first(&checked, registry).map_err(failure)?;
    let options = Options {
        graph: checked.study.graph.clone(),
        set,
        endpoints: Some(checked.study.endpoints.clone()),
        port: arguments.pages.port,
        out: output.clone(),
        surfaces: Vec::new(),
        lan: arguments.pages.lan()?,
        learner: None,
    };
    let conductor = Conductor::open(checked, folder, &graph).map_err(failure)?;
    drop(graph);
    let studio = Studio::conduct(&options, registry, conductor).map_err(studio::failure)?;
    let stop = stop_on_interrupt()?;
    let moves = match studio.driven() {
        driven if driven.is_empty() => "a rehearsal: nothing real moves (simulated devices)".to_owned(),
        driven => format!("real, and at zero but in trials: `{}`", driven.join("`, `")),
    };
    let own = studio.participant_url().unwrap_or_default();
    print(&format!(
        "data: {}\n{moves}\nthe experimenter's page:\n\n    {}\n\nthe participant's page, in a window of its own:\n\n    {own}\n\n\
         ctrl-C ends it; nothing that was answered is lost\n",
        output.display(),
        studio.url(),
    ))?;
    if let Some(url) = studio.lan_url() {
        let code = studio::code(&url)?;
        print(&format!(
            "warning: --lan lets other machines in. Who has this address, or records the unencrypted traffic, can read and give the \
             participant's answers\n\n    {url}\n\n{code}\n"
        ))?;
    }
    if !arguments.pages.no_open {
        // The addresses were printed: without a desktop they are opened by hand.
        let _ = present::open(studio.url().as_ref());
        let _ = present::open(own.as_ref());
    }
    studio::wait(&studio, &stop)
}
