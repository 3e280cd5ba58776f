//! `haptograph studio`: a page on which a graph is stroked, heard, seen and changed while it runs.

use super::run::stop_on_interrupt;
use super::{Failure, refuse_repeated, say};
use crate::engine::registry::Registry;
use haptograph_studio::{Export, Options, Studio, StudioError, export};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Duration;

/// Open a page on which a graph is stroked, heard, seen and changed while it runs
///
/// Pointers on the page are the graph's tablets; every other endpoint is simulated, so that nothing real moves. The page
/// plays what the first actuator is given, behind its limits.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The graph file; of a site that is exported several
    #[arg(required = true)]
    graph: Vec<PathBuf>,
    /// Give a parameter of the graph another value; can be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = super::assignment)]
    set: Vec<(String, String)>,
    /// The port of this machine that the page is served at; a free one where it is 0
    #[arg(long, default_value_t = 0)]
    port: u16,
    /// Do not open the page, only say its address
    #[arg(long)]
    no_open: bool,
    /// Write the page as a static site with the engine in it, which any web server can serve
    #[arg(long, value_name = "DIR", conflicts_with_all = ["port", "no_open"])]
    export: Option<PathBuf>,
}

pub fn run(arguments: &Arguments, registry: &Registry) -> Result<(), Failure> {
    refuse_repeated("--set", arguments.set.iter().map(|(name, _)| name.as_str()))?;
    if let Some(folder) = &arguments.export {
        return write_site(arguments, folder, registry);
    }
    let [graph] = arguments.graph.as_slice() else {
        let why = "a studio runs one graph; several are for a site (--export)";
        return Err(Failure::Message(why.to_owned()));
    };
    let options = Options {
        graph: graph.clone(),
        set: arguments.set.clone(),
        port: arguments.port,
        out: PathBuf::from("out"),
    };
    let studio = Studio::open(&options, registry).map_err(failure)?;
    let stop = stop_on_interrupt()?;
    say(&format!(
        "the studio is open at\n\n    {}\n\nnothing real moves (simulated devices); ctrl-C closes it\n",
        studio.url()
    ))?;
    if !arguments.no_open {
        open_page(&studio.url());
    }
    while !stop.load(Ordering::Relaxed) {
        std::thread::sleep(Duration::from_millis(50));
    }
    Ok(())
}

fn failure(error: StudioError) -> Failure {
    match error {
        StudioError::Graph(wrong) => Failure::Graph(wrong),
        StudioError::Other(why) => Failure::Message(why),
    }
}

fn write_site(arguments: &Arguments, folder: &Path, registry: &Registry) -> Result<(), Failure> {
    let options = Export {
        graphs: arguments.graph.clone(),
        set: arguments.set.clone(),
        folder: folder.to_owned(),
    };
    let exported = export(&options, registry).map_err(failure)?;
    say(&format!(
        "wrote {} files, {:.1} MB, to {}: serve it with any web server, by https or on this machine\n",
        exported.files,
        exported.bytes as f64 * 1e-6,
        folder.display()
    ))
}

/// Asks the desktop for its browser; where there is none, the address was said.
fn open_page(url: &str) {
    let opener = match std::env::consts::OS {
        "macos" => "open",
        "windows" => "explorer",
        _ => "xdg-open",
    };
    let quiet = std::process::Stdio::null;
    let _ = std::process::Command::new(opener)
        .arg(url)
        .stdin(quiet())
        .stdout(quiet())
        .stderr(quiet())
        .spawn();
}
