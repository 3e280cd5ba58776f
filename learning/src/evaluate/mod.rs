//! Evaluation of virtual surfaces: the comparisons of thesis section 2.5, as data.
//!
//! - `tables`: virtual textures against recordings of all materials (Table 2.1) and of one material by several people (Table 2.2).
//! - [`map`]: virtual textures against each other, as points on a map (Fig. 2.11).
//! - `study`: a whole evaluation of recordings named `<material>.<person>.<take>`.
//! - [`parts`]: parts of a study, and their merge.
//! - [`holdout`]: textures and plain baselines on recordings that they were not learned from.
//! - `conditions`: textures that respond to force, speed, both or none (Fig. 4.9).
//! - [`mod@leave_one_out`]: kinds of maps on textures measured by others, with each model predicted from the
//!   rest.
//! - `scaling`, `clusters`: statistics of the map.

pub(crate) mod clusters;
pub(crate) mod conditions;
pub mod holdout;
pub mod leave_one_out;
pub mod map;
pub mod parts;
pub(crate) mod scaling;
pub(crate) mod study;
pub(crate) mod tables;

pub use clusters::{Merge, cut_tree, hierarchical, k_means, purity};
pub use conditions::{Condition, ConditionLoss, Responses, centre_of, condition_losses};
pub use holdout::{Holdout, HoldoutError, HoldoutSettings, Method, Split, hold_out, measure};
pub use leave_one_out::{LeaveOneOut, LeaveOneOutError, MapKind, Prediction, Summary, leave_one_out};
pub use map::{MapSettings, PerceptualMap, perceptual_map};
pub use parts::{StudyHead, StudyPart, StudyPartError};
pub use scaling::{Scaling, angle_deg, gradient, nonmetric_scaling};
pub use study::{
    Compared, Evaluation, RecordingName, Study, StudyError, StudySettings, Take, TakeSource, conclude,
};
pub use tables::{DifferenceTable, Reference, TableError, TableSettings, TestSet};
