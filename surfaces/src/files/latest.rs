//! The surfaces that were read last, by the bytes of their files: a graph names the same surface in several nodes and
//! is loaded again at every edit.

use super::{ReadError, read_surface};
use crate::Surface;
use std::sync::{Mutex, PoisonError};

/// Number of surfaces that are kept, and the largest file of which one is kept, bytes.
const FILES: usize = 8;
const MAX_KEPT_BYTES: usize = 1 << 20;

/// The latest last.
static LATEST: Mutex<Vec<(Box<[u8]>, Surface)>> = Mutex::new(Vec::new());

/// The surface that [`read_surface`] makes of these bytes.
pub(super) fn read(bytes: &[u8]) -> Result<Surface, ReadError> {
    let latest = || LATEST.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(surface) = found(&mut latest(), bytes) {
        return Ok(surface);
    }
    let surface = read_surface(bytes)?;
    if bytes.len() <= MAX_KEPT_BYTES {
        let mut latest = latest();
        let surplus = (latest.len() + 1).saturating_sub(FILES);
        latest.drain(..surplus);
        latest.push((bytes.into(), surface.clone()));
    }
    Ok(surface)
}

fn found(latest: &mut Vec<(Box<[u8]>, Surface)>, bytes: &[u8]) -> Option<Surface> {
    let place = latest.iter().position(|(known, _)| **known == *bytes)?;
    let entry = latest.remove(place);
    let surface = entry.1.clone();
    latest.push(entry);
    Some(surface)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_is_what_the_bytes_say_and_no_more_than_a_few() {
        let file = |mu: f64| {
            let provenance = r#"(origin: procedural, source: "", made_by: "")"#;
            let text =
                format!(r#"Surface(format: 1, name: "a", provenance: {provenance}, friction: (mu: {mu:?}))"#);
            text.into_bytes()
        };
        let plain = read_surface(&file(0.25)).expect("a surface");
        assert_eq!(read(&file(0.25)).as_ref(), Ok(&plain));
        for turn in 0..2 * FILES {
            let bytes = file(0.25 + turn as f64);
            let surface = read_surface(&bytes).expect("a surface");
            // Twice: read, then found.
            assert_eq!((read(&bytes).as_ref(), read(&bytes).as_ref()), (Ok(&surface), Ok(&surface)));
        }
        assert!(read(b"no surface").is_err() && read(b"no surface").is_err());
        assert!(LATEST.lock().expect("whole").len() <= FILES);
        assert_eq!(read(&file(0.25)).as_ref(), Ok(&plain));
    }
}
