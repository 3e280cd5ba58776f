//! Size limits of the files that are read: one for each kind of file, bytes.

/// A graph with the files that it includes, or the list of its fingerprints: a hundred thousand nodes.
pub const MAX_GRAPH_BYTES: u64 = 16 << 20;
/// A surface.
pub const MAX_SURFACE_BYTES: u64 = 64 << 20;
/// A recording or other table of samples: an hour of raw recording.
pub const MAX_RECORDING_BYTES: u64 = 4 << 30;
/// A table that a node plays; its numbers take up to four times as much memory.
pub const MAX_TABLE_BYTES: u64 = 1 << 30;
/// Samples of a channel that are held in memory, 2 GiB: an hour and a half at 48 kHz.
pub const MAX_SAMPLES: u64 = 1 << 28;
/// Triangles of a mesh; each takes up to 600 bytes while it is read.
pub const MAX_TRIANGLES: usize = 5_000_000;
/// A mesh: about five million triangles.
pub const MAX_MESH_BYTES: u64 = 256 << 20;
/// A picture: an uncompressed one of 2048 by 2048 pixels, with room for notes.
pub const MAX_PICTURE_BYTES: u64 = 64 << 20;
/// The plan of a data set.
pub const MAX_PLAN_BYTES: u64 = 16 << 20;
/// A table of jobs of a data set: ten million.
pub const MAX_JOBS_BYTES: u64 = 512 << 20;
/// A list of written files with their hashes: those of a folder or of the largest data set.
pub const MAX_MANIFEST_BYTES: u64 = 256 << 20;
/// The footer of a chunk of a data set in Parquet: two thousand groups of rows.
pub const MAX_FOOTER_BYTES: u64 = 64 << 20;
/// The facts of a run, or its page.
pub const MAX_REPORT_BYTES: u64 = 64 << 20;
/// A part of an evaluation.
pub const MAX_PART_BYTES: u64 = 1 << 30;
/// A file of a site.
pub const MAX_SITE_BYTES: u64 = 256 << 20;
/// A note beside a file, the head of a recording, or a setting of the system.
pub const MAX_NOTE_BYTES: u64 = 1 << 20;
