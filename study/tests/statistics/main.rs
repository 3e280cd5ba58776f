//! Statistics of studies: agreement with R, with the thesis's printed numbers, calibration, and odd input.
#![allow(clippy::unwrap_used)]

mod calibration;
mod fits;
mod odd_input;
mod people;
mod reference;
mod thesis;
