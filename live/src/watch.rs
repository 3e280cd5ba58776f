//! Watches the files of a graph by polling times and lengths, which works with every editor and file system
//! and costs little.

use haptograph_engine::graph::Graph;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// The files of a graph: its own, included ones, and those named by settings.
#[derive(Debug)]
pub struct FileWatch {
    files: Vec<(PathBuf, Stamp)>,
    /// A change was seen at the last poll; it is reported when the next poll finds no further one, since the
    /// file is then complete.
    settling: bool,
}

/// Time and length; `None` while the file is missing, since some editors write a new file and rename it.
pub(crate) type Stamp = Option<(SystemTime, u64)>;

impl FileWatch {
    /// From the present state of the files on.
    pub fn of(graph: &Graph) -> Self {
        let sources = graph.sources().iter().filter(|source| source.is_file);
        let sources = sources.map(|source| source.path.clone());
        let named = graph.nodes().iter().flat_map(|node| node.files.clone());
        let mut paths: Vec<PathBuf> = sources.chain(named).collect();
        paths.sort();
        paths.dedup();
        Self {
            files: paths
                .into_iter()
                .filter_map(|path| stamp(&path).map(|stamp| (path, Some(stamp))))
                .collect(),
            settling: false,
        }
    }

    /// Also watches the files of another graph; pending changes of files already watched stay pending.
    #[cfg(feature = "supervisor")]
    pub(crate) fn also(&mut self, other: Self) {
        for (path, stamp) in other.files {
            if !self.files.iter().any(|(known, _)| *known == path) {
                self.files.push((path, stamp));
            }
        }
    }

    /// Watches the files of another graph instead; pending changes of files in both stay pending.
    #[cfg(feature = "supervisor")]
    pub(crate) fn turn_to(&mut self, other: Self) {
        let before = std::mem::replace(&mut self.files, other.files);
        for (path, stamp) in &mut self.files {
            if let Some((_, known)) = before.iter().find(|(known, _)| known == path) {
                *stamp = *known;
            }
        }
    }

    /// True once per change.
    pub fn has_changed(&mut self) -> bool {
        let (mut new, mut gone) = (false, false);
        for (path, known) in &mut self.files {
            let now = stamp(path);
            new |= now != *known;
            gone |= now.is_none();
            *known = now;
        }
        if new || gone {
            self.settling |= new;
            return false;
        }
        std::mem::take(&mut self.settling)
    }
}

/// Modification time and length of a file; `None` if it does not exist.
pub(crate) fn stamp(path: &Path) -> Stamp {
    let facts = std::fs::metadata(path).ok()?;
    Some((facts.modified().ok()?, facts.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::document::Document;
    use haptograph_engine::graph::{CheckOptions, check};

    #[test]
    fn a_change_is_seen_once_and_only_when_it_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("g.ron");
        let text = r#"Graph(format: 1, clocks: { "servo": Driver(rate_hz: 1000) },
            nodes: { "one": Constant(clock: "servo", value: 1, quantity: "number") })"#;
        std::fs::write(&path, text).unwrap();
        let document = Document::load(&path, &Default::default()).unwrap();
        let graph = check(&document, &haptograph_nodes::registry(), &CheckOptions::default()).unwrap();
        let mut watch = FileWatch::of(&graph);
        assert!(!watch.has_changed());
        std::fs::remove_file(&path).unwrap();
        assert!(!watch.has_changed() && !watch.has_changed());
        std::fs::write(&path, format!("{text} ")).unwrap();
        assert!(!watch.has_changed(), "it may still be being written");
        assert!(watch.has_changed());
        assert!(!watch.has_changed());
        std::fs::write(&path, format!("{text}  ")).unwrap();
        watch.also(FileWatch::of(&graph));
        assert!(!watch.has_changed());
        assert!(watch.has_changed(), "it was saved before");
        std::fs::write(&path, format!("{text}   ")).unwrap();
        watch.turn_to(FileWatch::of(&graph));
        assert!(!watch.has_changed());
        assert!(watch.has_changed(), "it was saved while it was loaded");
    }
}
