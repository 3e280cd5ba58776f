//! `haptograph thesis`: what the thesis prints.

use super::Failure;
use super::result::{CommandResult, show};
use super::table::{facts, table};
use crate::engine::registry::Registry;
use crate::signal::spelling::closest;
use clap::ValueEnum;
use haptograph_study::thesis::published;
use serde::Serialize;
use serde_json::Value;

/// Print a table, the numbers of a study, or the constants of the thesis
///
/// Without a number, lists them. Keys that begin with `derived_` are not printed in the thesis: they follow from its numbers.
#[derive(Debug, clap::Args)]
pub(super) struct Arguments {
    /// What to print
    what: What,
    /// Number of the table or study, such as 4.3
    #[arg(required = false)]
    number: Option<String>,
    /// Print it as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum What {
    Table,
    Study,
    Constants,
}

/// What was asked for, as it stands in the data.
#[derive(Serialize)]
#[serde(transparent)]
struct Published(Value);

pub(super) fn run(arguments: &Arguments, _: &Registry) -> Result<(), Failure> {
    let key = match arguments.what {
        What::Table => "tables",
        What::Study => "studies",
        What::Constants => return show(&Published(published()["constants"].clone()), arguments.json),
    };
    let all = &published()[key];
    let known = || all.as_object().into_iter().flatten().map(|(number, _)| number.as_str());
    let found = match &arguments.number {
        None => {
            let titles = known().map(|number| (number.to_owned(), all[number]["title"].clone()));
            Value::Object(titles.collect())
        }
        Some(number) => all.get(number).cloned().ok_or_else(|| {
            let near = closest(number, known()).map(|near| format!("; did you mean {near}?"));
            let list = || format!("; there are {}", known().collect::<Vec<_>>().join(", "));
            Failure::Message(format!("the thesis has no such number, {number}{}", near.unwrap_or_else(list)))
        })?,
    };
    show(&Published(found), arguments.json)
}

fn cell(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Null => "-".to_owned(),
        Value::Array(values) => values.iter().map(cell).collect::<Vec<_>>().join(", "),
        Value::Object(map) => {
            map.iter().map(|(key, value)| format!("{key}: {}", cell(value))).collect::<Vec<_>>().join(", ")
        }
        plain => plain.to_string(),
    }
}

fn texts(value: &Value) -> Vec<String> {
    value.as_array().into_iter().flatten().map(cell).collect()
}

impl CommandResult for Published {
    fn text(&self) -> String {
        if let Value::Array(rows) = &self.0 {
            let first = rows.first().and_then(Value::as_object).into_iter().flatten();
            let keys: Vec<&str> = first.map(|(key, _)| &**key).collect();
            let rows = rows.iter().map(|row| keys.iter().map(|key| cell(&row[*key])).collect());
            return table(&keys, &rows.collect::<Vec<_>>());
        }
        let is_shown = |key: &str| !["columns", "rows", "labels", "values"].contains(&key);
        let rest = self.0.as_object().into_iter().flatten().filter(|(key, _)| is_shown(key));
        let rest: Vec<(&str, String)> = rest.map(|(key, value)| (key.as_str(), cell(value))).collect();
        let labels = texts(&self.0["labels"]);
        let rows = [&self.0["rows"], &self.0["values"]].into_iter().filter_map(Value::as_array).flatten();
        let named = labels.iter().map(|label| vec![label.clone()]).chain(std::iter::repeat(Vec::new()));
        let rows: Vec<Vec<String>> = rows.zip(named).map(|(row, name)| [name, texts(row)].concat()).collect();
        let mut header = texts(&self.0["columns"]);
        if !labels.is_empty() {
            header = [vec![String::new()], labels].concat();
        }
        let header: Vec<&str> = header.iter().map(String::as_str).collect();
        let numbers = if rows.is_empty() { String::new() } else { format!("\n{}", table(&header, &rows)) };
        facts(&rest) + &numbers
    }
}
