//! Syncs written files to the disk on a thread of its own, because a sync can take long.

use std::fs::File;
use std::sync::OnceLock;
use std::sync::mpsc::{SyncSender, sync_channel};

/// Largest queue of files; a file that finds it full is synced a second later.
const WAITING: usize = 64;

/// Queues a sync of `file`, so that its data survive a loss of power.
pub(super) fn request(file: &File) {
    static THREAD: OnceLock<Option<SyncSender<File>>> = OnceLock::new();
    let thread = THREAD.get_or_init(|| {
        let (requests, files) = sync_channel::<File>(WAITING);
        let thread = std::thread::Builder::new().name("haptograph-sync".into());
        let started = thread.spawn(move || {
            for file in files {
                // The writer gets the same error and reports it.
                let _ = file.sync_data();
            }
        });
        started.ok().map(|_| requests)
    });
    if let (Some(thread), Ok(file)) = (thread, file.try_clone()) {
        let _ = thread.try_send(file);
    }
}
