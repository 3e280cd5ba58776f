//! Export as a static site: a gallery, the page, the engine as WebAssembly, the files of the graphs, and documentation.

use super::assets::{ENGINE, PAGE, WHOLE_ENGINE};
use super::docs;
use super::gallery;
use super::server::StudioError;
use crate::bundle::{self, has_unlicensed_clips, plain, relative, root_of, set_relative};
use crate::load::{SIMULATED, Source};
use crate::page;
use crate::stage::Stage;
use haptograph_engine::registry::Registry;
use haptograph_signal::files;
use haptograph_study::check::{Checked, StudyError};
use haptograph_study::conduct::Conductor;
use haptograph_study::document::Phase;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Content security policy of a site: its own files only. Only its engine is compiled.
const POLICY: &str = "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; img-src 'self' data: blob:; \
                      style-src 'self' 'unsafe-inline'; base-uri 'none'; form-action 'none'";
/// Part of the page's head to which an export adds tags.
const HEAD: &str = "<meta charset=\"utf-8\">";
const SITE: &str = "site.json";
/// The files of a site and their SHA-256, which no visitor waits for.
const FILES: &str = "files.json";
/// The engine of graphs, and the one that learns recordings and conducts studies, too.
const MODULE: &str = "engine.wasm";
const WHOLE: &str = "whole.wasm";
/// Both, in this order.
type Modules<'a> = [&'a [u8]; 2];

/// Options of an export.
#[derive(Debug, Clone)]
pub struct Export {
    /// The graph files.
    pub graphs: Vec<PathBuf>,
    /// Parameters that override the defaults.
    pub set: Vec<(String, String)>,
    /// The folder of the site.
    pub folder: PathBuf,
    /// A folder of documentation in Markdown, which the site shows too.
    pub docs: Option<PathBuf>,
}

/// Statistics of an export.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Exported {
    /// Number of files.
    pub files: usize,
    /// Total size, bytes.
    pub bytes: u64,
}

fn other(why: impl std::fmt::Display) -> StudioError {
    StudioError::Other(why.to_string())
}

fn other_study(error: StudyError) -> StudioError {
    match error {
        StudyError::Study(wrong) => StudioError::Graph(wrong),
        error => other(error),
    }
}

/// A graph of the site, and the files that it needs.
struct SiteGraph {
    name: String,
    about: String,
    path: PathBuf,
    set: Vec<(String, String)>,
    rate_hz: f64,
    /// What it needs, and the surfaces beside it, which can wait.
    files: BTreeSet<PathBuf>,
    beside: BTreeSet<PathBuf>,
}

/// What a site consists of, besides the engine.
struct Contents<'a> {
    graphs: Vec<SiteGraph>,
    /// Cards and pictures of the gallery; a study has none.
    cards: Vec<(Value, String)>,
    pages: &'a [SitePage],
    docs: Option<&'a Path>,
}

/// Writes a site for any server of static files.
///
/// # Errors
/// [`StudioError`] if a graph has errors, if the folder holds other files, or if this program was built
/// without the engine.
pub fn export(options: &Export, registry: &Registry) -> Result<Exported, StudioError> {
    export_with(options, registry, engine()?)
}

/// Writes a site with the two pages of a study.
///
/// # Errors
/// As [`export`], and [`StudioError`] if the study needs more than pages have.
pub fn export_study(study: &Path, folder: &Path, registry: &Registry) -> Result<Exported, StudioError> {
    write_site(&study_contents(study, registry)?, folder, engine()?)
}

fn engine() -> Result<Modules<'static>, StudioError> {
    match [ENGINE, WHOLE_ENGINE] {
        [[], _] | [_, []] => Err(other(
            "this build of haptograph lacks the engine for pages: run `studio/build-site` in the sources and build again",
        )),
        modules => Ok(modules),
    }
}

fn export_with(options: &Export, registry: &Registry, modules: Modules<'_>) -> Result<Exported, StudioError> {
    let (mut graphs, mut cards, mut names) = (Vec::new(), Vec::new(), BTreeSet::new());
    for path in &options.graphs {
        let source = Source::new(plain(path), registry, options.set.clone());
        let (name, card) = (source.name(), gallery::card(&source)?);
        let picture = gallery::picture(&source)?;
        match take(source) {
            Ok(graph) => graphs.push(graph),
            Err(StudioError::Other(why)) => return Err(other(format!("{}: {why}", path.display()))),
            Err(wrong) => return Err(wrong),
        }
        cards.push((card, picture));
        if !names.insert(name.clone()) {
            return Err(other(format!("two graphs are called `{name}`: give one of the files another name")));
        }
    }
    let contents = Contents { graphs, cards, pages: &PAGES_OF_GRAPHS, docs: options.docs.as_deref() };
    write_site(&contents, &options.folder, modules)
}

fn study_contents(study: &Path, registry: &Registry) -> Result<Contents<'static>, StudioError> {
    let graphs = vec![take_study(study, registry)?];
    Ok(Contents { graphs, cards: Vec::new(), pages: &PAGES_OF_STUDY, docs: None })
}

fn write_site(contents: &Contents<'_>, folder: &Path, modules: Modules<'_>) -> Result<Exported, StudioError> {
    // If the folder is a link, its target is replaced.
    let target = folder.canonicalize().or_else(|_| std::path::absolute(folder));
    let target = target.map_err(other)?;
    is_free(&target)?;
    let all: BTreeSet<PathBuf> =
        contents.graphs.iter().flat_map(|graph| graph.files.union(&graph.beside)).cloned().collect();
    if let Some(path) = all.iter().find(|path| has_unlicensed_clips(path)) {
        return Err(other(format!(
            "{} {}, or move it out of the folder of the graph",
            path.display(),
            bundle::UNLICENSED
        )));
    }
    let root = root_of(all.iter());
    let failed = |error: std::io::Error| other(format!("cannot export to {}: {error}", target.display()));
    let beside = target.parent().unwrap_or(Path::new("/"));
    std::fs::create_dir_all(beside).map_err(failed)?;
    // Removed by its destructor unless it takes the target's place.
    let whole = tempfile::Builder::new().prefix(".haptograph-site-").tempdir_in(beside).map_err(failed)?;
    let new = whole.path().join("new");
    let mut site = Site { folder: &new, exported: Exported { files: 0, bytes: 0 }, sha256: BTreeMap::new() };
    fill(&mut site, contents, (&all, &root), modules)?;
    let exported = site.exported;
    let old = whole.path().join("old");
    if let Err(error) = replace(&target, &new, &old) {
        if old.exists() {
            // The rollback failed too: the old site stays at its temporary path.
            let _ = whole.keep();
        }
        return Err(failed(error));
    }
    Ok(exported)
}

/// Writes the files of a site.
fn fill(
    site: &mut Site<'_>,
    contents: &Contents<'_>,
    (all, root): (&BTreeSet<PathBuf>, &Path),
    modules: Modules<'_>,
) -> Result<(), StudioError> {
    for path in all {
        let bytes = files::read(path, files::MAX_SITE_BYTES)
            .map_err(|error| other(format!("cannot read {}: {error}", path.display())))?;
        site.write(&Path::new("files").join(relative(path, root)), &bytes)?;
    }
    write_pages(site, contents.pages)?;
    let is_study = contents.cards.is_empty();
    for (name, module) in [MODULE, WHOLE].into_iter().zip(modules).skip(usize::from(is_study)) {
        site.write(Path::new(name), module)?;
    }
    let listed = listing(&contents.graphs, is_study, all, root);
    if !is_study {
        for (card, picture) in &contents.cards {
            let place = Path::new(card["picture"].as_str().unwrap_or_default());
            site.write(place, picture.as_bytes())?;
        }
        let names = contents.graphs.iter().map(|graph| (relative(&graph.path, root), graph.name.clone()));
        let docs = contents.docs.map(|folder| docs::write(site, folder, &names.collect()));
        let cards: Vec<&Value> = contents.cards.iter().map(|(card, _)| card).collect();
        let gallery = json!({ "cards": cards, "docs": docs.transpose()?.unwrap_or_default() });
        site.write(Path::new(gallery::LISTING), format!("{gallery:#}\n").as_bytes())?;
        // Another export has another worker, which browsers then fetch.
        let version = hash(json!(site.sha256).to_string().as_bytes());
        let worker = String::from_utf8_lossy(page_file(WORKER)).replacen(VERSION, &version, 1);
        site.write(Path::new(WORKER), worker.as_bytes())?;
    }
    site.write(Path::new(SITE), format!("{listed:#}\n").as_bytes())?;
    let files = json!({ "sha256": site.sha256 });
    site.write(Path::new(FILES), format!("{files:#}\n").as_bytes())
}

/// Replaces a folder; on failure the old one is restored.
fn replace(target: &Path, new: &Path, old: &Path) -> std::io::Result<()> {
    let was = match std::fs::rename(target, old) {
        Ok(()) => true,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => false,
        Err(error) => return Err(error),
    };
    std::fs::rename(new, target).inspect_err(|_| {
        if was {
            let _ = std::fs::rename(old, target);
        }
    })
}

/// Refuses a folder that contains anything but a site as it was exported.
fn is_free(folder: &Path) -> Result<(), StudioError> {
    let cannot = |error: std::io::Error| other(format!("cannot export to {}: {error}", folder.display()));
    match files::entries(folder) {
        Ok(mut entries) => {
            if entries.next().is_none() {
                return Ok(());
            }
        }
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(cannot(error)),
    }
    let read = |name: &str| -> Value {
        let text = files::read_text(&folder.join(name), files::MAX_SITE_BYTES).unwrap_or_default();
        serde_json::from_str(&text).unwrap_or_default()
    };
    if !read(SITE)["haptograph"].is_string() {
        return Err(other(format!(
            "{} holds other files than an exported site: export to an empty or new folder",
            folder.display()
        )));
    }
    match foreign(folder, &read(FILES)["sha256"]).map_err(cannot)? {
        Some(file) => Err(other(format!(
            "{} was not exported to this site, or was changed since, and would be lost: export to an empty or new folder",
            file.display()
        ))),
        None => Ok(()),
    }
}

/// A file below a site's folder that its list does not have with these bytes, such as a repository's history.
fn foreign(site: &Path, sha256: &Value) -> std::io::Result<Option<PathBuf>> {
    let mut folders = vec![site.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in files::entries(&folder)? {
            let (path, kind) = { entry.and_then(|entry| Ok((entry.path(), entry.file_type()?))) }?;
            if kind.is_dir() {
                folders.push(path);
                continue;
            }
            let name = relative(&path, site);
            let is_known = || {
                let bytes = files::read(&path, files::MAX_SITE_BYTES)?;
                std::io::Result::Ok(sha256[&name] == hash(&bytes))
            };
            if name != FILES && !(kind.is_file() && sha256[&name].is_string() && is_known()?) {
                return Ok(Some(path));
            }
        }
    }
    Ok(None)
}

/// The SHA-256 hash of bytes, in hexadecimal digits.
pub(super) fn hash(bytes: &[u8]) -> String {
    files::hex(&Sha256::digest(bytes))
}

/// Opens a graph as the page does, and collects the files that it needs there.
fn take(source: Source) -> Result<SiteGraph, StudioError> {
    let stage = Stage::open(source, page::HOST)?;
    let graph = &stage.loaded.graph;
    let files: BTreeSet<PathBuf> = bundle::needed(graph).map(|path| plain(&path)).collect();
    let beside = bundle::beside(stage.source.folder()).map(|path| plain(&path));
    let beside = beside.filter(|path| !files.contains(path)).collect();
    Ok(SiteGraph {
        name: stage.source.name(),
        about: graph.about().to_owned(),
        rate_hz: stage.signals.sound.as_ref().map_or(stage.signals.rate_hz, |sound| sound.rate_hz),
        path: stage.source.path.clone(),
        set: stage.source.set.clone(),
        files,
        beside,
    })
}

/// Checks a study as its pages do, and collects the files that it needs.
fn take_study(path: &Path, registry: &Registry) -> Result<SiteGraph, StudioError> {
    let ((stage, checked), files) = {
        let (opened, files) = files::noting_files(|| {
            let checked = Checked::load(path, None).map_err(other_study)?;
            if let Some(why) = cannot_be_a_site(&checked) {
                return Err(other(why));
            }
            checked.check_graph(registry).map_err(other_study)?;
            let (_, set) = Conductor::first(&checked, registry).map_err(other_study)?;
            let source = Source::new(checked.study.graph.clone(), registry, set);
            Ok((Stage::open(source, page::HOST)?, checked))
        });
        (opened?, files)
    };
    let (path, signals) = (path.canonicalize().map_err(other)?, &stage.signals);
    Ok(SiteGraph {
        name: path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        about: checked.study.about,
        rate_hz: signals.sound.as_ref().map_or(signals.rate_hz, |sound| sound.rate_hz),
        path,
        set: Vec::new(),
        files: files.into_iter().collect(),
        beside: BTreeSet::new(),
    })
}

/// Why a study cannot run in pages alone.
fn cannot_be_a_site(checked: &Checked) -> Option<String> {
    let study = &checked.study;
    let records = |(_, phase): &&(_, Phase)| matches!(phase, Phase::Record(_));
    if study.endpoints != SIMULATED {
        let endpoints = &study.endpoints;
        return Some(format!(
            "the study uses the endpoints `{endpoints}`, and a site has no devices: export a copy without `endpoints`"
        ));
    }
    let (name, _) = study.phases.0.iter().find(records)?;
    Some(format!(
        "phase `{}` records with a device, and a site has none: export a copy without it",
        name.text
    ))
}

/// True if a file is a surface that must not be given to others.
fn listing(graphs: &[SiteGraph], is_study: bool, all: &BTreeSet<PathBuf>, root: &Path) -> Value {
    let graphs = graphs.iter().map(|graph| {
        let set = graph.set.iter().map(|(name, value)| (name, set_relative(value, all, root)));
        json!({
            "name": graph.name, "about": graph.about, "path": relative(&graph.path, root),
            "set": set.collect::<Vec<_>>(), "rate_hz": graph.rate_hz,
            "files": graph.files.iter().map(|path| relative(path, root)).collect::<Vec<_>>(),
            "beside": graph.beside.iter().map(|path| relative(path, root)).collect::<Vec<_>>(),
        })
    });
    let mut graphs = graphs.collect::<Vec<_>>();
    let study = is_study.then(|| graphs.remove(0));
    let engine = if is_study { WHOLE } else { MODULE };
    json!({
        "haptograph": env!("CARGO_PKG_VERSION"), "engine": engine, "whole": WHOLE, "graphs": graphs, "study": study,
    })
}

/// Converts a value that names a file relative to the working directory to one relative to the site's root.
/// A page of a site: its file, the file that it is made of, and the tags that tell where its engine is.
type SitePage = (&'static str, &'static str, &'static str);
const SITE_TAG: &str = "<meta name=\"haptograph-site\" content=\"site.json\">";
/// The same, and the script that keeps the site for use without a network.
const TAGS: &str = "<meta name=\"haptograph-site\" content=\"site.json\"><script type=\"module\" src=\"offline.js\"></script>";
const PAGES_OF_GRAPHS: [SitePage; 2] =
    [("index.html", "gallery.html", TAGS), ("studio.html", "index.html", TAGS)];
const PAGES_OF_STUDY: [SitePage; 2] = [
    ("index.html", "experimenter.html", SITE_TAG),
    ("participant.html", "participant.html", "<meta name=\"haptograph-opener\">"),
];
/// The script that keeps a site for use without a network, and the place of its version.
const WORKER: &str = "sw.js";
const VERSION: &str = "VERSION OF THE SITE";

/// A file of the page.
pub(super) fn page_file(path: &str) -> &'static [u8] {
    PAGE.get_file(path).map_or(&[], |file| file.contents())
}

/// A page with the policy of a site and these tags in its head.
pub(super) fn with_head(page: &str, tags: &str) -> String {
    let head = format!("{HEAD}\n<meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">\n{tags}");
    page.replacen(HEAD, &head, 1)
}

/// Writes pages, whose heads tell the policy and where the engine is, and the files that these load.
fn write_pages(site: &mut Site, pages: &[SitePage]) -> Result<(), StudioError> {
    for (name, source, tags) in pages {
        let page = with_head(&String::from_utf8_lossy(page_file(source)), tags);
        site.write(Path::new(name), page.as_bytes())?;
    }
    let all = PAGE.files().chain(PAGE.dirs().flat_map(|folder| folder.files()));
    for file in all.filter(|file| is_served(file.path())) {
        site.write(file.path(), file.contents())?;
    }
    Ok(())
}

/// True for files that pages load and for licences; false for sources of the bundles and for the pages themselves.
fn is_served(path: &Path) -> bool {
    let ends = |ending: &str| path.to_string_lossy().ends_with(ending);
    let is_bundled = ends(".LICENSE") || ends(".js") && !ends(".entry.js");
    (!path.starts_with("vendor") || is_bundled) && !ends(".html") && path != Path::new(WORKER)
}

/// A site that is being written.
pub(super) struct Site<'a> {
    folder: &'a Path,
    exported: Exported,
    /// The hash of each file, by its name in the site.
    pub sha256: BTreeMap<String, String>,
}

impl Site<'_> {
    pub(super) fn write(&mut self, path: &Path, bytes: &[u8]) -> Result<(), StudioError> {
        let path = self.folder.join(path);
        let failed = |error: std::io::Error| other(format!("cannot write {}: {error}", path.display()));
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(failed)?;
        }
        std::fs::write(&path, bytes).map_err(failed)?;
        self.sha256.insert(relative(&path, self.folder), hash(bytes));
        self.exported.files += 1;
        self.exported.bytes += bytes.len() as u64;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_surfaces::files::load;
    use haptograph_surfaces::files::save;
    use haptograph_surfaces::layers::Clips;
    use haptograph_surfaces::provenance::LICENCE;
    use haptograph_surfaces::{Origin, Surface};

    const MODULES: Modules<'_> = [b"a module", b"a larger one"];

    fn shipped(name: &str) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs").join(name)
    }

    fn export(names: &[&str], folder: &Path) -> Result<Exported, StudioError> {
        let options = Export {
            graphs: names.iter().map(|name| shipped(name)).collect(),
            set: vec![("surface".to_owned(), "\"surfaces/t3-tile.ron\"".to_owned())],
            folder: folder.to_owned(),
            docs: Some(shipped("../docs")),
        };
        export_with(&options, &haptograph_nodes::registry(), MODULES)
    }

    #[test]
    fn a_site_has_all_that_its_graphs_need_and_refers_to_nothing_else() {
        let folder = tempfile::tempdir().expect("a folder");
        let exported = export(&["texturepad.ron"], folder.path()).expect("it is written");
        let text = std::fs::read_to_string(folder.path().join(SITE)).expect("it is listed");
        let site: Value = serde_json::from_str(&text).expect("JSON");
        assert_eq!(site["graphs"][0]["path"], "texturepad.ron");
        assert_eq!(site["graphs"][0]["rate_hz"], 48000.0);
        // First what it needs, then the surfaces that somebody may choose.
        assert_eq!(site["graphs"][0]["files"], json!(["surfaces/t3-tile.ron", "texturepad.ron"]));
        let beside = site["graphs"][0]["beside"].as_array().expect("a list");
        assert!(beside.contains(&json!("surfaces/t2-canvas.ron")) && beside.len() > 4, "{beside:?}");
        for file in
            ["files/texturepad.ron", "files/surfaces/t2-canvas.ron", "pictures/texturepad.svg", "sw.js"]
        {
            assert!(folder.path().join(file).is_file(), "{file}");
        }
        let read = |name: &str| std::fs::read_to_string(folder.path().join(name)).expect("a page");
        let page = read("studio.html");
        assert!(page.contains("wasm-unsafe-eval") && page.contains(SITE) && !page.contains("src=\"/"));
        assert!(read("index.html").contains("gallery.js") && !read("sw.js").contains(VERSION));
        let cookbook = read("docs/cookbook.html");
        assert!(cookbook.contains("id=\"a-click-at-a-force\"") && !cookbook.contains(".md"), "{cookbook}");
        assert!(read("docs/readme.html").contains("data-graph=\"texturepad\""));
        assert!(folder.path().join("vendor/codemirror.LICENSE").is_file() && exported.files > 100);
        // A second export replaces the first, but nothing else.
        export(&["omni.ron"], folder.path()).expect("it is written again");
        assert!(!folder.path().join("files/texturepad.ron").exists());
        for of_another in ["files/mine.txt", "vendor/notes/mine.txt", "index.html"] {
            let path = folder.path().join(of_another);
            let before = std::fs::read(&path);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
            std::fs::write(&path, "mine").expect("written");
            assert!(export(&["texturepad.ron"], folder.path()).is_err(), "{of_another}");
            assert_eq!(std::fs::read(&path).expect("it is there"), b"mine");
            match before {
                Ok(bytes) => std::fs::write(&path, bytes),
                Err(_) => std::fs::remove_file(&path),
            }
            .expect("as before");
        }
        std::fs::remove_file(folder.path().join(SITE)).expect("it was there");
        assert!(matches!(export(&["texturepad.ron"], folder.path()), Err(StudioError::Other(_))));
        assert!(folder.path().join("index.html").is_file(), "what was refused is as it was");
    }

    #[test]
    fn a_site_of_a_study_has_its_pages_and_what_they_read_and_no_devices() {
        let folder = tempfile::tempdir().expect("a folder");
        let export = |study: &Path| {
            let contents = study_contents(study, &haptograph_nodes::registry())?;
            write_site(&contents, &folder.path().join("site"), MODULES)
        };
        export(&shipped("studies/first.ron")).expect("it is written");
        let text = std::fs::read_to_string(folder.path().join("site").join(SITE)).expect("it is listed");
        let site: Value = serde_json::from_str(&text).expect("JSON");
        assert_eq!((&site["study"]["path"], &site["graphs"]), (&json!("studies/first.ron"), &json!([])));
        let surfaces = ["t2-canvas", "t3-tile", "t5-vinyl"].map(|name| format!("surfaces/{name}.ron"));
        let read = ["studies/first.ron".to_owned()].into_iter().chain(surfaces);
        assert_eq!(site["engine"], WHOLE);
        assert_eq!(site["study"]["files"], read.chain(["texturepad.ron".to_owned()]).collect::<Value>());
        let page = |name| std::fs::read_to_string(folder.path().join("site").join(name)).expect("a page");
        assert!(page("index.html").contains("experimenter.js") && page("index.html").contains(SITE));
        assert!(
            page("participant.html").contains("haptograph-opener")
                && !page("participant.html").contains(SITE)
        );
        let study = std::fs::read_to_string(shipped("studies/first.ron")).expect("it ships");
        let study = study.replace("\"../", &format!("\"{}/", shipped("").display()));
        let study = study.replace("canvas.ron\"", "canvas.ron\", sample: \"a\"");
        for (from, to) in [
            ("about:", "endpoints: \"live\", about:"),
            ("\"rating\": Rate(repeats: 2)", "\"a\": Record(surfaces: [\"canvas\"])"),
        ] {
            let path = folder.path().join("other.ron");
            std::fs::write(&path, study.replacen(from, to, 1)).expect("written");
            assert!(matches!(export(&path), Err(StudioError::Other(_))), "{to}");
        }
    }

    #[test]
    fn an_export_that_fails_leaves_the_old_site_and_nothing_else() {
        let folder = tempfile::tempdir().expect("a folder");
        let site = folder.path().join("site");
        export(&["texturepad.ron"], &site).expect("it is written");
        assert!(export(&["texturepad.ron", "texturepad.ron"], &site).is_err());
        let (new, old) = (folder.path().join("none"), folder.path().join("old"));
        assert!(replace(&site, &new, &old).is_err());
        assert!(site.join(SITE).is_file());
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 1);
    }

    #[test]
    fn clips_without_a_licence_are_not_given_to_everybody() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::copy(shipped("texturepad.ron"), folder.path().join("texturepad.ron")).expect("copied");
        std::fs::create_dir(folder.path().join("surfaces")).expect("made");
        let site = folder.path().join("site");
        let options = Export {
            graphs: vec![folder.path().join("texturepad.ron")],
            set: vec![],
            folder: site.clone(),
            docs: None,
        };
        let mut surface = load(&shipped("surfaces/t2-canvas.ron")).expect("it ships");
        let clips = Clips::new(&[0.3, -1.0, 0.2]).expect("an excitation");
        surface.texture = surface.texture.map(|texture| texture.with_clips(Some(clips)));
        surface.provenance.origin = Origin::Measured;
        let path = folder.path().join("surfaces/t2-canvas.ron");
        let exports = |surface: &Surface| {
            save(surface, &path).expect("saved");
            export_with(&options, &haptograph_nodes::registry(), MODULES).is_ok()
        };
        assert!(!exports(&surface) && !site.exists());
        surface.provenance = surface.provenance.with_setting(LICENCE, "CC-BY-4.0");
        assert!(exports(&surface));
    }

    #[test]
    fn a_gallery_shows_each_graph_with_a_picture_of_what_it_does() {
        let folder = tempfile::tempdir().expect("a folder");
        let graphs = vec![shipped("cookbook/click.ron"), shipped("two-drivers.ron")];
        let options = Export { graphs, set: vec![], folder: folder.path().join("site"), docs: None };
        export_with(&options, &haptograph_nodes::registry(), MODULES).expect("it is written");
        let text = std::fs::read_to_string(options.folder.join(gallery::LISTING)).expect("it is listed");
        let gallery: Value = serde_json::from_str(&text).expect("JSON");
        let of = |card: usize, name: &str| gallery["cards"][card][name].clone();
        assert_eq!(
            (of(0, "name"), of(0, "folder"), of(1, "name")),
            (json!("click"), json!("cookbook"), json!("two-drivers"))
        );
        let picture = options.folder.join("pictures/two-drivers.svg");
        assert!(std::fs::read_to_string(picture).expect("drawn").contains("simulated"));
    }

    #[test]
    fn what_no_page_can_run_is_refused_before_anything_is_written() {
        let folder = tempfile::tempdir().expect("a folder");
        let site = folder.path().join("site");
        for graphs in [&["texturepad.ron", "texturepad.ron"][..], &["surfaces/t2-canvas.ron"]] {
            assert!(export(graphs, &site).is_err(), "{graphs:?}");
            assert!(!site.exists());
        }
    }
}
