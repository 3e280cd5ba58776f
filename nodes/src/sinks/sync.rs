//! Handing what was written to the disk itself, away from the thread that writes: that may take long.

use std::fs::File;
use std::sync::OnceLock;
use std::sync::mpsc::{SyncSender, sync_channel};

/// Files that wait at most; those that find no room have their turn a second later.
const WAITING: usize = 64;

/// Asks that what was written to `file` soon survives the loss of power.
pub(super) fn request(file: &File) {
    static THREAD: OnceLock<Option<SyncSender<File>>> = OnceLock::new();
    let thread = THREAD.get_or_init(|| {
        let (requests, files) = sync_channel::<File>(WAITING);
        let thread = std::thread::Builder::new().name("haptograph-sync".into());
        let started = thread.spawn(move || {
            for file in files {
                // The writer gets the same error, where it is said.
                let _ = file.sync_data();
            }
        });
        started.ok().map(|_| requests)
    });
    if let (Some(thread), Ok(file)) = (thread, file.try_clone()) {
        let _ = thread.try_send(file);
    }
}
