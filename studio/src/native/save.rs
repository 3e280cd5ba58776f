//! Saving the text of a graph.

use crate::stage::{Stage, StageError};

/// Writes a text to the graph's file, unless somebody else did since it was read.
pub fn save(stage: &mut Stage, text: &str) -> Result<String, StageError> {
    let path = stage.source.path.clone();
    let failed =
        |error: std::io::Error| StageError::Other(format!("cannot write {}: {error}", path.display()));
    if stage.source.read().map_err(failed)? != stage.on_disk {
        let why = format!(
            "{} was changed since it was read; nothing is written",
            path.display()
        );
        return Err(StageError::Other(why));
    }
    let written = || {
        let mut file = tempfile::NamedTempFile::new_in(stage.source.folder())?;
        std::io::Write::write_all(&mut file, text.as_bytes())?;
        file.as_file().sync_all()?;
        file.as_file()
            .set_permissions(std::fs::metadata(&path)?.permissions())?;
        // A link stays one.
        file.persist(path.canonicalize()?).map_err(|error| error.error)
    };
    written().map_err(failed)?;
    text.clone_into(&mut stage.on_disk);
    Ok("saved".to_owned())
}
