//! `haptograph surface select`: selects representative surfaces from a folder (thesis 4.4).

use super::Failure;
use crate::cli::eprint;
use crate::cli::evaluate::Centre;
use crate::cli::progress::Progress;
use crate::cli::result::{CommandResult, show};
use crate::cli::table::{facts, significant, table};
use crate::learning::evaluate::centre_of;
use crate::learning::select::{Features, Selection, features, select};
use crate::signal::files::entries;
use crate::signal::parallel;
use crate::surfaces::files::{self, merge};
use crate::surfaces::rendering::RandomWalk;
use crate::surfaces::{Surface, TextureModel};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Select a few surfaces that represent all in a folder
///
/// The features are friction, tap response and vibration power along one trajectory, as z-scores. Similar
/// surfaces are clustered, and the one nearest to the centre of each cluster is selected. Files of one
/// material (the toolkit's models and taps) count as one surface.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// A folder of surface files, searched with its subfolders
    dir: PathBuf,
    /// Number of surfaces to select; default: 15, as in the thesis, or half of them if there are fewer than
    /// 30
    #[arg(long, value_name = "N")]
    count: Option<usize>,
    /// Seed of the trajectory and of the vibrations
    #[arg(long, default_value_t = 1, value_parser = crate::cli::seed)]
    seed: u64,
    /// Print features, clusters and selection as JSON
    #[arg(long)]
    json: bool,
}

/// The thesis selects 15 of 100.
const USUAL_COUNT: usize = 15;

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let surfaces = collect(&arguments.dir)?;
    warn_of_mixed_forces(&surfaces);
    let found = measure(&surfaces, arguments.seed)?;
    let count = arguments.count.unwrap_or(USUAL_COUNT.min(found.len().div_ceil(2)));
    let selection = select(&found, count).map_err(Failure::doing("select from", &arguments.dir))?;
    let chosen = selection.chosen.iter().filter_map(|&i| surfaces[i].texture.as_ref());
    let middle = centre_of(chosen);
    show(&Selected::new(&found, selection, middle), arguments.json)
}

/// Warns if some tap responses are by recorded forces and others by rendered forces, which are not
/// comparable.
fn warn_of_mixed_forces(surfaces: &[Surface]) {
    let with = |recorded: bool| {
        let has = |s: &&Surface| s.taps.as_ref().is_some_and(|taps| taps.has_forces() == recorded);
        surfaces.iter().find(has)
    };
    if let (Some(recorded), Some(rendered)) = (with(true), with(false)) {
        eprint(&format!(
            "warning: tap responses are not comparable: that of {} is by recorded forces; {} holds none, and its response is \
             by rendered forces\n",
            recorded.name, rendered.name
        ));
    }
}

/// All surfaces below a folder; parts of one material are joined.
pub(super) fn collect(dir: &Path) -> Result<Vec<Surface>, Failure> {
    let mut paths = vec![];
    walk(dir, &mut paths).map_err(Failure::doing("read", dir))?;
    paths.sort();
    let mut by_name: BTreeMap<String, (PathBuf, Surface)> = BTreeMap::new();
    let mut clashes = vec![];
    for path in paths {
        let surface = match files::load(&path) {
            Ok(surface) => surface,
            Err(_) if is_note(&path) => continue,
            Err(error) => {
                eprint(&format!("warning: skipped: {error}\n"));
                continue;
            }
        };
        let name = surface.name.clone();
        let entry = match by_name.remove(&name) {
            None => (path, surface),
            Some((first, known)) => {
                if share_a_part(&known, &surface) {
                    clashes.push(format!("{name:?} in {} and {}", first.display(), path.display()));
                }
                (first, joined(known, surface))
            }
        };
        by_name.insert(name, entry);
    }
    if let Some(example) = clashes.first() {
        eprint(&format!(
            "warning: {} surfaces have several files under one name and count as one ({example}); of each part the first \
             file's is used, of textures the one with the highest rate\n",
            clashes.len()
        ));
    }
    if by_name.is_empty() {
        return Err(Failure::Message(format!("{} contains no surface (.ron or .xml)", dir.display())));
    }
    Ok(by_name.into_values().map(|(_, surface)| surface).collect())
}

/// True for a note that a run wrote beside a recording, as `take.wav.ron`.
fn is_note(path: &Path) -> bool {
    let of = path.file_stem().map(Path::new).and_then(Path::extension);
    of.is_some_and(|of| of.eq_ignore_ascii_case("wav") || of.eq_ignore_ascii_case("csv"))
}

fn walk(dir: &Path, paths: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in entries(dir)? {
        let entry = entry?;
        let path = entry.path();
        if entry.file_type()?.is_dir() {
            walk(&path, paths)?;
        } else if path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("ron") || e.eq_ignore_ascii_case("xml"))
        {
            paths.push(path);
        }
    }
    Ok(())
}

fn share_a_part(a: &Surface, b: &Surface) -> bool {
    a.texture.is_some() && b.texture.is_some()
        || a.taps.is_some() && b.taps.is_some()
        || a.friction.is_some() && b.friction.is_some()
        || a.stiffness.is_some() && b.stiffness.is_some()
}

/// Joins two files of one name. If both have a texture, the one with the higher rate is used; of other parts
/// the first one's.
fn joined(mut known: Surface, mut next: Surface) -> Surface {
    let rate_hz = |texture: &Option<TextureModel>| texture.as_ref().map_or(0.0, TextureModel::rate_hz);
    if rate_hz(&next.texture) > rate_hz(&known.texture) {
        known.texture = None;
    } else if known.texture.is_some() {
        next.texture = None;
    }
    next.friction = next.friction.filter(|_| known.friction.is_none());
    next.stiffness = next.stiffness.filter(|_| known.stiffness.is_none());
    next.taps = next.taps.filter(|_| known.taps.is_none());
    merge(known.clone(), next).unwrap_or(known)
}

/// The features of all surfaces, computed on all cores.
fn measure(surfaces: &[Surface], seed: u64) -> Result<Vec<Features>, Failure> {
    let progress = Progress::of("playing");
    let walk = RandomWalk { seed, ..RandomWalk::default() };
    parallel::try_map(parallel::cores(), surfaces, &|part| progress.at(part), |surface| {
        features(surface, &walk, seed)
            .map_err(|error| Failure::Message(format!("cannot render {}: {error}", surface.name)))
    })
}

/// Surfaces in clusters, with one selected from each.
#[derive(Serialize)]
struct Selected<'a> {
    centre: Option<Centre>,
    features: Vec<&'static str>,
    scree: Vec<f64>,
    selected: Vec<&'a str>,
    surfaces: Vec<Clustered<'a>>,
    /// Index of the selected surface of each cluster.
    #[serde(skip)]
    chosen: Vec<usize>,
}

#[derive(Serialize)]
struct Clustered<'a> {
    cluster: usize,
    #[serde(flatten)]
    features: &'a Features,
}

impl<'a> Selected<'a> {
    fn new(found: &'a [Features], selection: Selection, centre: Option<(f64, f64)>) -> Self {
        let Selection { features, clusters, chosen, scree } = selection;
        let surfaces = found.iter().zip(clusters);
        let surfaces = surfaces.map(|(features, cluster)| Clustered { cluster, features }).collect();
        let selected = chosen.iter().map(|&i| &*found[i].name).collect();
        Self { centre: centre.map(Centre::from), features, scree, selected, surfaces, chosen }
    }
}

impl CommandResult for Selected<'_> {
    fn text(&self) -> String {
        let number = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| significant(value, 3));
        let row = |(cluster, &i): (usize, &usize)| {
            let others = self.surfaces.iter().enumerate();
            let others = others.filter(|&(j, other)| j != i && other.cluster == cluster);
            let others: Vec<&str> = others.map(|(_, other)| &*other.features.name).collect();
            let Features { name, friction, tap_response, power } = self.surfaces[i].features;
            let numbers = [*friction, *tap_response, *power].map(number);
            [name.clone()].into_iter().chain(numbers).chain([others.join(", ")]).collect()
        };
        let rows: Vec<Vec<String>> = self.chosen.iter().enumerate().map(row).collect();
        let (chosen, all, features) = (self.chosen.len(), self.surfaces.len(), self.features.join(", "));
        let header = ["surface", "mu", "tap (N s/m)", "power ((m/s²)²)", "stands for"];
        let centre = facts(&[Centre::fact(self.centre.as_ref())]);
        format!("{chosen} of {all} surfaces, by {features}\n\n{}\n{centre}", table(&header, &rows))
    }
}
