//! `haptograph studio`: serves a web page on which a graph runs.

mod confirmation;

use super::run::{present, stop_on_interrupt};
use super::{Failure, eprint, print, refuse_repeated};
use crate::engine::registry::Registry;
use crate::live::guard;
use clap::{Args, FromArgMatches};
use confirmation::Confirmation;
use haptograph_studio::{Export, Exported, Options, Studio, StudioError, export, lan_address, shipped};
use include_dir::{Dir, include_dir};
use qrcode::render::unicode::Dense1x2;
use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use std::{io, process};

/// Open a web page to stroke, hear, see and change a graph while it runs
///
/// Without a graph it opens a gallery of the graphs that this program carries. They stay as they are: what is
/// saved or learned there goes to the folder `haptograph-graphs`.
///
/// Pointers on the page replace the graph's tablets. All other endpoints are simulated, so that nothing real
/// moves, unless --live or --endpoints names another set: then its actuators are opened, and receive zeros
/// until they are armed on the page. The page plays the signal of the first actuator, after its limits.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// The graph file; several for a site (--export). Default: those of the gallery
    graph: Vec<PathBuf>,
    /// Override a parameter of the graph; can be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = super::assignment, requires = "graph")]
    set: Vec<(String, String)>,
    #[command(flatten)]
    pages: Pages,
    /// A folder of surface files, besides the graph's own, that parameters on the page may name; can be
    /// repeated
    #[arg(long, value_name = "DIR")]
    surfaces: Vec<PathBuf>,
    /// Write the page as a static site that includes the engine, for any web server
    #[arg(long, value_name = "DIR", conflicts_with_all = ["port", "no_open", "surfaces", "lan", "live", "endpoints"])]
    export: Option<PathBuf>,
    /// Show the Markdown files of this folder, and the README.md beside it, on the site, too
    #[arg(long, value_name = "DIR", requires = "export")]
    docs: Option<PathBuf>,
}

/// The graphs that the program carries, and the folder that gets copies of what is saved.
static GRAPHS: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/graphs");
const SAVED: &str = "haptograph-graphs";

/// A temporary folder with the graphs that the program carries.
struct Carried {
    path: PathBuf,
    _folder: tempfile::TempDir,
}

impl Carried {
    fn unpack() -> Result<Self, Failure> {
        let failed =
            |error: io::Error| Failure::Message(format!("cannot unpack the graphs of the gallery: {error}"));
        let folder = tempfile::Builder::new().prefix("haptograph-gallery-").tempdir().map_err(failed)?;
        GRAPHS.extract(folder.path()).map_err(failed)?;
        Ok(Self { path: folder.path().canonicalize().map_err(failed)?, _folder: folder })
    }
}

/// Opens the gallery, as `haptograph studio` does.
pub(super) fn gallery(registry: &Registry) -> Result<(), Failure> {
    let program = Arguments::augment_args(clap::Command::new("studio"));
    let arguments = Arguments::from_arg_matches(&program.get_matches_from(["studio"]));
    run(&arguments.map_err(Failure::message)?, registry)
}

/// How pages are served, and what moves behind them.
#[derive(Debug, clap::Args)]
pub(super) struct Pages {
    /// Use the endpoints of the set `live`: its actuators stay at zero until they are armed
    #[arg(long, conflicts_with = "endpoints")]
    live: bool,
    /// Use the endpoints of this set
    #[arg(long, value_name = "SET")]
    endpoints: Option<String>,
    /// The port of this machine to serve pages at; 0 for a free one
    #[arg(long, default_value_t = 0)]
    pub port: u16,
    /// Let other machines on the network open the page, for anyone with its address: of a studio, pads and settings; of a study, the
    /// participant's page. Default ADDRESS: the address with which this machine reaches the network
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, require_equals = true)]
    lan: Option<Option<IpAddr>>,
    /// Do not open pages, only print their addresses
    #[arg(long)]
    pub no_open: bool,
}

impl Pages {
    /// The set of endpoints, if one is named.
    pub(super) fn endpoints(&self) -> Option<String> {
        self.live.then(|| "live".to_owned()).or_else(|| self.endpoints.clone())
    }

    /// The network address for other machines: the given one, or that of this machine.
    pub(super) fn lan(&self) -> Result<Option<IpAddr>, Failure> {
        let why = "found no network; give the address at which other machines reach this one: --lan=ADDRESS";
        let given = |given: Option<IpAddr>| {
            given.or_else(lan_address).ok_or_else(|| Failure::Message(why.to_owned()))
        };
        self.lan.map(given).transpose()
    }
}

pub(super) fn run(arguments: &Arguments, registry: &Registry) -> Result<(), Failure> {
    refuse_repeated("--set", arguments.set.iter().map(|(name, _)| name.as_str()))?;
    if let Some(folder) = &arguments.export {
        return write_site(arguments, folder, registry);
    }
    let refused = |why: &str| Err(Failure::Message(why.to_owned()));
    let carried = match arguments.graph.as_slice() {
        [] if arguments.pages.endpoints().is_some() => {
            return refused(
                "the gallery runs simulated devices only; give the graph whose devices are to be opened",
            );
        }
        [] => Some(Carried::unpack()?),
        [_] => None,
        _ => return refused("a studio runs one graph; several are for a site (--export)"),
    };
    let options = Options {
        graph: carried.as_ref().map_or_else(|| arguments.graph[0].clone(), |carried| carried.path.clone()),
        set: arguments.set.clone(),
        endpoints: arguments.pages.endpoints(),
        port: arguments.pages.port,
        out: PathBuf::from("out"),
        surfaces: arguments.surfaces.clone(),
        lan: arguments.pages.lan()?,
        learner: Some(learner),
    };
    let studio = match carried {
        Some(_) => {
            let saved = std::path::absolute(SAVED).map_err(Failure::message)?;
            Studio::open_gallery(&options, registry, saved)
        }
        None => Studio::open(&options, registry),
    };
    let studio = studio.map_err(failure)?;
    let stop = stop_on_interrupt()?;
    let moves = match studio.driven() {
        driven if driven.is_empty() => "nothing real moves (simulated devices)".to_owned(),
        driven => format!("real, and at zero until armed on the page: `{}`", driven.join("`, `")),
    };
    print(&format!("the studio is open at\n\n    {}\n\n{moves}; ctrl-C closes it\n", studio.url()))?;
    if let Some(url) = studio.lan_url() {
        print(&invitation(&url)?)?;
    }
    if !arguments.pages.no_open {
        // The address was printed: without a desktop it is opened by hand.
        let _ = present::open(studio.url().as_ref());
    }
    wait(&studio, &stop)
}

/// Serves the pages until the program is to stop.
pub(super) fn wait(studio: &Studio, stop: &AtomicBool) -> Result<(), Failure> {
    let (mut confirmation, mut said) = (Confirmation::default(), None);
    while !stop.load(Ordering::Relaxed) {
        confirmation.poll(studio)?;
        let trouble = studio.trouble();
        if let Some(trouble) = trouble.filter(|trouble| said.as_ref() != Some(trouble)) {
            eprint(&format!("warning: no page can connect now: {trouble}\n"));
            said = Some(trouble);
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    Ok(())
}

/// A process of this program that learns a recording.
fn learner(table: &Path, surface: &Path, report: &Path) -> io::Result<process::Command> {
    let mut command = process::Command::new(guard::program()?);
    command.arg("learn").arg(table).args([Path::new("-o"), surface, Path::new("--report"), report]);
    Ok(command)
}

/// An address as a QR code.
pub(super) fn code(url: &str) -> Result<String, Failure> {
    let code = qrcode::QrCode::new(url).map_err(Failure::message)?;
    // Dark on light, as cameras expect it, even on a dark terminal.
    Ok(code.render::<Dense1x2>().dark_color(Dense1x2::Light).light_color(Dense1x2::Dark).build())
}

/// The address and code for other machines, with a warning.
fn invitation(url: &str) -> Result<String, Failure> {
    let code = code(url)?;
    Ok(format!(
        "warning: --lan lets other machines in. Anyone with this address, or who records the unencrypted traffic, \
         can move the pad, turn settings and parameters, see the graph and its signals, and read the files of its folders that \
         a parameter can name, but not edit, save, record or learn. Those pages have no sound and a less even frame rate, since browsers \
         allow both only for encrypted pages and this machine\n\n    {url}\n\n{code}\n"
    ))
}

pub(super) fn failure(error: StudioError) -> Failure {
    match error {
        StudioError::Graph(wrong) => Failure::Graph(wrong),
        StudioError::Other(why) => Failure::Message(why),
    }
}

fn write_site(arguments: &Arguments, folder: &Path, registry: &Registry) -> Result<(), Failure> {
    let carried = if arguments.graph.is_empty() { Some(Carried::unpack()?) } else { None };
    let options = Export {
        graphs: carried.as_ref().map_or_else(|| arguments.graph.clone(), |carried| shipped(&carried.path)),
        set: arguments.set.clone(),
        folder: folder.to_owned(),
        docs: arguments.docs.clone(),
    };
    say_exported(export(&options, registry).map_err(failure)?, folder)
}

/// Says what was written.
pub(super) fn say_exported(exported: Exported, folder: &Path) -> Result<(), Failure> {
    print(&format!(
        "wrote {} files, {:.1} MB, to {}: serve it with any web server, by HTTPS or on this machine\n",
        exported.files,
        exported.bytes as f64 * 1e-6,
        folder.display()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_code_on_the_terminal_is_square_and_light_around() {
        let text = invitation("http://127.0.0.2:9/?token=0123456789abcdef0123456789abcdef").unwrap();
        assert!(text.starts_with("warning: ") && text.contains("http://127.0.0.2:9/?token="));
        let is_code = |line: &&str| line.contains(['█', '▀', '▄']);
        let rows: Vec<&str> = text.lines().filter(is_code).collect();
        let width = rows[0].chars().count();
        assert!(rows.iter().all(|row| row.chars().count() == width), "{text}");
        // Two modules per character; a light row above.
        assert!(rows.len() == width.div_ceil(2) && rows[0].chars().all(|c| c == '█'), "{text}");
    }
}
