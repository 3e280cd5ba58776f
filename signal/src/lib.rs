//! The words and mathematics that all of haptograph shares: quantities and units, exact time, seeded noise,
//! filters, resampling and spectra. Knows nothing of graphs or of surfaces.

pub mod quantity;
pub mod time;
