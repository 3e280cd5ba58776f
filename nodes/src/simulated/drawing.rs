//! Strokes, as settings.

use super::stroke::{StrokeSettings, StrokeShape, Trajectory};
use haptograph_engine::node::BuildError;
use haptograph_signal::files::{self, MAX_RECORDING_BYTES};
use haptograph_signal::units::Millimetres;
use std::path::PathBuf;
use std::sync::Arc;

haptograph_engine::choices! {
    /// The stroke of a simulated hand, centred on the surface.
    pub(crate) enum Drawing {
        /// The tip rests in the centre.
        Still,
        /// Circles.
        Circles(CirclesSettings),
        /// To and fro along x, creeping along y and back.
        ZigZag(ZigZagSettings),
        /// Words of cursive loops, the tip lifted between them.
        Writing(WritingSettings),
        /// Aimless exploration of a square.
        Wander(WanderSettings),
        /// Straight strokes, each from rest.
        FromRest(FromRestSettings),
        /// A path from a CSV file.
        Path(PathSettings),
    }
}

haptograph_engine::settings! {
    /// Circles.
    pub struct CirclesSettings {
        /// Radius, mm.
        radius_mm: Millimetres = Millimetres(30.0), in 0.001..=10_000.0;
        /// Time of one circle, s.
        period_s: f64 = 1.2, in 0.01..=10_000.0;
    }
}

haptograph_engine::settings! {
    /// A zig-zag.
    pub struct ZigZagSettings {
        /// Extent along x, mm.
        width_mm: Millimetres = Millimetres(80.0), in 0.001..=10_000.0;
        /// Extent along y, mm.
        height_mm: Millimetres = Millimetres(40.0), in 0.0..=10_000.0;
        /// Time of one to-and-fro, s.
        period_s: f64 = 1.0, in 0.01..=10_000.0;
    }
}

haptograph_engine::settings! {
    /// Strokes from rest.
    pub struct FromRestSettings {
        /// Side of the square, mm.
        side_mm: Millimetres = Millimetres(60.0), in 0.001..=10_000.0;
    }
}

haptograph_engine::settings! {
    /// Handwriting.
    pub struct WritingSettings {
        /// Height of the letters, mm.
        letter_mm: Millimetres = Millimetres(6.0), in 0.001..=10_000.0;
        /// Length of a line, mm.
        line_mm: Millimetres = Millimetres(100.0), in 0.001..=10_000.0;
    }
}

haptograph_engine::settings! {
    /// Exploration.
    pub struct WanderSettings {
        /// Side of the square that holds two thirds of it, mm.
        side_mm: Millimetres = Millimetres(60.0), in 0.001..=10_000.0;
        /// Fastest oscillation, Hz.
        fastest_hz: f64 = 1.5, in 0.01..=20.0;
    }
}

haptograph_engine::settings! {
    /// A recorded path.
    pub struct PathSettings {
        /// CSV file with the columns `time_s`, `x_mm`, `y_mm` and `force_n`, relative to the graph file. Semicolons, tabs and
        /// decimal commas are read as in recordings.
        file: PathBuf;
    }
}

haptograph_engine::settings! {
    /// A stroke with force and variation.
    pub struct DrawingSettings {
        /// The stroke: Still, Circles, ZigZag, Writing, Wander, or the Path of a file.
        stroke: Drawing = Drawing::Circles(CirclesSettings { radius_mm: Millimetres(30.0), period_s: 1.2 });
        /// Mean normal force, N; a path has its own.
        force_n: f64 = 1.0, in 0.0..=50.0;
        /// Standard deviation of the force as a fraction of its mean.
        force_variation: f64 = 0.2, in 0.0..=0.3;
        /// Standard deviation of the pace as a fraction of its mean.
        pace_variation: f64 = 0.15, in 0.0..=0.3;
        /// Standard deviation of the size as a fraction.
        size_variation: f64 = 0.05, in 0.0..=0.3;
    }
}

impl DrawingSettings {
    /// The stroke in SI.
    ///
    /// # Errors
    /// [`BuildError`] if the file of a path is invalid.
    pub(crate) fn to_stroke(&self) -> Result<StrokeSettings, BuildError> {
        Ok(StrokeSettings {
            shape: shape(&self.stroke)?,
            force_n: self.force_n,
            force_variation: self.force_variation,
            pace_variation: self.pace_variation,
            size_variation: self.size_variation,
        })
    }
}

fn shape(stroke: &Drawing) -> Result<StrokeShape, BuildError> {
    Ok(match stroke {
        Drawing::Still => StrokeShape::Still,
        Drawing::Circles(circles) => {
            StrokeShape::Circles { radius_m: circles.radius_mm.si(), period_s: circles.period_s }
        }
        Drawing::ZigZag(zig_zag) => StrokeShape::ZigZag {
            width_m: zig_zag.width_mm.si(),
            height_m: zig_zag.height_mm.si(),
            period_s: zig_zag.period_s,
        },
        Drawing::Writing(writing) => {
            StrokeShape::Writing { letter_m: writing.letter_mm.si(), line_m: writing.line_mm.si() }
        }
        Drawing::FromRest(strokes) => StrokeShape::FromRest { side_m: strokes.side_mm.si() },
        Drawing::Wander(wander) => {
            StrokeShape::Wander { side_m: wander.side_mm.si(), fastest_hz: wander.fastest_hz }
        }
        Drawing::Path(PathSettings { file }) => {
            let failed = |error: &dyn std::error::Error| {
                let message = format!("{}: {error}", file.display());
                BuildError::at("stroke", message).help("give a CSV file with time_s, x_mm, y_mm and force_n")
            };
            let source = files::open(file, MAX_RECORDING_BYTES).map_err(|error| failed(&error))?;
            StrokeShape::Recorded(Arc::new(Trajectory::from_csv(source).map_err(|error| failed(&error))?))
        }
    })
}

#[cfg(test)]
mod tests {
    use super::super::stroke::Stroke;
    use super::*;

    #[test]
    fn a_path_is_read_from_its_file_and_a_missing_one_is_an_error_at_the_stroke() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("path.csv");
        std::fs::write(&file, "time_s,x_mm,y_mm,force_n\n0,0,0,1\n1,10,0,2\n2,20,0,1\n").unwrap();
        let settings = |file: PathBuf| DrawingSettings {
            stroke: Drawing::Path(PathSettings { file }),
            force_n: 0.0,
            force_variation: 0.0,
            pace_variation: 0.0,
            size_variation: 0.0,
        };
        let stroke = Stroke::new(settings(file).to_stroke().unwrap(), 1).unwrap();
        let middle = stroke.at(1.0);
        assert!((middle.position_m[0] - 0.01).abs() < 1e-12 && (middle.force_n - 2.0).abs() < 1e-12);
        let refused = settings("nowhere.csv".into()).to_stroke().err();
        assert_eq!(refused.and_then(|e| e.field), Some("stroke"));
    }
}
