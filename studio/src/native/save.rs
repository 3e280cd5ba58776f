//! Saving the text of a graph.

use super::lock;
use crate::stage::{Stage, StageError};
use crate::talk;
use std::sync::Mutex;

/// Writes a text to the graph's file, unless the file has changed since it was read.
pub fn save(stage: &Mutex<Stage>, text: &str) -> Result<String, StageError> {
    let (source, on_disk) = {
        let stage = lock(stage);
        (stage.source.clone(), stage.on_disk.clone())
    };
    let path = &source.path;
    let failed =
        |error: std::io::Error| StageError::Other(format!("cannot write {}: {error}", path.display()));
    if source.read().map_err(failed)? != on_disk {
        let why = format!(
            "{} was changed since it was read; nothing was written",
            path.display()
        );
        return Err(StageError::Other(why));
    }
    let written = || {
        let mut file = tempfile::NamedTempFile::new_in(source.folder())?;
        std::io::Write::write_all(&mut file, text.as_bytes())?;
        file.as_file().sync_all()?;
        file.as_file()
            .set_permissions(std::fs::metadata(path)?.permissions())?;
        // A link stays a link.
        file.persist(path.canonicalize()?).map_err(|error| error.error)
    };
    written().map_err(failed)?;
    let mut stage = lock(stage);
    text.clone_into(&mut stage.on_disk);
    talk::tell_graph(&mut stage);
    Ok("saved".to_owned())
}
