//! Learning: from a processed recording to the parts of a surface (thesis 2.2.3, 2.3, 4.2).

pub mod segmentation;
