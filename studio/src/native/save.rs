//! Saving the text of a graph.

use super::lock;
use crate::error::StageError;
use crate::stage::Stage;
use crate::talk;
use haptograph_signal::files::write_atomically_by;
use std::io::Write;
use std::sync::Mutex;

/// Writes a text to the graph's file, unless the file has changed since it was read.
pub(super) fn save(stage: &Mutex<Stage>, text: &str) -> Result<String, StageError> {
    let (source, on_disk) = {
        let stage = lock(stage);
        (stage.source.clone(), stage.on_disk.clone())
    };
    let path = &source.path;
    let failed =
        |error: std::io::Error| StageError::Other(format!("cannot write {}: {error}", path.display()));
    if source.read().map_err(failed)? != on_disk {
        let why = format!("{} was changed since it was read; nothing was written", path.display());
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
