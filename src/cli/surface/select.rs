//! `haptograph surface select`: selects representative surfaces from a folder (thesis 4.4).

use super::{Failure, Found, Only, check_extension};
use crate::cli::beside::{Beside, Rows, chosen_surfaces, show_with};
use crate::cli::eprint;
use crate::cli::evaluate::Centre;
use crate::cli::placing::files_in;
use crate::cli::progress::Progress;
use crate::cli::result::CommandResult;
use crate::cli::table::{facts, significant, table};
use crate::learning::evaluate::centre_of;
use crate::learning::select::{Features, Selection, features, select};
use crate::signal::parallel;
use crate::surfaces::files::{self, merge};
use crate::surfaces::rendering::RandomWalk;
use crate::surfaces::{Surface, Taps, TextureModel};
use haptograph_study::thesis::{is_same_name, published};
use serde::Serialize;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
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
    #[command(flatten)]
    only: Only,
    #[command(flatten)]
    beside: Beside,
    /// Print features, clusters and selection as JSON
    #[arg(long)]
    json: bool,
}

/// The thesis selects 15 of 100.
const USUAL_COUNT: usize = 15;

pub(super) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let found = arguments.only.of(collect(&arguments.dir)?)?;
    let surfaces: Vec<Surface> = found.into_iter().map(|found| found.surface).collect();
    warn_of_mixed_forces(&surfaces);
    let found = measure(&surfaces, arguments.seed)?;
    let count = arguments.count.unwrap_or(USUAL_COUNT.min(found.len().div_ceil(2)));
    let selection = select(&found, count).map_err(Failure::doing("select from", &arguments.dir))?;
    let chosen = selection.chosen.iter().filter_map(|&i| surfaces[i].texture.as_ref());
    let middle = centre_of(chosen);
    let selected = Selected::new(&found, selection, middle);
    let beside = arguments.beside.rows(|| Ok(selected.beside(&surfaces).0))?;
    show_with(&selected, &beside, arguments.json)
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

/// All surfaces below a folder by name; parts of one material are joined.
pub(super) fn collect(dir: &Path) -> Result<Vec<Found>, Failure> {
    let mut by_name: BTreeMap<String, Found> = BTreeMap::new();
    let mut clashes = vec![];
    let names = files_in(dir, &[]).map_err(Failure::doing("read", dir))?;
    for path in names.iter().filter(|name| check_extension(name).is_ok()).map(|name| dir.join(name)) {
        let surface = match files::load(&path) {
            Ok(surface) => surface,
            Err(_) if is_note(&path) => continue,
            Err(error) => {
                eprint(&format!("warning: skipped: {error}\n"));
                continue;
            }
        };
        let name = surface.name.clone();
        let Some(Found { files, surface: known }) = by_name.get_mut(&name) else {
            by_name.insert(name, Found { files: vec![path], surface });
            continue;
        };
        if share_a_part(known, &surface) {
            clashes.push(format!("{name:?} in {} and {}", files[0].display(), path.display()));
        }
        files.push(path);
        join(known, surface);
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
    Ok(by_name.into_values().collect())
}

/// True for a note that a run wrote beside a recording, as `take.wav.ron`.
fn is_note(path: &Path) -> bool {
    let of = path.file_stem().map(Path::new).and_then(Path::extension);
    of.is_some_and(|of| of.eq_ignore_ascii_case("wav") || of.eq_ignore_ascii_case("csv"))
}

fn share_a_part(a: &Surface, b: &Surface) -> bool {
    a.texture.is_some() && b.texture.is_some()
        || a.taps.is_some() && b.taps.is_some()
        || a.friction.is_some() && b.friction.is_some()
        || a.stiffness.is_some() && b.stiffness.is_some()
}

/// Adds another file of one name. If both have a texture, the one with the higher rate is used; of other parts
/// the first one's.
fn join(known: &mut Surface, mut next: Surface) {
    let rate_hz = |texture: &Option<TextureModel>| texture.as_ref().map_or(0.0, TextureModel::rate_hz);
    if rate_hz(&next.texture) > rate_hz(&known.texture) {
        known.texture = None;
    } else if known.texture.is_some() {
        next.texture = None;
    }
    next.friction = next.friction.filter(|_| known.friction.is_none());
    next.stiffness = next.stiffness.filter(|_| known.stiffness.is_none());
    next.taps = next.taps.filter(|_| known.taps.is_none());
    if let Ok(merged) = merge(known.clone(), next) {
        *known = merged;
    }
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

    /// The numbers of sections 4.4 and 4.5.2 that mean the same, and what is chosen here for each surface of the thesis.
    fn beside(&self, all: &[Surface]) -> Rows {
        let (mut rows, study) = (Rows::default(), &published()["studies"]["4.4"]);
        rows.add("4.4", "surfaces", self.surfaces.len(), &study["of"]);
        let mut features = self.features.join(", ");
        if !all.iter().filter_map(|one| one.taps.as_ref()).all(Taps::has_forces) {
            features += " (taps by rendered forces)";
        }
        let printed = study["features"].as_array().into_iter().flatten().filter_map(Value::as_str);
        let printed: Vec<_> = printed.filter_map(|feature| feature.split(" (").next()).collect();
        rows.add("4.4", "features, as z-scores", features, &printed.join(", ").into());
        rows.add("4.4.4", "clusters", self.chosen.len(), &study["clusters"]);
        let mut by_mu: Vec<(f64, &str)> =
            self.surfaces.iter().filter_map(|of| Some((of.features.friction?, &*of.features.name))).collect();
        by_mu.sort_by(|a, b| a.0.total_cmp(&b.0));
        let shown =
            |of: Option<&(f64, &str)>| of.map(|(mu, name)| format!("{} ({name})", significant(*mu, 3)));
        rows.constant("least mu of the toolkit (wax paper)", shown(by_mu.first()));
        rows.constant("largest mu of the toolkit (EPDM foam)", shown(by_mu.last()));
        Centre::beside(self.centre.as_ref(), &mut rows);
        let is_there =
            |name: &&'static str| self.surfaces.iter().find(|of| is_same_name(&of.features.name, name));
        let there: Vec<_> =
            chosen_surfaces().filter_map(|name| Some((name, is_there(&name)?.cluster))).collect();
        let clusters = there.iter().map(|(_, cluster)| cluster).collect::<BTreeSet<_>>().len();
        rows.add("4.4.4", "clusters with a surface of the thesis", clusters, &study["clusters"]);
        for (name, cluster) in there {
            let what = format!("chosen from the cluster of {name}");
            rows.add("Fig. 4.7", &what, self.selected[cluster], &name.into());
        }
        rows
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_surface_of_the_thesis_stands_beside_what_is_chosen_from_its_cluster() {
        let of = |(number, name): (usize, String)| Features {
            friction: Some(0.1 + 0.1 * (number / 2) as f64),
            name,
            power: Some(1.0 + 0.01 * number as f64),
            tap_response: Some(20.0),
        };
        // Each with a neighbour that is as good.
        let names = chosen_surfaces().flat_map(|name| [name.to_owned(), format!("nearly {name}")]);
        let found: Vec<Features> = names.enumerate().map(of).collect();
        let selected = Selected::new(&found, select(&found, 15).unwrap(), Some((0.14, 1.3)));
        let rows = selected.beside(&[]).0;
        let own = |what: &str| rows.iter().find(|row| row.what == what).map(|row| (&row.own, &row.thesis));
        let [fifteen, cork] = [Value::from(15), Value::from("Cork")];
        assert_eq!(own("clusters with a surface of the thesis"), Some((&fifteen, &fifteen)));
        assert_eq!(own("chosen from the cluster of Cork"), Some((&cork, &cork)));
        assert_eq!(own("mean speed of models, mm/s").map(|(_, thesis)| thesis), Some(&Value::from(130)));
        let mu = own("largest mu of the toolkit (EPDM foam)").unwrap();
        assert_eq!(mu, (&"1.5 (nearly Whiteboard)".into(), &Value::from(1.39)));
        assert_eq!(rows.iter().filter(|row| row.source == "Fig. 4.7").count(), 15);
    }
}
