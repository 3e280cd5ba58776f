//! Clocks, and their assignment to nodes: the fourth form of a graph.

use super::Clock;
use super::context::Context;
use super::devices::Bound;
use super::values::{Parameters, Place};
use crate::diagnostic::{Diagnostic, Span};
use crate::document::value::{Body, Name, Shape, Tagged, Value};
use crate::settings::{Expected, Form, Setting};
use haptograph_signal::time::{Rate, RateError, TimeBase};
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};
use std::ops::Deref;

/// The clocks of a graph.
#[derive(Default)]
pub(super) struct Clocks {
    pub list: Vec<Clock>,
    /// The declaration of each.
    pub spans: Vec<Span>,
    /// Index by name; `None` for those that were reported.
    names: HashMap<String, Option<usize>>,
    pub base: Option<TimeBase>,
}

/// Bound nodes with their clocks.
pub(super) struct Clocked {
    graph: Bound,
    pub clocks: Clocks,
    /// The clock of each node; `None` for file sinks, and after a reported error.
    pub clock_of: Vec<Option<usize>>,
}

impl Deref for Clocked {
    type Target = Bound;

    fn deref(&self) -> &Bound {
        &self.graph
    }
}

impl Clocked {
    /// Rate of a node's clock.
    pub(super) fn rate_of(&self, node: usize) -> Option<Rate> {
        Some(self.clocks.list[self.clock_of[node]?].rate)
    }
}

/// A clock as declared.
struct Declared<'a> {
    name: &'a Name,
    /// The clock it derives from, with the place of its name.
    of: Option<(String, Span)>,
    rate: Option<Rate>,
    rate_span: Span,
    broken: bool,
}

/// Reads all clocks.
pub(super) fn read(cx: &mut Context<'_>, parameters: &mut Parameters) -> Clocks {
    let document = cx.document;
    let declared: Vec<Declared<'_>> =
        document.clocks.iter().map(|(name, value)| declared(cx, parameters, name, value)).collect();
    let index: HashMap<&str, usize> =
        declared.iter().enumerate().map(|(i, clock)| (clock.name.text.as_str(), i)).collect();
    let drivers = drivers(cx, &declared, &index);
    let mut clocks = Clocks::default();
    let mut kept: HashMap<usize, usize> = HashMap::new();
    let mut rate_spans = Vec::new();
    for (i, (clock, driver)) in declared.iter().zip(&drivers).enumerate() {
        let place = match (clock.rate, driver) {
            (Some(rate), Some(driver)) if drivers[*driver].is_some() && declared[*driver].rate.is_some() => {
                kept.insert(i, clocks.list.len());
                clocks.list.push(Clock { name: clock.name.text.clone(), rate, driver: *driver });
                clocks.spans.push(clock.name.span);
                rate_spans.push(clock.rate_span);
                Some(clocks.list.len() - 1)
            }
            _ => None,
        };
        clocks.names.insert(clock.name.text.clone(), place);
    }
    for clock in &mut clocks.list {
        clock.driver = kept.get(&clock.driver).copied().unwrap_or_default();
    }
    clocks.base = time_base(cx, &clocks.list, &rate_spans);
    clocks
}

fn declared<'a>(
    cx: &mut Context<'_>,
    parameters: &mut Parameters,
    name: &'a Name,
    value: &Value,
) -> Declared<'a> {
    let mut clock = Declared { name, of: None, rate: None, rate_span: value.span, broken: true };
    let expected = "a clock, `Driver(rate_hz: ...)` or `Derived(of: \"...\", rate_hz: ...)`";
    let Some(value) = parameters.replace(cx, value, Place::Graph, &mut Vec::new()) else {
        return clock;
    };
    let Some((kind, entries)) = cx.parts(&value, expected) else {
        return clock;
    };
    let derived = match kind.text.as_str() {
        "Driver" => false,
        "Derived" => true,
        other => {
            let message = format!("there is no kind of clock `{other}`");
            let diagnostic = Diagnostic::error("E0201", kind.span, message).label("unknown kind of clock");
            cx.report(cx.suggest(diagnostic, other, ["Driver", "Derived"].into_iter(), "there are", ""));
            return clock;
        }
    };
    let mut fields = cx.fields(kind, entries);
    clock.broken = false;
    if derived {
        match fields.take("of") {
            Some(of) => match cx.reading(|reading| String::read(&of, reading)) {
                Some(parent) => clock.of = Some((parent, of.span)),
                None => clock.broken = true,
            },
            None => {
                clock.broken = true;
                let help = "name the clock it is derived from: `of: \"audio\"`";
                cx.report(Diagnostic::missing(kind.span, "`Derived`", "of", help));
            }
        }
    }
    match fields.take("rate_hz") {
        Some(rate) => {
            clock.rate_span = rate.span;
            clock.rate = read_rate(cx, &rate);
        }
        None => {
            let help = "add `rate_hz: ...`, its ticks per second";
            cx.report(Diagnostic::missing(kind.span, &format!("`{}`", kind.text), "rate_hz", help));
        }
    }
    cx.reading(|reading| fields.finish(reading));
    clock
}

/// Reads a rate: `48000`, `59.94`, or `(1000, 3)` for a third of a kilohertz.
fn read_rate(cx: &mut Context<'_>, value: &Value) -> Option<Rate> {
    let rate = match &value.shape {
        Shape::Number(_, text) => Rate::parse(text),
        Shape::Tagged(Tagged { name: None, body: Body::Tuple(parts) }) if parts.len() == 2 => {
            let parts: Vec<Option<u64>> =
                parts.iter().map(|part| cx.reading(|reading| u64::read(part, reading))).collect();
            Rate::new(parts[0]?, parts[1]?)
        }
        _ => {
            let words = "a rate in hertz, a number or a ratio (1000, 3)";
            return cx.mismatch(value, &Expected::Described(Form::Number, words.into()));
        }
    };
    match rate {
        Ok(rate) => Some(rate),
        Err(error) => {
            let message = match error {
                RateError::NotANumber(text) => format!("{text} Hz is not a rate"),
                error => error.to_string(),
            };
            cx.report(
                Diagnostic::error("E0502", value.span, message)
                    .label("not a rate")
                    .help("choose a rate from 0.001 Hz to 100 MHz, such as 48000 or 59.94"),
            );
            None
        }
    }
}

/// The driver from which each clock derives; `None` after a reported error.
fn drivers(
    cx: &mut Context<'_>,
    declared: &[Declared<'_>],
    index: &HashMap<&str, usize>,
) -> Vec<Option<usize>> {
    // Inside `None` also of those that are being passed.
    let mut found: Vec<Option<Option<usize>>> = vec![None; declared.len()];
    let mut circles: HashMap<usize, Vec<usize>> = HashMap::new();
    for clock in 0..declared.len() {
        let (mut at, mut way) = (clock, Vec::new());
        let driver = loop {
            if let Some(known) = found[at] {
                if let Some(start) = way.iter().position(|passed| *passed == at) {
                    // Each circle is reported once, by its first clock in the file.
                    let mut round = way[start..].to_vec();
                    let first = (0..round.len()).min_by_key(|place| round[*place]).unwrap_or_default();
                    round.rotate_left(first);
                    circles.insert(round[0], round);
                }
                break known;
            }
            found[at] = Some(None);
            way.push(at);
            match &declared[at].of {
                _ if declared[at].broken => break None,
                None => break Some(at),
                Some((parent, _)) => match index.get(parent.as_str()) {
                    Some(next) => at = *next,
                    None => break None,
                },
            }
        };
        way.into_iter().for_each(|passed| found[passed] = Some(driver));
        let Declared { name, of: Some((parent, span)), broken: false, .. } = &declared[clock] else {
            continue;
        };
        if !index.contains_key(parent.as_str()) {
            let message = format!("there is no clock `{parent}`");
            let diagnostic = Diagnostic::error("E0206", *span, message).label("unknown clock");
            let known = declared.iter().map(|clock| clock.name.text.as_str());
            let known = known.filter(|known| *known != name.text);
            cx.report(cx.suggest(diagnostic, parent, known, "the clocks are", "it is the only clock"));
        }
        if let Some(round) = circles.remove(&clock) {
            let names = round.iter().chain([&clock]).map(|clock| declared[*clock].name.text.as_str());
            let names: Vec<&str> = names.collect();
            let message = format!("clock `{}` is derived from itself", name.text);
            cx.report(
                Diagnostic::error("E0501", *span, message)
                    .label(names.join(" from "))
                    .help("every clock leads to a `Driver`, which has a crystal or timer of its own"),
            );
        }
    }
    found.into_iter().map(Option::flatten).collect()
}

fn time_base(cx: &mut Context<'_>, clocks: &[Clock], spans: &[Span]) -> Option<TimeBase> {
    let rates: Vec<Rate> = clocks.iter().map(|clock| clock.rate).collect();
    if let Ok(base) = TimeBase::new(&rates) {
        return Some(base);
    }
    // Bisection for the first clock that has no common time unit with those before it.
    let mut fits = 0;
    let mut fails = rates.len();
    while fails - fits > 1 {
        let middle = (fits + fails) / 2;
        match TimeBase::new(&rates[..middle]) {
            Ok(_) => fits = middle,
            Err(_) => fails = middle,
        }
    }
    let culprit = fails.checked_sub(1)?;
    let message =
        format!("the rate of `{}` has no common time unit with the clocks before it", clocks[culprit].name);
    let mut diagnostic = Diagnostic::error("E0503", spans[culprit], message)
        .label(format!("{} and the others need a time unit too short for 64 bits", clocks[culprit].rate));
    if culprit > 0 {
        diagnostic = diagnostic.also(spans[0], "the first clock");
    }
    cx.report(diagnostic.help("use rates that are small ratios of one another: 48000, 10000, 240"));
    None
}

/// Assigns a clock to every node: as written, else inferred from its connections.
pub(super) fn assign(cx: &mut Context<'_>, graph: Bound, clocks: Clocks) -> Clocked {
    let given = (0..graph.nodes.len()).map(|node| given_clock(cx, &graph, &clocks, node)).collect();
    let clock_of = inferred(cx, &graph, &clocks, given);
    let graph = Clocked { graph, clocks, clock_of };
    report_unknown(cx, &graph);
    graph
}

/// Reports a graph without clocks.
pub(super) fn refuse_none(cx: &mut Context<'_>, clocks: &Clocks) {
    if clocks.list.is_empty() {
        cx.report(
            Diagnostic::error("E0506", cx.document.span, "the graph has no clock")
                .label("no clock defines when it runs")
                .help("declare a driver: `clocks: { \"audio\": Driver(rate_hz: 48000) }`"),
        );
    }
}

/// The clock that a node names.
fn given_clock(cx: &mut Context<'_>, graph: &Bound, clocks: &Clocks, node: usize) -> Option<usize> {
    let node = &graph.nodes[node];
    let value = node.clock.as_ref()?;
    if node.entry.is_file() {
        let message = format!("`{}` has no clock", node.entry.spec.name);
        cx.blame(node);
        return cx.fail(
            Diagnostic::error("E0505", value.span, message)
                .label("a file takes every signal at its own rate")
                .help("remove `clock`"),
        );
    }
    let name = cx.reading(|reading| String::read(value, reading));
    let known = name.as_ref().map(|name| clocks.names.get(name).copied());
    if let (Some(name), Some(None)) = (&name, known) {
        let diagnostic = Diagnostic::error("E0206", value.span, format!("there is no clock `{name}`"))
            .label("unknown clock");
        let known = cx.document.clocks.iter().map(|(name, _)| name.text.as_str());
        let none = format!("declare it: `clocks: {{ \"{name}\": Driver(rate_hz: 48000) }}`");
        let diagnostic = cx.suggest(diagnostic, name, known, "the clocks are", &none);
        cx.report_of(node, diagnostic);
    }
    let clock = known.flatten().flatten();
    if clock.is_none() {
        cx.blame(node);
    }
    clock
}

/// The clocks given and inferred: a node takes the clock of an input without bridge, the fastest if they differ, so that the
/// slower one is reported for its missing bridge; else that of a reader, else of another node of its device; else the only
/// clock.
fn inferred(
    cx: &Context<'_>,
    graph: &Bound,
    clocks: &Clocks,
    given: Vec<Option<usize>>,
) -> Vec<Option<usize>> {
    let (count, mut clock_of) = (graph.nodes.len(), given);
    let readers = graph.readers(|to, wire| wire.keeps_clock() && !graph.nodes[to].entry.is_file());
    let takes_none: Vec<bool> =
        graph.nodes.iter().map(|node| cx.is_faulty(node) || node.entry.is_file()).collect();
    let is_open = |clock_of: &[Option<usize>], node: usize| clock_of[node].is_none() && !takes_none[node];
    let bound: Vec<usize> = (0..count).filter(|node| graph.device_of[*node].is_some()).collect();
    // The nodes that hand on their clock, the next one last.
    let mut queue: Vec<(usize, f64)> =
        (0..count).filter_map(|node| Some((node, clocks.list[clock_of[node]?].rate.hz()))).collect();
    queue.sort_by(|(_, a), (_, b)| b.total_cmp(a));
    let mut queue: Vec<usize> = queue.into_iter().rev().map(|(node, _)| node).collect();
    // Nodes with a reader that has a clock, the first one on top.
    let mut backward = BinaryHeap::new();
    let mut next = 0;
    loop {
        while let Some(from) = queue.pop() {
            for &to in &readers[from] {
                if is_open(&clock_of, to) {
                    clock_of[to] = clock_of[from];
                    queue.push(to);
                }
            }
            let wires = graph.nodes[from].wires().filter(|(_, wire)| wire.keeps_clock());
            let sources = wires.map(|(_, wire)| wire.from).filter(|source| is_open(&clock_of, *source));
            backward.extend(sources.map(Reverse));
        }
        let by_reader = std::iter::from_fn(|| backward.pop()).find_map(|Reverse(node)| {
            let mut readers = readers[node].iter().filter(|_| is_open(&clock_of, node));
            readers.find_map(|to| Some((node, clock_of[*to]?)))
        });
        let by_device = || {
            bound.iter().filter(|node| is_open(&clock_of, **node)).find_map(|node| {
                let device = graph.device_of[*node];
                let mut others = bound.iter().filter(|other| graph.device_of[**other] == device);
                Some((*node, others.find_map(|other| clock_of[*other])?))
            })
        };
        let mut only = || {
            next = (next..count).find(|node| is_open(&clock_of, *node)).unwrap_or(count);
            (next < count && clocks.list.len() == 1 && clocks.names.len() == 1).then_some((next, 0))
        };
        let found = by_reader.or_else(by_device).or_else(&mut only);
        let Some((node, clock)) = found else { return clock_of };
        clock_of[node] = Some(clock);
        queue.push(node);
    }
}

/// Reports the first node of every chain without a clock; the others depend on it.
fn report_unknown(cx: &mut Context<'_>, graph: &Clocked) {
    let unknown: Vec<usize> = (0..graph.nodes.len())
        .filter(|node| graph.clock_of[*node].is_none() && !graph.nodes[*node].entry.is_file())
        .collect();
    let waits = |node: usize| {
        let mut wires = graph.nodes[node].wires();
        wires.any(|(_, wire)| wire.keeps_clock() && graph.clock_of[wire.from].is_none())
    };
    let mut roots: Vec<usize> = unknown.iter().copied().filter(|node| !waits(*node)).collect();
    if roots.is_empty() {
        roots.extend(unknown.first());
    }
    let clocks = &graph.clocks;
    let names: Vec<String> = clocks.list.iter().map(|clock| format!("\"{}\"", clock.name)).collect();
    for node in roots.into_iter().map(|node| &graph.nodes[node]) {
        if cx.is_faulty(node) || node.has_broken_input() || clocks.names.values().any(Option::is_none) {
            continue;
        }
        let help = match names.as_slice() {
            [] => "declare one: `clocks: { \"audio\": Driver(rate_hz: 48000) }`".to_owned(),
            names => format!("add `clock: ...` to `{}`, one of {}", node.entry.spec.name, names.join(", ")),
        };
        let message = format!("cannot infer the clock of `{}` from its connections", node.path);
        let diagnostic = Diagnostic::error("E0504", node.fields.span, message);
        cx.report_of(node, diagnostic.label("its clock is unknown").help(help));
    }
    unknown.into_iter().for_each(|node| cx.blame(&graph.nodes[node]));
}

/// Reports unused clocks.
pub(super) fn warn_unused(cx: &mut Context<'_>, graph: &Clocked) {
    let clocks = &graph.clocks.list;
    let mut used = vec![false; clocks.len()];
    for clock in graph.clock_of.iter().flatten() {
        used[*clock] = true;
        used[clocks[*clock].driver] = true;
    }
    for clock in (0..clocks.len()).filter(|clock| !used[*clock]).map(|clock| &clocks[clock]) {
        let declared = cx.document.clocks.iter().find(|(name, _)| name.text == clock.name);
        if let Some((name, _)) = declared {
            let message = format!("clock `{}` is never used", clock.name);
            cx.report(
                Diagnostic::warning("W0105", name.span, message)
                    .label("no node runs on it")
                    .help("remove it, or give it to a node: `clock: ...`"),
            );
        }
    }
}
