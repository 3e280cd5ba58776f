//! The signal processing of haptograph: quantities and units, exact time, seeded noise, filters, resampling and
//! spectra; bounded reading and atomic writing of files; the reader of CSV tables; and suggestions for misspelt names. It does not depend on graphs or
//! surfaces.

#![cfg_attr(not(test), warn(unreachable_pub))]

pub mod arma;
pub mod csv;
pub mod elementwise;
pub mod fft;
pub mod files;
pub mod filter;
pub mod instructions;
pub mod laws;
pub mod noise;
pub mod parallel;
pub mod prediction;
pub mod quantity;
pub mod resample;
pub mod sine;
pub mod spectrum;
pub mod spelling;
pub mod statistics;
pub mod time;
pub mod units;
pub mod vector;
pub mod warped;
pub mod window;

pub use rustfft::num_complex::Complex64;
