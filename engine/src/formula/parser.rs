//! Reads the text of a formula as steps of the stack machine.

use super::{CONSTANTS, FUNCTIONS, FormulaError, Function, OfTwo, Step, TIME, truth};
use crate::settings::closest;
use haptograph_signal::units;

/// The longest formula, in characters, and the deepest nesting of brackets.
const MAX_CHARACTERS: usize = 4096;
const MAX_NESTED: usize = 64;

/// Operators and functions of other languages, and their equivalents here.
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

/// Binary operators in the order of precedence, the weakest first. Of two with the same beginning, the longer comes
/// first.
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

/// The steps of a formula over inputs of these names, and the number of values that they need as working memory.
pub(super) fn steps(text: &str, inputs: &[&str]) -> Result<(Vec<Step>, usize), FormulaError> {
    let mut parser = Parser { text, at: 0, inputs, steps: Vec::new(), height: 0, depth: 0, nested: 0 };
    if text.chars().count() > MAX_CHARACTERS {
        return Err(parser.wrong(format!("it has more than {MAX_CHARACTERS} characters")));
    }
    parser.binary(0)?;
    parser.blanks();
    match parser.rest() {
        "" => Ok((parser.steps, parser.depth)),
        _ => Err(parser.unexpected()),
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

    /// Error: the present token cannot follow.
    fn unexpected(&self) -> FormulaError {
        let Some(strange) = self.rest().chars().next() else {
            return self.wrong("expected a number, a name or `(`".to_owned());
        };
        if let Some(here) = self.foreign(self.rest()) {
            return self.wrong(here);
        }
        let is_part = |c: char| c.is_alphanumeric();
        let word = self.rest().split(|c| !is_part(c)).next().unwrap_or_default();
        if let Some(si) = units::si_of(word) {
            return self.wrong(format!("numbers of a formula are in SI units: 1 {word} is {si}"));
        }
        if strange.is_alphanumeric() || strange == '(' {
            return self.wrong(format!("an operator is missing before `{strange}`, as in `2 * x`"));
        }
        self.wrong(format!("`{strange}` is not expected"))
    }

    /// Help for a sign or function of other languages.
    fn foreign(&self, text: &str) -> Option<String> {
        let is_word = |sign: &str| sign.starts_with(char::is_alphabetic);
        let is_it = |sign: &str| {
            if is_word(sign) { text == sign } else { text.starts_with(sign) }
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
        if self.nested > MAX_NESTED {
            return Err(self.wrong(format!("it is nested more than {MAX_NESTED} deep")));
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
        let longer = FUNCTIONS.iter().filter(begins).map(|(known, _)| *known).max_by_key(|known| known.len());
        let help = match longer.or_else(|| closest(near.as_deref().unwrap_or(name), known)) {
            Some(near) if is_called || self.inputs.is_empty() => format!("did you mean `{near}`?"),
            Some(near) => format!("did you mean `{near}`? The inputs are {}", self.listed()),
            None if is_called => {
                format!("the functions are {}", FUNCTIONS.map(|(known, _)| known).join(", "))
            }
            None if self.inputs.is_empty() => "there are functions, `pi` and `e`".to_owned(),
            None => format!("the inputs are {}", self.listed()),
        };
        self.wrong(format!("there is no `{name}`; {help}"))
    }

    /// The names of the inputs, the first ones of many.
    fn listed(&self) -> String {
        const SHOWN: usize = 12;
        let others = self.inputs.len().saturating_sub(SHOWN);
        let first = &self.inputs[..self.inputs.len() - others];
        match others {
            0 => first.join(", "),
            _ => format!("{} and {others} more", first.join(", ")),
        }
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
