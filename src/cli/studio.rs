//! `haptograph studio`: a page on which a graph is stroked, heard, seen and changed while it runs.

use super::run::stop_on_interrupt;
use super::{Failure, refuse_repeated, say};
use crate::engine::registry::Registry;
use haptograph_studio::{Export, Options, Studio, StudioError, export, lan_address};
use qrcode::render::unicode::Dense1x2;
use std::net::IpAddr;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Duration;

/// Open a page on which a graph is stroked, heard, seen and changed while it runs
///
/// Pointers on the page are the graph's tablets; every other endpoint is simulated, so that nothing real moves, unless --live or
/// --endpoints names another set: then its actuators are opened, and get zeros until they are armed on the page. The page plays
/// what the first actuator is given, behind its limits.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// The graph file; of a site that is exported several
    #[arg(required = true)]
    graph: Vec<PathBuf>,
    /// Give a parameter of the graph another value; can be repeated
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = super::assignment)]
    set: Vec<(String, String)>,
    /// Use the endpoints of the set `live`: its actuators stay at zero until they are armed on the page
    #[arg(long, conflicts_with = "endpoints")]
    live: bool,
    /// Use the endpoints of this set in place of `simulated`
    #[arg(long, value_name = "SET")]
    endpoints: Option<String>,
    /// The port of this machine that the page is served at; a free one where it is 0
    #[arg(long, default_value_t = 0)]
    port: u16,
    /// A folder of surfaces besides the graph's own, which the page may name files of; can be repeated
    #[arg(long, value_name = "DIR")]
    surfaces: Vec<PathBuf>,
    /// Let other machines of the network open the page too, whoever has its address: their pads only. Without an ADDRESS
    /// it is the one from which this machine calls others
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, require_equals = true)]
    lan: Option<Option<IpAddr>>,
    /// Do not open the page, only say its address
    #[arg(long)]
    no_open: bool,
    /// Write the page as a static site with the engine in it, which any web server can serve
    #[arg(long, value_name = "DIR", conflicts_with_all = ["port", "no_open", "surfaces", "lan", "live", "endpoints"])]
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
        endpoints: arguments
            .live
            .then(|| "live".to_owned())
            .or(arguments.endpoints.clone()),
        port: arguments.port,
        out: PathBuf::from("out"),
        surfaces: arguments.surfaces.clone(),
        lan: arguments.lan.map(lan).transpose()?,
    };
    let studio = Studio::open(&options, registry).map_err(failure)?;
    let stop = stop_on_interrupt()?;
    let moves = match studio.driven() {
        driven if driven.is_empty() => "nothing real moves (simulated devices)".to_owned(),
        driven => format!(
            "real, and at zero until armed on the page: `{}`",
            driven.join("`, `")
        ),
    };
    say(&format!(
        "the studio is open at\n\n    {}\n\n{moves}; ctrl-C closes it\n",
        studio.url()
    ))?;
    if let Some(url) = studio.lan_url() {
        say(&invitation(&url)?)?;
    }
    if !arguments.no_open {
        open_page(&studio.url());
    }
    while !stop.load(Ordering::Relaxed) {
        std::thread::sleep(Duration::from_millis(50));
    }
    Ok(())
}

/// The address that was given, or else that of this machine.
fn lan(given: Option<IpAddr>) -> Result<IpAddr, Failure> {
    given.or_else(lan_address).ok_or_else(|| {
        let why = "this machine has no network that could be found; say at which of its addresses others find it: --lan=ADDRESS";
        Failure::Message(why.to_owned())
    })
}

/// What other machines open, and what follows from it.
fn invitation(url: &str) -> Result<String, Failure> {
    let code = qrcode::QrCode::new(url).map_err(|error| Failure::Message(error.to_string()))?;
    // Dark on light, as cameras want it, also on a dark terminal.
    let code = code
        .render::<Dense1x2>()
        .dark_color(Dense1x2::Light)
        .light_color(Dense1x2::Dark)
        .build();
    Ok(format!(
        "warning: --lan lets other machines in. Whoever has this address, or listens to the network, as nothing is encrypted, \
         can move the pad, turn settings and parameters, see the graph and its signals, and read the files of its folders that \
         a parameter can name; not edit, save, record or learn. There is no sound and less even speed on those pages, as browsers \
         give both to encrypted pages and to this machine only\n\n    {url}\n\n{code}\n"
    ))
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
        // Two modules a character; a whole row of light above.
        assert!(
            rows.len() == width.div_ceil(2) && rows[0].chars().all(|c| c == '█'),
            "{text}"
        );
    }
}
