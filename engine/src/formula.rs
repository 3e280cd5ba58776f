//! Formulas: text in, a program of a stack machine out, which computes whole blocks without allocating.
//!
//! `Expr("2 * rate")` in a graph file and the node `Expression` read the same language.

mod parser;

use std::f64::consts::{E, PI};

/// Error of a formula.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}, at character {at} of the formula")]
pub struct FormulaError {
    /// Position in characters, counted from 1.
    pub at: usize,
    /// The error.
    pub message: String,
}

impl FormulaError {
    /// The faulty word or sign, as a range of characters of the formula: the first, and one past the last.
    pub fn characters(&self, formula: &str) -> (usize, usize) {
        let first = self.at - 1;
        let is_word = |c: &char| c.is_alphanumeric() || *c == '_';
        let length = formula.chars().skip(first).take_while(is_word).count();
        (first, first + length.max(1))
    }
}

/// A formula that can be computed.
#[derive(Debug, Clone)]
pub struct Formula {
    steps: Box<[Step]>,
    depth: usize,
}

#[derive(Debug, Clone, Copy)]
enum Step {
    Number(f64),
    Input(usize),
    Time,
    Call(Function),
}

type OfTwo = fn(f64, f64) -> f64;

/// Functions by their number of arguments.
#[derive(Debug, Clone, Copy)]
enum Function {
    One(fn(f64) -> f64),
    Two(OfTwo),
    Three(fn(f64, f64, f64) -> f64),
}

const FUNCTIONS: [(&str, Function); 29] = [
    ("sin", Function::One(f64::sin)),
    ("cos", Function::One(f64::cos)),
    ("tan", Function::One(f64::tan)),
    ("asin", Function::One(f64::asin)),
    ("acos", Function::One(f64::acos)),
    ("atan", Function::One(f64::atan)),
    ("sinh", Function::One(f64::sinh)),
    ("cosh", Function::One(f64::cosh)),
    ("tanh", Function::One(f64::tanh)),
    ("exp", Function::One(f64::exp)),
    ("ln", Function::One(f64::ln)),
    ("log2", Function::One(f64::log2)),
    ("log10", Function::One(f64::log10)),
    ("sqrt", Function::One(f64::sqrt)),
    ("abs", Function::One(f64::abs)),
    ("sign", Function::One(sign)),
    ("floor", Function::One(f64::floor)),
    ("ceil", Function::One(f64::ceil)),
    ("round", Function::One(f64::round)),
    ("not", Function::One(|x| truth(x == 0.0))),
    ("atan2", Function::Two(f64::atan2)),
    ("hypot", Function::Two(f64::hypot)),
    ("pow", Function::Two(f64::powf)),
    ("mod", Function::Two(f64::rem_euclid)),
    ("min", Function::Two(f64::min)),
    ("max", Function::Two(f64::max)),
    // Not `f64::clamp`, which panics where the bounds are the wrong way round.
    ("clamp", Function::Three(|x, low, high| x.max(low).min(high))),
    ("mix", Function::Three(|a, b, part| a + (b - a) * part)),
    ("if", Function::Three(|condition, then, otherwise| if condition != 0.0 { then } else { otherwise })),
];

const CONSTANTS: [(&str, f64); 2] = [("pi", PI), ("e", E)];
/// The name of the time since the start, s.
const TIME: &str = "t";

fn truth(is_so: bool) -> f64 {
    f64::from(u8::from(is_so))
}

fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}

impl Formula {
    /// Reads a formula over inputs of these names.
    ///
    /// # Errors
    /// [`FormulaError`] if the formula or a name is invalid.
    pub fn parse(text: &str, inputs: &[&str]) -> Result<Self, FormulaError> {
        let (steps, depth) = parser::steps(text, inputs)?;
        Ok(Self { steps: steps.into(), depth })
    }

    /// Number of values that [`compute`](Self::compute) needs as working memory, for each frame.
    pub fn depth(&self) -> usize {
        self.depth
    }

    /// True if the result depends on the time since the start.
    pub(crate) fn is_timed(&self) -> bool {
        self.steps.iter().any(|step| matches!(step, Step::Time))
    }

    /// The value of the formula for one value of each input, at time 0; may be NaN or infinite. Allocates.
    pub fn value(&self, inputs: &[f64]) -> f64 {
        let mut work = vec![0.0; self.depth];
        self.run(1, |input| inputs.get(input..=input).unwrap_or(&[]), |_| 0.0, &mut work);
        work.first().copied().unwrap_or(f64::NAN)
    }

    /// Computes `frames` frames: `inputs` gives the samples of each input, `time_s` the time of a frame. The results
    /// are the first numbers of `work`, which holds at least [`depth`](Self::depth) times `frames`; NaN and infinite
    /// results are replaced by zero.
    pub fn compute<'a>(
        &self,
        frames: usize,
        inputs: impl Fn(usize) -> &'a [f64],
        time_s: impl Fn(usize) -> f64,
        work: &mut [f64],
    ) {
        self.run(frames, inputs, time_s, work);
        for x in work.iter_mut().take(frames).filter(|x| !x.is_finite()) {
            *x = 0.0;
        }
    }

    fn run<'a>(
        &self,
        frames: usize,
        inputs: impl Fn(usize) -> &'a [f64],
        time_s: impl Fn(usize) -> f64,
        work: &mut [f64],
    ) {
        let mut height = 0;
        for step in &self.steps {
            let (below, above) = work.split_at_mut(height * frames);
            let above = above.iter_mut().take(frames);
            match step {
                Step::Number(number) => above.for_each(|x| *x = *number),
                Step::Input(input) => above.zip(inputs(*input)).for_each(|(x, sample)| *x = *sample),
                Step::Time => above.enumerate().for_each(|(frame, x)| *x = time_s(frame)),
                Step::Call(function) => {
                    height -= function.arguments();
                    function.apply(&mut below[height * frames..], frames);
                }
            }
            height += 1;
        }
    }
}

impl Function {
    fn arguments(self) -> usize {
        match self {
            Self::One(_) => 1,
            Self::Two(_) => 2,
            Self::Three(_) => 3,
        }
    }

    /// Puts the result in the place of the first argument; arguments lie one behind the other.
    fn apply(self, arguments: &mut [f64], frames: usize) {
        let (first, others) = arguments.split_at_mut(frames);
        match self {
            Self::One(function) => first.iter_mut().for_each(|a| *a = function(*a)),
            Self::Two(function) => {
                let pairs = first.iter_mut().zip(others);
                pairs.for_each(|(a, b)| *a = function(*a, *b));
            }
            Self::Three(function) => {
                let (second, third) = others.split_at(frames);
                let triples = first.iter_mut().zip(second).zip(third);
                triples.for_each(|((a, b), c)| *a = function(*a, *b, *c));
            }
        }
    }
}

/// The words of a formula that can only be names of inputs, each once.
pub fn names(formula: &str) -> Vec<&str> {
    let mut names: Vec<&str> = words(formula).filter(|word| is_free(word)).collect();
    names.sort_unstable();
    names.dedup();
    names
}

/// The reserved words of a formula: functions, constants and the time.
pub(crate) fn reserved(formula: &str) -> impl Iterator<Item = &str> {
    let is_word = |word: &&str| word.starts_with(|c: char| c.is_alphabetic() || c == '_');
    words(formula).filter(is_word).filter(|word| !is_free(word))
}

fn words(formula: &str) -> impl Iterator<Item = &str> {
    formula.split(|c: char| !(c.is_alphanumeric() || c == '_'))
}

/// True if an input can have this name, which must not be reserved.
pub fn is_free(name: &str) -> bool {
    let mut letters = name.chars();
    let is_word = letters.next().is_some_and(|c| c.is_alphabetic() || c == '_')
        && letters.all(|c| c.is_alphanumeric() || c == '_');
    let functions = FUNCTIONS.iter().map(|(known, _)| *known);
    let constants = CONSTANTS.iter().map(|(known, _)| *known);
    is_word && functions.chain(constants).chain([TIME]).all(|known| known != name)
}

#[cfg(test)]
mod tests;
