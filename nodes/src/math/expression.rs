//! A node that computes a formula.

use haptograph_engine::formula::{Formula, is_free, names as used_names};
use haptograph_engine::frame::Scalar;
use haptograph_engine::node::{BuildContext, BuildError, Built, Io, Named, NodeKind, Port, Processor, Tick};

/// Default names of the inputs.
const LETTERS: [&str; 8] = ["a", "b", "c", "d", "f", "g", "h", "k"];

haptograph_engine::settings! {
    /// Settings of [`Expression`].
    pub struct ExpressionSettings {
        /// The formula, in SI units: `"0.4 * a * sin(2*pi * b / 0.002)"`.
        formula: String;
        /// Names of the inputs in the formula where `inputs` is a list, in its order; by default `a`, `b`, `c`, `d`,
        /// `f`, `g`, `h`, `k`.
        names: Vec<String> = vec![];
        /// Quantity of the output, by name.
        quantity: String = "number".into();
    }
}

haptograph_engine::node! {
    /// Computes a formula of scalar signals, frame by frame, in SI units. It has `+ - * / % ^`, comparisons (`<`, `<=`,
    /// `>`, `>=`, `==`, `!=`, which give 1 or 0), `&&`, `||`, the constants `pi` and `e`, the time `t` in s, and the
    /// functions sin, cos, tan, asin, acos, atan, atan2, sinh, cosh, tanh, exp, ln, log2, log10, sqrt, pow, hypot, abs,
    /// sign, floor, ceil, round, mod, min (minimum), max (maximum), clamp(x, low, high), mix(a, b, part), if(condition,
    /// then, otherwise), not. A result that is not finite, as of a division by zero, is zero. `2^3^2` is 2^9, `%` and `mod`
    /// are never negative: `-1 % 3` is 2, and so is `-1 % -3`. It runs on the clock of its inputs: for a vibration from
    /// slower ones write `clock: "audio"` and `Linear(...)` around each of them.
    /// Elsewhere: expr~, fexpr~, UnaryOpUGen, anonymous function.
    pub struct Expression(ExpressionSettings) in "math";
    example: r#""ridges": Expression(inputs: {"texture": "texture.acceleration", "hum": "hum.output"}, formula: "0.5 * texture + clamp(hum, -2, 2)", quantity: "acceleration")"#;
    in INPUTS: Scalar, Named = Port::any("Scalars of any quantity, by their names in the formula.");
    out OUTPUT: Scalar =
        Port::of_setting("quantity", "The value of the formula, of the quantity that `quantity` names.");
}

impl NodeKind for Expression {
    fn build(settings: ExpressionSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let names = names(&settings, cx)?;
        let formula = Formula::parse(&settings.formula, &names).map_err(|error| {
            let (first, end) = error.characters(&settings.formula);
            BuildError::at("formula", error.message).part(first, end)
        })?;
        Ok(Built::new(Computer {
            work: vec![0.0; formula.depth() * cx.max_frames].into(),
            formula,
            tick_s: 1.0 / cx.rate.hz(),
        }))
    }

    fn advice(settings: &ExpressionSettings, cx: &BuildContext) -> Vec<BuildError> {
        let used = used_names(&settings.formula);
        let named = cx.names(Self::INPUTS).iter().enumerate();
        let unused = named.filter(|(_, name)| used.binary_search(&name.as_str()).is_err());
        let advice = unused.map(|(place, name)| {
            BuildError::at("inputs", format!("the formula does not use `{name}`"))
                .connection(place)
                .help("remove the connection, or use it in the formula")
        });
        advice.collect()
    }

    fn memory_bytes(settings: &ExpressionSettings, cx: &BuildContext) -> u64 {
        // The formula has more characters than intermediate values.
        size_of::<f64>() as u64 * settings.formula.len() as u64 * cx.max_frames as u64
    }
}

const NAMING: &str = "use letters, digits and `_`; no function, constant or `t`";

/// The name of each input.
fn names<'a>(settings: &'a ExpressionSettings, cx: &'a BuildContext) -> Result<Vec<&'a str>, BuildError> {
    let (given, inputs) = (&settings.names, cx.connections(Expression::INPUTS));
    let named = cx.names(Expression::INPUTS);
    if !named.is_empty() {
        return named_in_map(named, given);
    }
    if given.is_empty() {
        let names = LETTERS.get(..inputs).map(<[&str]>::to_vec);
        return names.ok_or_else(|| {
            let message = format!("{inputs} inputs need names");
            BuildError::at("inputs", message)
                .help("write a map from names: `inputs: {\"name\": \"node.output\"}`")
        });
    }
    if given.len() != inputs {
        let message = format!("the number of names is {}, that of inputs {inputs}", given.len());
        return Err(BuildError::at("names", message).help("give a name for each, in the order of `inputs`"));
    }
    for (i, name) in given.iter().enumerate() {
        if !is_free(name) || given[..i].contains(name) {
            let message = format!("`{name}` is not a valid name of an input");
            return Err(BuildError::at("names", message).help(format!("use each name once; {NAMING}")));
        }
    }
    Ok(given.iter().map(String::as_str).collect())
}

/// The names of a map, which the engine has found to be different.
fn named_in_map<'a>(named: &'a [String], given: &[String]) -> Result<Vec<&'a str>, BuildError> {
    if !given.is_empty() {
        let message = "`names` has no effect: the connections of `inputs` have names";
        return Err(BuildError::at("names", message).help("remove `names`"));
    }
    if let Some(place) = named.iter().position(|name| !is_free(name)) {
        let message = format!("`{}` is not a valid name of an input", named[place]);
        return Err(BuildError::at("inputs", message).connection(place).help(NAMING));
    }
    Ok(named.iter().map(String::as_str).collect())
}

#[derive(Debug, Clone)]
struct Computer {
    formula: Formula,
    work: Box<[f64]>,
    tick_s: f64,
}

impl Processor<Expression> for Computer {
    fn process(&mut self, tick: &Tick, io: &mut Io<'_, Expression>) {
        let time_s = |frame: usize| (tick.first + frame as u64) as f64 * self.tick_s;
        let inputs = io.read(Expression::INPUTS);
        let input = |input| inputs.nth_or_last(input);
        self.formula.compute(tick.frames, input, time_s, &mut self.work);
        io.write(Expression::OUTPUT).copy_from_slice(&self.work[..tick.frames]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::frame::Kind;
    use haptograph_engine::testing::Bench;

    fn settings(formula: &str, names: &[&str]) -> ExpressionSettings {
        ExpressionSettings {
            formula: formula.to_owned(),
            names: names.iter().map(|name| (*name).to_owned()).collect(),
            quantity: "force".to_owned(),
        }
    }

    #[test]
    fn a_formula_of_two_signals_and_time() {
        let two = [Kind::SCALAR; 2];
        let mut bench = Bench::new::<Expression>(settings("x * y + t", &["x", "y"]), 10.0, &two).unwrap();
        assert_eq!(bench.run(&[&[1.0, 2.0], &[3.0, 4.0]]), [[3.0, 8.1]]);
        assert_eq!(bench.run(&[&[0.0], &[0.0]]), [[0.2]]);
        let mut bench = Bench::new::<Expression>(settings("a - b", &[]), 10.0, &two).unwrap();
        assert_eq!(bench.run(&[&[1.0], &[3.0]]), [[-2.0]]);
    }

    #[test]
    fn names_that_do_not_fit_are_refused() {
        let field = |formula: &str, names: &[&str]| {
            let refused = Bench::new::<Expression>(settings(formula, names), 10.0, &[Kind::SCALAR; 2]).err();
            refused.and_then(|error| error.field)
        };
        assert_eq!(field("x", &["x"]), Some("names"));
        for name in ["t", "sin", "2x", "", "x"] {
            assert_eq!(field("x", &["x", name]), Some("names"), "{name}");
        }
        assert_eq!(field("a + z", &[]), Some("formula"));
        assert_eq!(field("pi + x + y", &["x", "y"]), None);
    }

    #[test]
    fn a_formula_of_connections_with_names() {
        let build = |formula: &str, given: &[&str], names: &[&str]| {
            let kinds = vec![Kind::SCALAR; names.len()];
            Bench::with_names::<Expression>(settings(formula, given), 10.0, &kinds, names)
        };
        let mut bench = build("x - 2 * hum", &[], &["x", "hum"]).unwrap();
        assert_eq!(bench.run(&[&[1.0], &[3.0]]), [[-5.0]]);
        let wrong = |formula: &str, given: &[&str], names: &[&str]| {
            let refused = build(formula, given, names).err().unwrap();
            (refused.field, refused.connection, refused.part)
        };
        assert_eq!(wrong("x", &[], &["x", "sin"]), (Some("inputs"), Some(1), None));
        assert_eq!(wrong("x", &["x"], &["x"]), (Some("names"), None, None));
        assert_eq!(wrong("x + a", &[], &["x"]), (Some("formula"), None, Some((4, 5))));
    }

    #[test]
    fn a_connection_that_the_formula_does_not_use_is_doubtful_in_a_map() {
        let cx = |names: &[&str]| {
            let rate = haptograph_signal::time::Rate::from_hz(10).unwrap();
            let cx = BuildContext::new("ridges", rate).connected(&[Some(Kind::SCALAR); 3]);
            cx.named(names)
        };
        let doubts = |names: &[&str], given: &[&str]| {
            let advice = Expression::advice(&settings("x + sin(y)", given), &cx(names));
            advice.into_iter().map(|doubt| (doubt.field, doubt.connection)).collect::<Vec<_>>()
        };
        assert_eq!(doubts(&["x", "z", "y"], &[]), [(Some("inputs"), Some(1))]);
        assert_eq!(doubts(&[], &["x", "z", "y"]), []);
    }

    #[test]
    fn an_error_points_at_the_word_that_is_wrong() {
        let part = |formula: &str| {
            let refused = Bench::new::<Expression>(settings(formula, &[]), 10.0, &[Kind::SCALAR]).err();
            refused.and_then(|error| error.part)
        };
        assert_eq!(part("2 * foo + a"), Some((4, 7)));
        assert_eq!(part("a ? 1"), Some((2, 3)));
        assert_eq!(part("sin(a"), Some((5, 6)));
    }
}
