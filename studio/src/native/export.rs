//! Export as a static site: the page, the engine as WebAssembly, and the files of the graphs.

use super::assets::{ENGINE, PAGE};
use super::server::StudioError;
use crate::describe;
use crate::error::StageError;
use crate::load::{SIMULATED, Source};
use crate::page;
use crate::stage::Stage;
use haptograph_engine::registry::Registry;
use haptograph_signal::files;
use haptograph_study::check::{Checked, StudyError};
use haptograph_study::conduct::Conductor;
use haptograph_study::document::Phase;
use haptograph_surfaces::files::load;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

/// Content security policy of a site: its own files only. Only its engine is compiled.
const POLICY: &str = "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; img-src 'self' data: blob:; \
                      style-src 'self' 'unsafe-inline'; base-uri 'none'; form-action 'none'";
/// Part of the page's head to which an export adds tags.
const HEAD: &str = "<meta charset=\"utf-8\">";
const SITE: &str = "site.json";
const MODULE: &str = "engine.wasm";

/// Options of an export.
#[derive(Debug, Clone)]
pub struct Export {
    /// The graph files.
    pub graphs: Vec<PathBuf>,
    /// Parameters that override the defaults.
    pub set: Vec<(String, String)>,
    /// The folder of the site.
    pub folder: PathBuf,
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
    files: BTreeSet<PathBuf>,
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
    write_site((&[take_study(study, registry)?], &PAGES_OF_STUDY), folder, engine()?)
}

fn engine() -> Result<&'static [u8], StudioError> {
    match ENGINE {
        [] => Err(other(
            "this build of haptograph lacks the engine for pages: run `studio/build-site` in the sources and build again",
        )),
        engine => Ok(engine),
    }
}

fn export_with(options: &Export, registry: &Registry, module: &[u8]) -> Result<Exported, StudioError> {
    let graphs = options.graphs.iter().map(|path| take(path, &options.set, registry));
    let graphs = graphs.collect::<Result<Vec<_>, _>>()?;
    let mut names = BTreeSet::new();
    if let Some(twice) = graphs.iter().find(|graph| !names.insert(&graph.name)) {
        return Err(other(format!(
            "two graphs are called `{}`: give one of the files another name",
            twice.name
        )));
    }
    write_site((&graphs, &PAGE_OF_GRAPHS), &options.folder, module)
}

fn write_site(
    (graphs, pages): (&[SiteGraph], &[SitePage]),
    folder: &Path,
    module: &[u8],
) -> Result<Exported, StudioError> {
    // If the folder is a link, its target is replaced.
    let target = folder.canonicalize().or_else(|_| std::path::absolute(folder));
    let target = target.map_err(other)?;
    is_free(&target)?;
    let all: BTreeSet<&PathBuf> = graphs.iter().flat_map(|graph| &graph.files).collect();
    if let Some(path) = all.iter().find(|path| has_unlicensed_clips(path)) {
        return Err(other(format!(
            "{} contains clips of a recording without a licence, which a site would give to everybody: learn it again with --licence or --no-clips, or move it out of the folder of the graph",
            path.display()
        )));
    }
    let root = root_of(&all);
    let failed = |error: std::io::Error| other(format!("cannot export to {}: {error}", target.display()));
    let beside = target.parent().unwrap_or(Path::new("/"));
    std::fs::create_dir_all(beside).map_err(failed)?;
    // Removed by its destructor unless it takes the target's place.
    let whole = tempfile::Builder::new().prefix(".haptograph-site-").tempdir_in(beside).map_err(failed)?;
    let new = whole.path().join("new");
    let mut site = Site { folder: &new, exported: Exported { files: 0, bytes: 0 }, sha256: BTreeMap::new() };
    for path in &all {
        let bytes = files::read(path, files::MAX_SITE_BYTES)
            .map_err(|error| other(format!("cannot read {}: {error}", path.display())))?;
        site.write(&Path::new("files").join(in_site(path, &root)), &bytes)?;
    }
    write_pages(&mut site, pages)?;
    site.write(Path::new(MODULE), module)?;
    let mut listed = listing(graphs, pages.len() > 1, &all, &root);
    listed["sha256"] = json!(site.sha256);
    site.write(Path::new(SITE), format!("{listed:#}\n").as_bytes())?;
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
    let text = files::read_text(&folder.join(SITE), files::MAX_SITE_BYTES).unwrap_or_default();
    let site: Value = serde_json::from_str(&text).unwrap_or_default();
    if !site["haptograph"].is_string() {
        return Err(other(format!(
            "{} holds other files than an exported site: export to an empty or new folder",
            folder.display()
        )));
    }
    match foreign(folder, &site["sha256"]).map_err(cannot)? {
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
            let name = in_site(&path, site);
            let is_known = || {
                let bytes = files::read(&path, files::MAX_SITE_BYTES)?;
                std::io::Result::Ok(sha256[&name] == hash(&bytes))
            };
            if name != SITE && !(kind.is_file() && sha256[&name].is_string() && is_known()?) {
                return Ok(Some(path));
            }
        }
    }
    Ok(None)
}

/// The SHA-256 hash of bytes, in hexadecimal digits.
fn hash(bytes: &[u8]) -> String {
    files::hex(&Sha256::digest(bytes))
}

/// Loads a graph as the page does, and collects the files that it needs.
fn take(path: &Path, set: &[(String, String)], registry: &Registry) -> Result<SiteGraph, StudioError> {
    let source = Source::new(plain(path)?, registry, set.to_vec());
    let stage = Stage::open(source, page::HOST).map_err(|error| match error {
        StageError::Graph(wrong) => StudioError::Graph(wrong),
        error => other(format!("{}: {error}", path.display())),
    })?;
    let graph = &stage.loaded.graph;
    let sources = graph.sources().iter().filter(|source| source.is_file);
    let sources = sources.map(|source| source.path.clone());
    let named = graph.nodes().iter().flat_map(|node| node.files.clone());
    let surfaces = describe::surface_files(stage.source.folder());
    let files = sources.chain(named).chain(surfaces);
    let files: BTreeSet<PathBuf> = files.map(|path| plain(&path)).collect::<Result<_, _>>()?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(SiteGraph {
        name,
        about: graph.about().to_owned(),
        rate_hz: stage.signals.sound.as_ref().map_or(stage.signals.rate_hz, |sound| sound.rate_hz),
        path: stage.source.path.clone(),
        set: set.to_vec(),
        files,
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
fn has_unlicensed_clips(path: &Path) -> bool {
    load(path).is_ok_and(|surface| surface.has_unlicensed_clips())
}

/// An absolute path without `.` and `..`.
fn plain(path: &Path) -> Result<PathBuf, StudioError> {
    let absolute = std::path::absolute(path).map_err(other)?;
    let mut plain = PathBuf::new();
    for part in absolute.components() {
        match part {
            Component::ParentDir => {
                plain.pop();
            }
            part => plain.push(part),
        }
    }
    Ok(plain)
}

/// The deepest folder that contains all files.
fn root_of(all: &BTreeSet<&PathBuf>) -> PathBuf {
    let mut folders = all.iter().filter_map(|path| path.parent());
    let first = folders.next().unwrap_or(Path::new("")).to_owned();
    folders.fold(first, |root, folder| {
        let same = root.components().zip(folder.components());
        same.take_while(|(one, other)| one == other).map(|(one, _)| one).collect()
    })
}

/// Path of a file within the site, with `/` as separator.
fn in_site(path: &Path, root: &Path) -> String {
    let parts = path.strip_prefix(root).unwrap_or(path).components();
    let parts = parts.map(|part| part.as_os_str().to_string_lossy().into_owned());
    parts.collect::<Vec<_>>().join("/")
}

fn listing(graphs: &[SiteGraph], is_study: bool, all: &BTreeSet<&PathBuf>, root: &Path) -> Value {
    let graphs = graphs.iter().map(|graph| {
        let set = graph.set.iter().map(|(name, value)| (name, set_in_site(value, all, root)));
        json!({
            "name": graph.name, "about": graph.about, "path": in_site(&graph.path, root),
            "set": set.collect::<Vec<_>>(), "rate_hz": graph.rate_hz,
        })
    });
    let mut graphs = graphs.collect::<Vec<_>>();
    let study = is_study.then(|| graphs.remove(0));
    json!({
        "haptograph": env!("CARGO_PKG_VERSION"), "engine": MODULE, "graphs": graphs, "study": study,
        "files": all.iter().map(|path| in_site(path, root)).collect::<Vec<_>>(),
    })
}

/// Converts a value that names a file relative to the working directory to one relative to the site's root.
fn set_in_site(value: &str, all: &BTreeSet<&PathBuf>, root: &Path) -> String {
    let name = value.strip_prefix('"').and_then(|rest| rest.strip_suffix('"'));
    let path = name.and_then(|name| plain(Path::new(name)).ok());
    let known = path.filter(|path| all.contains(path));
    known.map_or_else(|| value.to_owned(), |path| format!("{:?}", in_site(&path, root)))
}

/// A page of a site: its file, the file that it is made of, and the tag that tells where its engine is.
type SitePage = (&'static str, &'static str, &'static str);
const SITE_TAG: &str = "<meta name=\"haptograph-site\" content=\"site.json\">";
const PAGE_OF_GRAPHS: [SitePage; 1] = [("index.html", "index.html", SITE_TAG)];
const PAGES_OF_STUDY: [SitePage; 2] = [
    ("index.html", "experimenter.html", SITE_TAG),
    ("participant.html", "participant.html", "<meta name=\"haptograph-opener\">"),
];

/// Writes pages, whose heads tell the policy and where the engine is, and the files that these load.
fn write_pages(site: &mut Site, pages: &[SitePage]) -> Result<(), StudioError> {
    let all = || PAGE.files().chain(PAGE.dirs().flat_map(|folder| folder.files()));
    for (name, source, tag) in pages {
        let head =
            format!("{HEAD}\n<meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">\n{tag}");
        let page =
            all().find(|file| file.path() == Path::new(source)).map_or(&[][..], |file| file.contents());
        site.write(Path::new(name), String::from_utf8_lossy(page).replacen(HEAD, &head, 1).as_bytes())?;
    }
    for file in all().filter(|file| is_served(file.path())) {
        site.write(file.path(), file.contents())?;
    }
    Ok(())
}

/// True for files that pages load and for licences; false for sources of the bundles and for the pages themselves.
fn is_served(path: &Path) -> bool {
    let ends = |ending: &str| path.to_string_lossy().ends_with(ending);
    let is_bundled = ends(".LICENSE") || ends(".js") && !ends(".entry.js");
    (!path.starts_with("vendor") || is_bundled) && !ends(".html")
}

struct Site<'a> {
    folder: &'a Path,
    exported: Exported,
    /// The hash of each file, by its name in the site.
    sha256: BTreeMap<String, String>,
}

impl Site<'_> {
    fn write(&mut self, path: &Path, bytes: &[u8]) -> Result<(), StudioError> {
        let path = self.folder.join(path);
        let failed = |error: std::io::Error| other(format!("cannot write {}: {error}", path.display()));
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(failed)?;
        }
        std::fs::write(&path, bytes).map_err(failed)?;
        self.sha256.insert(in_site(&path, self.folder), hash(bytes));
        self.exported.files += 1;
        self.exported.bytes += bytes.len() as u64;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_surfaces::files::save;
    use haptograph_surfaces::layers::Clips;
    use haptograph_surfaces::provenance::LICENCE;
    use haptograph_surfaces::{Origin, Surface};

    fn shipped(name: &str) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs").join(name)
    }

    fn export(names: &[&str], folder: &Path) -> Result<Exported, StudioError> {
        let options = Export {
            graphs: names.iter().map(|name| shipped(name)).collect(),
            set: vec![("surface".to_owned(), "\"surfaces/t3-tile.ron\"".to_owned())],
            folder: folder.to_owned(),
        };
        export_with(&options, &haptograph_nodes::registry(), b"a module")
    }

    #[test]
    fn a_site_has_all_that_its_graphs_need_and_refers_to_nothing_else() {
        let folder = tempfile::tempdir().expect("a folder");
        let exported = export(&["texturepad.ron"], folder.path()).expect("it is written");
        let text = std::fs::read_to_string(folder.path().join(SITE)).expect("it is listed");
        let site: Value = serde_json::from_str(&text).expect("JSON");
        assert_eq!(site["graphs"][0]["path"], "texturepad.ron");
        assert_eq!(site["graphs"][0]["rate_hz"], 48000.0);
        let files: Vec<&str> =
            site["files"].as_array().expect("a list").iter().filter_map(Value::as_str).collect();
        for needed in ["texturepad.ron", "surfaces/t2-canvas.ron", "surfaces/t3-tile.ron"] {
            assert!(files.contains(&needed), "{needed} of {files:?}");
            assert!(folder.path().join("files").join(needed).is_file(), "{needed}");
        }
        let page = std::fs::read_to_string(folder.path().join("index.html")).expect("a page");
        assert!(page.contains("wasm-unsafe-eval") && page.contains(SITE) && !page.contains("src=\"/"));
        assert!(folder.path().join("vendor/codemirror.LICENSE").is_file() && exported.files > files.len());
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
            let study = take_study(study, &haptograph_nodes::registry())?;
            write_site((&[study], &PAGES_OF_STUDY), &folder.path().join("site"), b"a module")
        };
        export(&shipped("studies/first.ron")).expect("it is written");
        let text = std::fs::read_to_string(folder.path().join("site").join(SITE)).expect("it is listed");
        let site: Value = serde_json::from_str(&text).expect("JSON");
        assert_eq!((&site["study"]["path"], &site["graphs"]), (&json!("studies/first.ron"), &json!([])));
        let surfaces = ["t2-canvas", "t3-tile", "t5-vinyl"].map(|name| format!("surfaces/{name}.ron"));
        let read = ["studies/first.ron".to_owned()].into_iter().chain(surfaces);
        assert_eq!(site["files"], read.chain(["texturepad.ron".to_owned()]).collect::<Value>());
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
        let options =
            Export { graphs: vec![folder.path().join("texturepad.ron")], set: vec![], folder: site.clone() };
        let mut surface = load(&shipped("surfaces/t2-canvas.ron")).expect("it ships");
        let clips = Clips::new(&[0.3, -1.0, 0.2]).expect("an excitation");
        surface.texture = surface.texture.map(|texture| texture.with_clips(Some(clips)));
        surface.provenance.origin = Origin::Measured;
        let path = folder.path().join("surfaces/t2-canvas.ron");
        let exports = |surface: &Surface| {
            save(surface, &path).expect("saved");
            export_with(&options, &haptograph_nodes::registry(), b"a module").is_ok()
        };
        assert!(!exports(&surface) && !site.exists());
        surface.provenance = surface.provenance.with_setting(LICENCE, "CC-BY-4.0");
        assert!(exports(&surface));
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
