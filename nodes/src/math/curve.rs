//! A function that is given by points.

use crate::csv_table::{self, at_file, si_of_column};
use haptograph_engine::frame::Scalar;
use haptograph_engine::node::{BuildContext, BuildError, Built, Io, NodeKind, Port, Processor, Tick};
use haptograph_signal::csv::CsvError;
use haptograph_signal::units;
use std::path::PathBuf;

haptograph_engine::choices! {
    /// Interpolation between two points of a [`Curve`].
    pub enum Between {
        /// A straight line.
        Linear,
        /// A cubic that never leaves the range of the two points (Fritsch and Butland 1984).
        Smooth,
        /// The value of the point before.
        Hold,
    }
}

haptograph_engine::choices! {
    /// Values beyond the points of a [`Curve`].
    pub(crate) enum Beyond {
        /// The value of the nearest point.
        Hold,
        /// The curve repeats; the last point coincides with the first.
        Repeat,
    }
}

haptograph_engine::settings! {
    /// Settings of [`Curve`].
    pub struct CurveSettings {
        /// Points `[x, y]` with x rising, at least two, both in the SI units of the signals. Give them here or in
        /// `file`.
        points: Vec<[f64; 2]> = Vec::new();
        /// A CSV file with a header and a point in each row, relative to the graph file, in place of `points`. The units at
        /// the end of its columns' names, as in `force_n` and `depth_mm`, are converted to SI. Semicolons, tabs and decimal
        /// commas are read as in recordings.
        file: Option<PathBuf> = None;
        /// The header of the column of x; none: the first column.
        x_column: Option<String> = None;
        /// The header of the column of y; none: the second column.
        y_column: Option<String> = None;
        /// Interpolation between the points.
        between: Between = Between::Linear;
        /// Values beyond the points.
        beyond: Beyond = Beyond::Hold;
        /// Quantity of the output, by name.
        quantity: String = "number".into();
    }
}

haptograph_engine::node! {
    /// A function of a scalar that is given by points, a lookup table: the characteristic of a sensor, the map from force
    /// to loudness, the profile of a surface over position, a force over depth. The points are written in the graph or come
    /// from two columns of a CSV file: `file: "spring.csv", x_column: "depth_mm", y_column: "force_n"`.
    /// Elsewhere: interp1, Shaper, lookup~, waveshaper.
    pub struct Curve(CurveSettings) in "math";
    source: "Fritsch and Butland, A method for constructing local monotone piecewise cubic interpolants, 1984 (`Smooth`)";
    example: r#""louder when pressed": Curve(input: "stylus.force", points: [[0, 0], [0.5, 0.2], [2, 1]], between: Smooth)"#;
    in INPUT: Scalar = Port::any("Where on the curve, x.");
    out OUTPUT: Scalar =
        Port::of_setting("quantity", "The value there, y, of the quantity that `quantity` names.");
}

impl NodeKind for Curve {
    fn build(settings: CurveSettings, _: &BuildContext) -> Result<Built<Self>, BuildError> {
        let points = points(&settings)?;
        Ok(Built::new(Table {
            knots: knots(&points, &settings.between),
            repeats: settings.beyond == Beyond::Repeat,
        }))
    }
}

/// The points of the settings or of their file, x rising.
fn points(settings: &CurveSettings) -> Result<Vec<[f64; 2]>, BuildError> {
    match (&settings.file, &settings.points[..]) {
        (Some(_), [_, ..]) => {
            let message = "`Curve` has both `points` and `file`";
            Err(BuildError::at("points", message).help("remove one of them"))
        }
        (Some(_), []) => points_of_file(settings),
        (None, written) => {
            let columns = [("x_column", &settings.x_column), ("y_column", &settings.y_column)];
            if let Some((field, _)) = columns.into_iter().find(|(_, column)| column.is_some()) {
                let message = format!("`{field}` names a column, but there is no `file`");
                return Err(BuildError::at(field, message).help("add `file: \"...\"`, a CSV file"));
            }
            rising(written)?;
            Ok(written.to_vec())
        }
    }
}

/// Refuses points whose x does not rise.
fn rising(points: &[[f64; 2]]) -> Result<(), BuildError> {
    if points.len() < 2 {
        let help = "write `points: [[x, y], [x, y]]`, or name a CSV file: `file: \"...\"`";
        return Err(BuildError::at("points", "a curve has at least two points").help(help));
    }
    match points.windows(2).find(|pair| pair[1][0] <= pair[0][0]) {
        Some(pair) => {
            let message = format!("x does not rise from {} to {}", pair[0][0], pair[1][0]);
            Err(BuildError::at("points", message).help("order the points by x, each x once"))
        }
        None => Ok(()),
    }
}

/// Two columns of a CSV file, in SI units.
fn points_of_file(settings: &CurveSettings) -> Result<Vec<[f64; 2]>, BuildError> {
    let Some(path) = &settings.file else {
        return Ok(Vec::new());
    };
    let named = [&settings.x_column, &settings.y_column].into_iter().flatten();
    let mut table = csv_table::open(path, &named.map(String::as_str).collect::<Vec<_>>())?;
    let header = |column: usize| table.head().names.get(column).map_or("", String::as_str);
    let place = |setting: &'static str, named: &Option<String>, other: usize| match named {
        Some(named) => csv_table::column(&table, path, (setting, named)),
        None if header(other).is_empty() => Err(at_file(path, "there is only one column, x or y")),
        None => Ok(other),
    };
    let x = place("x_column", &settings.x_column, 0)?;
    let y = place("y_column", &settings.y_column, 1)?;
    let (_, si_x) = units::of_header(header(x));
    let si_y = si_of_column(header(y), &settings.quantity)?;
    let mut points: Vec<[f64; 2]> = Vec::new();
    let mut before = f64::NEG_INFINITY;
    let unread = |error: CsvError| at_file(path, error);
    while let Some(row) = table.next_row().map_err(unread)? {
        let written = row.number(x).map_err(unread)?;
        if written <= before {
            let problem = format_args!("x does not rise from {before} to {written}");
            return Err(unread(row.error(problem)).help("order the rows by x, each x once"));
        }
        before = written;
        points.push([si_x * written, si_y * row.number(y).map_err(unread)?]);
    }
    match points.len() {
        0 | 1 => Err(at_file(path, "a curve has at least two points, one in each row")),
        _ => Ok(points),
    }
}

/// A point, and the cubic from it to the next: y + u (b + u (c + u d)), u from 0 to 1.
#[derive(Debug, Clone, Copy)]
struct Knot {
    x: f64,
    y: f64,
    cubic: [f64; 3],
}

fn knots(points: &[[f64; 2]], between: &Between) -> Box<[Knot]> {
    let slopes = slopes(points);
    let pieces = points.windows(2).zip(slopes.windows(2)).map(|(pair, slope)| {
        let [[x, y], [next_x, next_y]] = [pair[0], pair[1]];
        let (length, rise) = (next_x - x, next_y - y);
        let (begin, end) = (slope[0] * length, slope[1] * length);
        let cubic = match between {
            Between::Linear => [rise, 0.0, 0.0],
            Between::Smooth => [begin, 3.0 * rise - 2.0 * begin - end, begin + end - 2.0 * rise],
            Between::Hold => [0.0; 3],
        };
        Knot { x, y, cubic }
    });
    let last = points.last().map(|[x, y]| Knot { x: *x, y: *y, cubic: [0.0; 3] });
    pieces.chain(last).collect()
}

/// The slope at each point: the harmonic mean of those beside it where they agree in sign, so that nothing overshoots.
fn slopes(points: &[[f64; 2]]) -> Vec<f64> {
    let steps: Vec<f64> =
        { points.windows(2) }.map(|pair| (pair[1][1] - pair[0][1]) / (pair[1][0] - pair[0][0])).collect();
    let at = |i: usize| match (i.checked_sub(1).map(|before| steps[before]), steps.get(i)) {
        (Some(a), Some(&b)) if (a > 0.0 && b > 0.0) || (a < 0.0 && b < 0.0) => 2.0 / (1.0 / a + 1.0 / b),
        (Some(_), Some(_)) => 0.0,
        (Some(a), None) => a,
        (None, Some(b)) => *b,
        (None, None) => 0.0,
    };
    (0..points.len()).map(at).collect()
}

#[derive(Debug, Clone)]
struct Table {
    knots: Box<[Knot]>,
    repeats: bool,
}

impl Table {
    fn at(&self, x: f64) -> f64 {
        let (first, last) = (self.knots[0], self.knots[self.knots.len() - 1]);
        let x = match self.repeats {
            true => first.x + (x - first.x).rem_euclid(last.x - first.x),
            false => x.clamp(first.x, last.x),
        };
        let after = self.knots.partition_point(|knot| knot.x <= x);
        let Knot { x: begin, y, cubic } = self.knots[after.saturating_sub(1)];
        let Some(next) = self.knots.get(after) else {
            return y;
        };
        let u = (x - begin) / (next.x - begin);
        y + u * (cubic[0] + u * (cubic[1] + u * cubic[2]))
    }
}

impl Processor<Curve> for Table {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, Curve>) {
        let x = io.read(Curve::INPUT);
        for (y, x) in io.write(Curve::OUTPUT).iter_mut().zip(x) {
            // No value is that of no place.
            let value = if x.is_finite() { self.at(*x) } else { 0.0 };
            *y = if value.is_finite() { value } else { 0.0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::frame::Kind;
    use haptograph_engine::testing::Bench;

    fn bench(points: &[[f64; 2]], between: Between, beyond: Beyond) -> Result<Bench, BuildError> {
        let settings = CurveSettings {
            points: points.to_vec(),
            file: None,
            x_column: None,
            y_column: None,
            between,
            beyond,
            quantity: "force".to_owned(),
        };
        Bench::new::<Curve>(settings, 1.0, &[Kind::SCALAR])
    }

    const POINTS: [[f64; 2]; 3] = [[0.0, 1.0], [1.0, 3.0], [3.0, 3.0]];

    #[test]
    fn values_are_looked_up_between_and_beyond() {
        let x = [-5.0, 0.0, 0.5, 1.0, 2.0, 3.0, 4.0];
        let mut linear = bench(&POINTS, Between::Linear, Beyond::Hold).unwrap();
        assert_eq!(linear.run(&[&x]), [[1.0, 1.0, 2.0, 3.0, 3.0, 3.0, 3.0]]);
        let mut held = bench(&POINTS, Between::Hold, Beyond::Hold).unwrap();
        assert_eq!(held.run(&[&x]), [[1.0, 1.0, 1.0, 3.0, 3.0, 3.0, 3.0]]);
        let mut repeated = bench(&POINTS, Between::Linear, Beyond::Repeat).unwrap();
        assert_eq!(repeated.run(&[&[3.0, 3.5, -2.5, 6.0]]), [[1.0, 2.0, 2.0, 1.0]]);
    }

    #[test]
    fn a_smooth_curve_goes_through_its_points_and_never_overshoots() {
        let points = [[0.0, 0.0], [1.0, 0.1], [2.0, 5.0], [3.0, 5.0], [4.0, 1.0]];
        let mut smooth = bench(&points, Between::Smooth, Beyond::Hold).unwrap();
        let x: Vec<f64> = (0..=400).map(|i| f64::from(i) / 100.0).collect();
        let y = smooth.run(&[&x]).remove(0);
        for [x, expected] in points {
            assert!((y[(x * 100.0) as usize] - expected).abs() < 1e-12);
        }
        assert!(y[..=300].windows(2).all(|pair| pair[1] >= pair[0] - 1e-12));
        assert!(y[300..].windows(2).all(|pair| pair[1] <= pair[0] + 1e-12));
        let steepest = y.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
        assert!(steepest < 0.1, "it is continuous: {steepest}");
    }

    #[test]
    fn points_that_make_no_curve_are_refused() {
        for points in [&[[0.0, 1.0]][..], &[[1.0, 0.0], [1.0, 2.0]], &[[1.0, 0.0], [0.0, 2.0]]] {
            let refused = bench(points, Between::Linear, Beyond::Hold).err();
            assert_eq!(refused.and_then(|error| error.field), Some("points"));
        }
    }

    /// The curve of a file, with these columns and this quantity; or the field at fault and the message.
    fn of_file(
        text: &str,
        columns: [Option<&str>; 2],
        quantity: &str,
    ) -> Result<Bench, (Option<&'static str>, String)> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("curve.csv");
        std::fs::write(&path, text).unwrap();
        let [x_column, y_column] = columns.map(|column| column.map(str::to_owned));
        let settings = CurveSettings {
            points: Vec::new(),
            file: Some(path),
            x_column,
            y_column,
            between: Between::Linear,
            beyond: Beyond::Hold,
            quantity: quantity.to_owned(),
        };
        let bench = Bench::new::<Curve>(settings, 1.0, &[Kind::SCALAR]);
        bench.map_err(|error| (error.field, error.to_string()))
    }

    #[test]
    fn points_come_from_a_file_in_its_units() {
        let text = "# measured on Monday\ndepth_mm, gain, force_n\n0, 7, 0\n\n2, 8, 1\n4, 9, 4\n";
        let mut spring = of_file(text, [Some("depth_mm"), Some("force_n")], "force").unwrap();
        let y = spring.run(&[&[-1.0, 0.001, 0.003, 0.004, 9.0]]).remove(0);
        let expected = [0.0, 0.5, 2.5, 4.0, 4.0];
        assert!(y.iter().zip(expected).all(|(y, e)| (y - e).abs() < 1e-12), "{y:?}");
        let mut gain = of_file(text, [None, None], "number").unwrap();
        assert_eq!(gain.run(&[&[0.0, 0.002]]), [[7.0, 8.0]]);
    }

    #[test]
    fn a_file_that_makes_no_curve_is_refused_where_it_is_wrong() {
        let refused = |text: &str, columns, quantity: &str| of_file(text, columns, quantity).err().unwrap();
        for (text, part) in [
            ("x,y\n0,1\n0,2\n", "line 3: x does not rise from 0 to 0"),
            ("x,y\n0,1\n1,many\n", "line 3, column 2: \"many\" in y"),
            ("x,y\n0,1\n1,\n", "line 3, column 2: the cell of y is empty"),
            ("x,y\n0,1\n", "at least two points"),
            ("x\n0\n1\n", "only one column"),
            ("x;y\n0;1\n1;1.000,5\n", "line 3, column 2: \"1.000,5\" in y"),
            ("", "the file is empty"),
        ] {
            let (field, said) = refused(text, [None, None], "number");
            assert!(field == Some("file") && said.contains(part), "{text:?}: {said}");
        }
        let text = "x,force_n\n0,1\n1,2\n";
        assert_eq!(refused(text, [Some("z"), None], "force").0, Some("x_column"));
        assert_eq!(refused(text, [None, Some("z")], "force").0, Some("y_column"));
        assert_eq!(refused(text, [None, None], "speed").0, Some("quantity"));
    }

    #[test]
    fn points_stand_in_one_place() {
        let settings = CurveSettings {
            points: POINTS.to_vec(),
            file: Some("curve.csv".into()),
            x_column: None,
            y_column: None,
            between: Between::Linear,
            beyond: Beyond::Hold,
            quantity: "number".to_owned(),
        };
        let field = |settings| {
            let refused = Bench::new::<Curve>(settings, 1.0, &[Kind::SCALAR]).err();
            refused.and_then(|error| error.field)
        };
        assert_eq!(field(settings.clone()), Some("points"));
        let only_column = CurveSettings { file: None, y_column: Some("force_n".to_owned()), ..settings };
        assert_eq!(field(only_column), Some("y_column"));
    }
}
