//! A plan as text, one step a line, for snapshot tests and for people.

use super::{Plan, StepWork};
use crate::io::Form;
use std::fmt;

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let driver = &self.clock_names[self.driver];
        writeln!(f, "block {} frames of `{driver}` ({})", self.block, self.rates[self.driver])?;
        writeln!(
            f,
            "{} steps, {} buffers, {} bytes",
            self.steps.len(),
            self.slots.len(),
            self.buffer_bytes()
        )?;
        let mut island_end = 0;
        for (number, step) in self.steps.iter().enumerate() {
            let indent = if number < island_end { "  " } else { "" };
            write!(f, "{number:4} {indent}{} @{}", step.label, self.clock_names[step.clock as usize])?;
            if let StepWork::Island { steps, first_pacing, pacings } = step.work {
                island_end = number + 1 + steps as usize;
                let windows = &self.pacings[first_pacing as usize..][..pacings as usize];
                let unit = self.base.units_per_second();
                let windows: Vec<String> =
                    windows.iter().map(|w| format!("{} s", *w as f64 / unit)).collect();
                write!(f, " in windows of {}", windows.join(", "))?;
            }
            let inputs = step.wires.inputs.iter().map(|input| match input.form {
                Form::Absent => "-".to_owned(),
                _ => format!("b{}", self.slot_at(input.place(step.wires.out))),
            });
            let inputs: Vec<String> = inputs.collect();
            if !inputs.is_empty() {
                write!(f, " <- {}", inputs.join(" "))?;
            }
            if step.wires.out.len > 0 {
                write!(f, " -> b{}", self.slot_at(step.wires.out.start))?;
            }
            writeln!(f)?;
        }
        Ok(())
    }
}
