//! Saving the text of a graph.

use super::lock;
use crate::bundle;
use crate::error::StageError;
use crate::load::Copies;
use crate::stage::Stage;
use crate::talk;
use haptograph_engine::graph::Graph;
use haptograph_signal::files::{self, write_atomically_by};
use std::io::{self, Write};
use std::path::Path;
use std::sync::Mutex;

/// Copies a file to its place, unless one is there.
pub(super) fn copy(copies: &Copies, path: &Path) -> io::Result<()> {
    let place = copies.place(path);
    if place.exists() {
        return Ok(());
    }
    files::create_folder(place.parent().unwrap_or(Path::new(".")))?;
    files::copy_atomically(path, &place)
}

/// Writes the text of a loaded graph to its file, unless the file has changed since it was read.
pub(super) fn save(stage: &Mutex<Stage>, text: &str, graph: &Graph) -> Result<String, StageError> {
    let (source, on_disk) = {
        let stage = lock(stage);
        (stage.source.clone(), stage.on_disk.clone())
    };
    let path = &source.saved();
    let failed = |error: io::Error| StageError::Other(format!("cannot write {}: {error}", path.display()));
    if let Some(copies) = &source.copies {
        // The graph goes on where it is; the copy has all that it needs.
        let files = bundle::needed(graph).chain(bundle::beside(source.folder()));
        { files }.try_for_each(|path| copy(copies, &path)).map_err(failed)?;
    }
    if files::read_text(path, files::MAX_SITE_BYTES).map_err(failed)? != on_disk {
        let path = path.display();
        let why = match source.copies {
            None => format!("{path} was changed since it was read; nothing was written"),
            Some(_) => format!(
                "{path} is there with another text; open it by `haptograph studio {path}`, or move it"
            ),
        };
        return Err(StageError::Other(why));
    }
    // A link stays a link.
    let written = path.canonicalize().and_then(|path| {
        let permissions = std::fs::metadata(&path)?.permissions();
        write_atomically_by(&path, |file| {
            file.set_permissions(permissions)?;
            file.write_all(text.as_bytes())
        })
    });
    written.map_err(failed)?;
    let mut stage = lock(stage);
    text.clone_into(&mut stage.on_disk);
    talk::tell_graph(&mut stage);
    Ok("saved".to_owned())
}
