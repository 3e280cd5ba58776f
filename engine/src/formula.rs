//! Formulas: text in, a program of a stack machine out, which computes whole blocks without allocating.
//!
//! `Expr("2 * rate")` in a graph file and the node `Expression` read the same language.

use crate::settings::closest;
use std::f64::consts::{E, PI};

/// The longest formula, in characters, and the deepest nesting of brackets.
const MOST_CHARACTERS: usize = 4096;
const MOST_NESTED: usize = 64;

/// What is wrong with a formula.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}, at character {at} of the formula")]
pub struct FormulaError {
    /// Where, counted from 1.
    pub at: usize,
    /// What.
    pub message: String,
}

impl FormulaError {
    /// The word or sign at fault, as characters of the formula: the first, and the one behind the last.
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

/// Units that are written behind a number by mistake, and one of them in SI units.
const UNITS: [(&str, &str); 9] = [
    ("mm", "0.001"),
    ("cm", "0.01"),
    ("m", "1"),
    ("ms", "0.001"),
    ("s", "1"),
    ("N", "1"),
    ("mN", "0.001"),
    ("Hz", "1"),
    ("kHz", "1000"),
];

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
    (
        "if",
        Function::Three(|condition, then, otherwise| if condition != 0.0 { then } else { otherwise }),
    ),
];

const CONSTANTS: [(&str, f64); 2] = [("pi", PI), ("e", E)];
/// What other languages write, and what is written here.
const FOREIGN: [(&str, &str); 14] = [
    ("**", "`^`"),
    (".*", "`*`"),
    ("./", "`/`"),
    (".^", "`^`"),
    ("&", "`&&`"),
    ("|", "`||`"),
    ("=", "`==`"),
    ("!", "`not(...)`"),
    ("~", "`not(...)`"),
    ("?", "`if(condition, then, otherwise)`"),
    ("log", "`ln`, `log2` or `log10`"),
    ("rem", "`mod`"),
    ("fmod", "`mod`"),
    ("arctan2", "`atan2`"),
];
/// The name of the time since the start, s.
const TIME: &str = "t";

/// Binary operators by how weakly they bind, and what they do; of those that begin alike the longer comes first.
const OPERATORS: [&[(&str, OfTwo)]; 5] = [
    &[("||", |a, b| truth(a != 0.0 || b != 0.0))],
    &[("&&", |a, b| truth(a != 0.0 && b != 0.0))],
    &[
        ("<=", |a, b| truth(a <= b)),
        (">=", |a, b| truth(a >= b)),
        ("==", |a, b| truth(a == b)),
        ("!=", |a, b| truth(a != b)),
        ("<", |a, b| truth(a < b)),
        (">", |a, b| truth(a > b)),
    ],
    &[("+", |a, b| a + b), ("-", |a, b| a - b)],
    &[("*", |a, b| a * b), ("/", |a, b| a / b), ("%", f64::rem_euclid)],
];

/// The level of the comparisons, which do not chain.
const COMPARISONS: usize = 2;

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
    /// [`FormulaError`]: what is wrong with it or a name, and where.
    pub fn parse(text: &str, inputs: &[&str]) -> Result<Self, FormulaError> {
        let mut parser = Parser {
            text,
            at: 0,
            inputs,
            steps: Vec::new(),
            height: 0,
            depth: 0,
            nested: 0,
        };
        if text.chars().count() > MOST_CHARACTERS {
            return Err(parser.wrong(format!("it has more than {MOST_CHARACTERS} characters")));
        }
        parser.binary(0)?;
        parser.blanks();
        match parser.rest() {
            "" => Ok(Self {
                steps: parser.steps.into(),
                depth: parser.depth,
            }),
            _ => Err(parser.unexpected()),
        }
    }

    /// How many numbers [`compute`](Self::compute) needs to work with, for each frame.
    pub fn depth(&self) -> usize {
        self.depth
    }

    /// The inputs that it names, as indices.
    pub fn inputs(&self) -> impl Iterator<Item = usize> {
        self.steps.iter().filter_map(|step| match step {
            Step::Input(input) => Some(*input),
            _ => None,
        })
    }

    /// Does it depend on the time since the start?
    pub fn is_timed(&self) -> bool {
        self.steps.iter().any(|step| matches!(step, Step::Time))
    }

    /// Its value for one value of each input, at time 0; not finite where the formula is not. Allocates.
    pub fn value(&self, inputs: &[f64]) -> f64 {
        let mut work = vec![0.0; self.depth];
        self.run(
            1,
            |input| inputs.get(input..=input).unwrap_or(&[]),
            |_| 0.0,
            &mut work,
        );
        work.first().copied().unwrap_or(f64::NAN)
    }

    /// Computes `frames` frames: `inputs` gives the samples of each input, `time_s` the time of a frame. The results
    /// are the first numbers of `work`, which holds at least [`depth`](Self::depth) times `frames`; one that is not
    /// finite is zero.
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

struct Parser<'t> {
    text: &'t str,
    at: usize,
    inputs: &'t [&'t str],
    steps: Vec<Step>,
    height: usize,
    depth: usize,
    nested: usize,
}

impl<'t> Parser<'t> {
    fn rest(&self) -> &'t str {
        &self.text[self.at..]
    }

    fn wrong(&self, message: String) -> FormulaError {
        let at = self.text[..self.at].chars().count() + 1;
        FormulaError { at, message }
    }

    fn blanks(&mut self) {
        self.at = self.text.len() - self.rest().trim_start().len();
    }

    fn takes(&mut self, sign: &str) -> bool {
        self.blanks();
        let is_there = self.rest().starts_with(sign);
        self.at += if is_there { sign.len() } else { 0 };
        is_there
    }

    fn expect(&mut self, sign: &str) -> Result<(), FormulaError> {
        match (self.takes(sign), self.rest()) {
            (true, _) => Ok(()),
            (false, "") => Err(self.wrong(format!("`{sign}` is missing"))),
            _ if sign == "(" => Err(self.wrong("a function is followed by `(`".to_owned())),
            _ => Err(self.unexpected()),
        }
    }

    /// What stands here cannot follow.
    fn unexpected(&self) -> FormulaError {
        let Some(strange) = self.rest().chars().next() else {
            return self.wrong("expected a number, a name or `(`".to_owned());
        };
        if let Some(here) = self.foreign(self.rest()) {
            return self.wrong(here);
        }
        let is_part = |c: char| c.is_alphanumeric();
        let word = self.rest().split(|c| !is_part(c)).next().unwrap_or_default();
        if let Some((unit, si)) = UNITS.iter().find(|(unit, _)| *unit == word) {
            return self.wrong(format!("numbers of a formula are in SI units: 1 {unit} is {si}"));
        }
        if strange.is_alphanumeric() || strange == '(' {
            return self.wrong(format!(
                "an operator is missing before `{strange}`, as in `2 * x`"
            ));
        }
        self.wrong(format!("`{strange}` is not expected"))
    }

    /// What is written here in place of a sign or function of other languages.
    fn foreign(&self, text: &str) -> Option<String> {
        let is_word = |sign: &str| sign.starts_with(char::is_alphabetic);
        let is_it = |sign: &str| {
            if is_word(sign) {
                text == sign
            } else {
                text.starts_with(sign)
            }
        };
        let (sign, ours) = FOREIGN.iter().find(|(sign, _)| is_it(sign))?;
        Some(format!("`{sign}` is written as {ours} here"))
    }

    fn push(&mut self, step: Step) {
        self.height += 1;
        if let Step::Call(function) = step {
            self.height -= function.arguments();
        }
        self.depth = self.depth.max(self.height);
        self.steps.push(step);
    }

    /// Operands joined by operators that bind at least as strongly as those of `level`.
    fn binary(&mut self, level: usize) -> Result<(), FormulaError> {
        let Some(operators) = OPERATORS.get(level) else {
            return self.signed();
        };
        self.binary(level + 1)?;
        let mut done = 0;
        while let Some((sign, function)) = operators.iter().find(|(sign, _)| self.takes(sign)) {
            if done > 0 && level == COMPARISONS {
                let message =
                    format!("a second comparison, `{sign}`, has to be joined by `&&`: `0 < a && a < 1`");
                return Err(self.wrong(message));
            }
            self.binary(level + 1)?;
            self.push(Step::Call(Function::Two(*function)));
            done += 1;
        }
        Ok(())
    }

    /// An operand with signs before it and a power behind it: -2^2 is -4.
    fn signed(&mut self) -> Result<(), FormulaError> {
        self.nested += 1;
        if self.nested > MOST_NESTED {
            return Err(self.wrong(format!("it is nested more than {MOST_NESTED} deep")));
        }
        if self.takes("-") {
            self.signed()?;
            self.push(Step::Call(Function::One(|x| -x)));
        } else {
            self.operand()?;
            if self.takes("^") {
                self.signed()?;
                self.push(Step::Call(Function::Two(f64::powf)));
            }
        }
        self.nested -= 1;
        Ok(())
    }

    fn operand(&mut self) -> Result<(), FormulaError> {
        if self.takes("(") {
            self.binary(0)?;
            return self.expect(")");
        }
        match self.rest().chars().next() {
            Some(digit) if digit.is_ascii_digit() || digit == '.' => self.number(),
            Some(letter) if letter.is_alphabetic() || letter == '_' => self.name(),
            _ => Err(self.unexpected()),
        }
    }

    fn number(&mut self) -> Result<(), FormulaError> {
        let rest = self.rest().as_bytes();
        let is_part = |i: usize| match rest[i] {
            b'0'..=b'9' | b'.' => true,
            b'e' | b'E' => rest.get(i + 1).is_some_and(|next| b"+-0123456789".contains(next)),
            b'+' | b'-' => i > 0 && matches!(rest[i - 1], b'e' | b'E'),
            _ => false,
        };
        let length = (0..rest.len()).position(|i| !is_part(i)).unwrap_or(rest.len());
        let text = &self.rest()[..length];
        match text.parse::<f64>() {
            Ok(number) if number.is_finite() => {
                self.at += length;
                self.push(Step::Number(number));
                Ok(())
            }
            _ => Err(self.wrong(format!("`{text}` is not a number"))),
        }
    }

    fn name(&mut self) -> Result<(), FormulaError> {
        let rest = self.rest();
        let is_part = |c: char| c.is_alphanumeric() || c == '_';
        let name = &rest[..rest.find(|c| !is_part(c)).unwrap_or(rest.len())];
        if let Some((_, function)) = FUNCTIONS.iter().find(|(known, _)| *known == name) {
            self.at += name.len();
            return self.call(name, *function);
        }
        let constant = CONSTANTS.iter().find(|(known, _)| *known == name);
        let step = match self.inputs.iter().position(|input| *input == name) {
            Some(input) => Step::Input(input),
            None if name == TIME => Step::Time,
            None => match constant {
                Some((_, value)) => Step::Number(*value),
                None => return Err(self.unknown(name)),
            },
        };
        self.at += name.len();
        self.push(step);
        Ok(())
    }

    fn unknown(&self, name: &str) -> FormulaError {
        if let Some(here) = self.foreign(name) {
            return self.wrong(here);
        }
        let functions = FUNCTIONS.iter().map(|(known, _)| *known);
        let constants = CONSTANTS.iter().map(|(known, _)| *known);
        let known = self.inputs.iter().copied().chain(functions).chain(constants);
        let near = name.strip_prefix("arc").map(|rest| format!("a{rest}"));
        let is_called = self.rest()[name.len()..].trim_start().starts_with('(');
        // `maximum(` and `average(` begin as our functions do, or are none of them.
        let begins = |(known, _): &&(&'static str, Function)| is_called && name.starts_with(known);
        let longer = FUNCTIONS
            .iter()
            .filter(begins)
            .map(|(known, _)| *known)
            .max_by_key(|known| known.len());
        let help = match longer.or_else(|| closest(near.as_deref().unwrap_or(name), known)) {
            Some(near) => format!("did you mean `{near}`?"),
            None if is_called => format!(
                "the functions are {}",
                FUNCTIONS.map(|(known, _)| known).join(", ")
            ),
            None if self.inputs.is_empty() => "there are functions, `pi` and `e`".to_owned(),
            None => format!("the inputs are {}", self.inputs.join(", ")),
        };
        self.wrong(format!("there is no `{name}`; {help}"))
    }

    fn call(&mut self, name: &str, function: Function) -> Result<(), FormulaError> {
        self.expect("(")?;
        let wanted = function.arguments();
        for argument in 0..wanted {
            if argument > 0 && !self.takes(",") {
                return Err(self.wrong(format!("`{name}` takes {wanted} arguments, and `,` is missing")));
            }
            self.binary(0)?;
        }
        if self.takes(",") {
            return Err(self.wrong(format!("`{name}` takes {wanted} arguments only")));
        }
        self.expect(")")?;
        self.push(Step::Call(function));
        Ok(())
    }
}

/// The words of a formula that can only be names of inputs, each once.
pub fn names(formula: &str) -> Vec<&str> {
    let mut names: Vec<&str> = words(formula).filter(|word| is_free(word)).collect();
    names.sort_unstable();
    names.dedup();
    names
}

/// The words of a formula that mean something of their own: functions, constants and the time.
pub fn reserved(formula: &str) -> impl Iterator<Item = &str> {
    let is_word = |word: &&str| word.starts_with(|c: char| c.is_alphabetic() || c == '_');
    words(formula).filter(is_word).filter(|word| !is_free(word))
}

fn words(formula: &str) -> impl Iterator<Item = &str> {
    formula.split(|c: char| !(c.is_alphanumeric() || c == '_'))
}

/// Whether an input can have this name: one that means nothing else.
pub fn is_free(name: &str) -> bool {
    let mut letters = name.chars();
    let is_word = letters.next().is_some_and(|c| c.is_alphabetic() || c == '_')
        && letters.all(|c| c.is_alphanumeric() || c == '_');
    let functions = FUNCTIONS.iter().map(|(known, _)| *known);
    let constants = CONSTANTS.iter().map(|(known, _)| *known);
    is_word
        && functions
            .chain(constants)
            .chain([TIME])
            .all(|known| known != name)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of inputs a = 3 and b = -2, half a second after the start.
    fn value(text: &str) -> f64 {
        let formula = Formula::parse(text, &["a", "b"]).expect(text);
        let mut work = vec![0.0; formula.depth()];
        let inputs: [&[f64]; 2] = [&[3.0], &[-2.0]];
        formula.compute(1, |input| inputs[input], |_| 0.5, &mut work);
        work[0]
    }

    #[test]
    fn operators_bind_as_on_paper() {
        for (text, expected) in [
            ("1 + 2 * 3", 7.0),
            ("(1 + 2) * 3", 9.0),
            ("2 - 3 - 4", -5.0),
            ("-2^2", -4.0),
            ("2^-1", 0.5),
            ("2^3^2", 512.0),
            ("- -a", 3.0),
            ("a - b", 5.0),
            ("7 % 4 * 2", 6.0),
            ("-1 % 3", 2.0),
            ("-1 % -3", 2.0),
            ("b % 4", 2.0),
            ("1 < 2 && 3 <= 3 || 0", 1.0),
            ("a == 3 && b != -2", 0.0),
            ("1.5e-2 + .5", 0.515),
            ("2*e", 2.0 * E),
        ] {
            assert_eq!(value(text), expected, "{text}");
        }
    }

    #[test]
    fn functions_take_their_arguments_in_order() {
        for (text, expected) in [
            ("sin(pi / 2)", 1.0),
            ("if(a > 2, a, b)", 3.0),
            ("if(a < 2, a, b)", -2.0),
            ("min(a, max(b, 1))", 1.0),
            ("clamp(10, b, a)", 3.0),
            ("mix(a, b, 0.5)", 0.5),
            ("pow(a, 2) + hypot(3, 4)", 14.0),
            ("sign(b) + sign(0) + not(0)", 0.0),
            ("t * 4", 2.0),
            ("mod(-0.5, 2)", 1.5),
        ] {
            assert_eq!(value(text), expected, "{text}");
        }
    }

    #[test]
    fn what_is_not_finite_is_zero() {
        for text in ["1 / 0", "sqrt(b)", "ln(0)", "a % 0", "clamp(1, 5, 4) - 4"] {
            assert_eq!(value(text), 0.0, "{text}");
        }
    }

    #[test]
    fn mistakes_are_told_with_their_place() {
        for (text, at) in [
            ("", 1),
            ("a +", 4),
            ("a b", 3),
            ("2 * c", 5),
            ("sin a", 5),
            ("2a", 2),
            ("2(a)", 2),
            ("min(a, b, 1)", 10),
            ("a ** 2", 4),
            ("0 < a < 1", 8),
            ("(a b)", 4),
            ("min(a)", 6),
            ("(a", 3),
            ("1.2.3", 1),
            ("ä + é", 1),
            ("a ? b", 3),
        ] {
            let error = Formula::parse(text, &["a", "b"]).expect_err(text);
            assert_eq!(error.at, at, "{text}: {error}");
        }
        for (text, said) in [
            ("2 * PI", "`pi`"),
            ("log(a)", "`ln`"),
            ("arcsin(a)", "`asin`"),
            ("a & b", "`&&`"),
            ("a = 1", "`==`"),
            ("a ? 1 : 2", "`if("),
            ("5 x", "operator"),
            ("5mm", "1 mm is 0.001"),
            ("maximum(a, b)", "`max`"),
            ("average(a)", "the functions are"),
        ] {
            let error = Formula::parse(text, &["a", "b"]).expect_err(text);
            assert!(error.message.contains(said), "{text}: {error}");
        }
        for deep in ["(".repeat(5000), "-".repeat(1000), "(".repeat(200)] {
            assert!(Formula::parse(&deep, &["a"]).is_err());
        }
    }

    #[test]
    fn frames_are_computed_each_for_itself() {
        let formula = Formula::parse("if(a > 0, a * b, t)", &["a", "b"]).expect("right");
        let mut work = vec![0.0; 3 * formula.depth()];
        let inputs: [&[f64]; 2] = [&[1.0, 0.0, 3.0], &[4.0, 5.0, 6.0]];
        formula.compute(3, |input| inputs[input], |frame| 10.0 + frame as f64, &mut work);
        assert_eq!(work[..3], [4.0, 11.0, 18.0]);
    }
}
