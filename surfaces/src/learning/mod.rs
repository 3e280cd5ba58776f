//! Learning: from recordings to the parts of a surface (thesis 2.2.3, 2.3, 4.2).

pub mod processing;
pub mod segmentation;
