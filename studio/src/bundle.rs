//! The files that a graph needs, and these as one bundle for another machine.

use super::error::StageError;
use super::load::{Loaded, Source};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use haptograph_engine::graph::Graph;
use haptograph_signal::files;
use haptograph_surfaces::files::load;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};

/// The files that a graph needs: its own, and those that its nodes name.
pub(crate) fn needed(graph: &Graph) -> impl Iterator<Item = PathBuf> {
    let sources = graph.sources().iter().filter(|source| source.is_file);
    let sources = sources.map(|source| source.path.clone());
    sources.chain(graph.nodes().iter().flat_map(|node| node.files.clone()))
}

/// The surfaces in a graph's folder.
#[cfg(not(target_family = "wasm"))]
pub(crate) fn beside(folder: &Path) -> impl Iterator<Item = PathBuf> {
    crate::describe::surface_files(folder).into_iter().filter(|path| load(path).is_ok())
}

/// The running text of a graph and the files that it needs, with paths below one folder, and the arguments that
/// open it there.
///
/// # Errors
/// [`StageError`] for a file that cannot be read or given away, and for more than [`files::MAX_SITE_BYTES`].
pub(crate) fn bundle(source: &Source, loaded: &Loaded) -> Result<Value, StageError> {
    let own = plain(&source.path);
    let all: BTreeSet<PathBuf> = needed(&loaded.graph).map(|path| plain(&path)).collect();
    let root = root_of(all.iter());
    let mut length = 0;
    let mut contents = Vec::new();
    for path in &all {
        let failed = |why: String| StageError::Other(format!("{}: {why}", path.display()));
        if has_unlicensed_clips(path) {
            return Err(failed(format!("it {UNLICENSED}")));
        }
        if path.is_absolute() && loaded.text.contains(&*path.to_string_lossy()) {
            let why = "the graph names it by this path, which another machine does not have; name it relative to the graph";
            return Err(failed(why.to_owned()));
        }
        let bytes = match *path == own {
            true => loaded.text.clone().into_bytes(),
            false => files::read(path, files::MAX_SITE_BYTES).map_err(|error| failed(error.to_string()))?,
        };
        length += bytes.len() as u64;
        if length > files::MAX_SITE_BYTES {
            return Err(failed("the graph and its files are too large for an archive".to_owned()));
        }
        contents.push(json!({ "path": relative(path, &root), "base64": STANDARD.encode(bytes) }));
    }
    let set = source.set.iter().map(|(name, value)| {
        // Paths from a page are relative to the graph's folder.
        let beside = Path::new(value.trim_matches('"'));
        let beside = plain(&source.folder().join(beside));
        let value =
            if all.contains(&beside) { quoted(&beside, &root) } else { set_relative(value, &all, &root) };
        (name, value)
    });
    Ok(json!({
        "graph": relative(&own, &root), "set": set.collect::<Vec<_>>(), "files": contents,
    }))
}

/// Why a surface cannot be given away, and what to do.
pub(crate) const UNLICENSED: &str = "contains clips of a recording without a licence, which everybody would be given: learn it again with --licence or --no-clips";

pub(crate) fn has_unlicensed_clips(path: &Path) -> bool {
    load(path).is_ok_and(|surface| surface.has_unlicensed_clips())
}

/// A path without `.` and `..`, absolute where there is a working directory.
pub(crate) fn plain(path: &Path) -> PathBuf {
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let mut plain = PathBuf::new();
    for part in absolute.components() {
        match part {
            Component::ParentDir => {
                plain.pop();
            }
            Component::CurDir => {}
            part => plain.push(part),
        }
    }
    plain
}

/// The deepest folder that contains all files.
pub(crate) fn root_of<'a>(all: impl Iterator<Item = &'a PathBuf>) -> PathBuf {
    let mut folders = all.filter_map(|path| path.parent());
    let first = folders.next().unwrap_or(Path::new("")).to_owned();
    folders.fold(first, |root, folder| {
        let same = root.components().zip(folder.components());
        same.take_while(|(one, other)| one == other).map(|(one, _)| one).collect()
    })
}

/// Path of a file relative to a folder, with `/` as separator.
pub(crate) fn relative(path: &Path, root: &Path) -> String {
    let parts = path.strip_prefix(root).unwrap_or(path).components();
    let parts = parts.map(|part| part.as_os_str().to_string_lossy().into_owned());
    parts.collect::<Vec<_>>().join("/")
}

/// Value of a parameter, with the path of a known file relative to a folder.
pub(crate) fn set_relative(value: &str, all: &BTreeSet<PathBuf>, root: &Path) -> String {
    let name = value.strip_prefix('"').and_then(|rest| rest.strip_suffix('"'));
    let path = name.map(|name| plain(Path::new(name))).filter(|path| all.contains(path));
    path.map_or_else(|| value.to_owned(), |path| quoted(&path, root))
}

fn quoted(path: &Path, root: &Path) -> String {
    format!("{:?}", relative(path, root))
}
