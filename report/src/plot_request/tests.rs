use super::*;
use crate::record::Reduction;
use haptograph_engine::frame::{Kind, Record};
use haptograph_engine::graph::NodeId;

use haptograph_signal::time::Rate;

fn trace(name: &str, kind: Kind, hz: u64, form: Form, frames: &[f64]) -> (WatchedOutput, Trace) {
    let stream = Stream {
        name: name.into(),
        kind,
        quantity: Quantity::FORCE,
        rate: Rate::from_hz(hz).unwrap(),
        simulated: true,
    };
    let mut trace = Trace::of(stream.clone(), form);
    trace.extend(frames);
    let (node, output) = (NodeId::default(), 0);
    (WatchedOutput { node, output, stream }, trace)
}

fn asked_of(title: &str, form: Form, signals: Vec<WatchedOutput>) -> PlotRequest {
    PlotRequest {
        title: title.into(),
        form,
        names: signals.iter().map(|signal| signal.stream.name.clone()).collect(),
        signals,
    }
}

fn plots(asked: &PlotRequest, runs: &[RunTraces<'_>]) -> Vec<Plot> {
    asked.plots(runs, &mut Inks::default())
}

#[test]
fn signals_of_different_rates_are_paired_by_time() {
    let ramp = |n: u32, step: f64| (0..n).map(|k| f64::from(k) * step).collect::<Vec<_>>();
    let (x, slow) = trace("x", Kind::SCALAR, 100, Form::Against, &ramp(10, 0.01));
    let (y, fast) = trace("y", Kind::SCALAR, 1000, Form::Against, &ramp(100, 0.001));
    let asked = asked_of("t", Form::Against, vec![x, y]);
    let plots = plots(&asked, &[RunTraces { name: "", traces: &[slow, fast] }]);
    let Mark::Dots(_, points) = &plots[0].marks[0] else { panic!("{plots:?}") };
    assert_eq!(points.len(), 100);
    assert!(points.iter().all(|(x, y)| y - x > -1e-12 && y - x < 0.01));
}

#[test]
fn a_way_keeps_its_shape_and_is_interrupted_in_the_air() {
    let touching = |x: f64, y: f64, yes: bool| {
        let contact = Contact { touching: yes, ihip_m: [x, y, 0.0], ..Contact::default() };
        contact.to_components()
    };
    let frames = [touching(0.0, 0.0, true), touching(9.0, 9.0, false), touching(0.01, 0.02, true)];
    let (watch, trace) = trace("touch.contact", Contact::KIND, 1000, Form::Path, &frames.concat());
    let asked = asked_of("way", Form::Path, vec![watch]);
    let drawn = RunTraces { name: "", traces: &[trace] };
    let plot = plots(&asked, &[drawn]).remove(0);
    let (Some((x0, x1)), Some((y0, y1))) = (plot.x.range, plot.y.range) else { panic!("{plot:?}") };
    let (per_x, per_y) = ((x1 - x0) / PATH_FRAME.0, (y1 - y0) / PATH_FRAME.1);
    assert!((per_x / per_y - 1.0).abs() < 1e-9 && x1 < 50.0);
    assert!(matches!(&plot.marks[0], Mark::Line(_, points) if points[1].0.is_nan()));
}

#[test]
fn a_way_that_all_runs_share_is_one_curve_and_the_second_of_a_run_is_dashed() {
    let way = |name: &str, x: f64| trace(name, Kind::VECTOR, 1000, Form::Path, &[0.0, 0.0, 0.0, x, 1.0, 0.0]);
    let asked = asked_of("Where", Form::Path, vec![way("hand", 1.0).0, way("found", 1.0).0]);
    let runs = [2.0, 3.0].map(|x| [way("hand", 1.0).1, way("found", x).1]);
    let drawn = ["a", "b"].iter().zip(&runs);
    let drawn: Vec<RunTraces<'_>> = drawn.map(|(name, traces)| RunTraces { name, traces }).collect();
    let plots = plots(&asked, &drawn);
    let styles = plots[0].marks.iter().map(|mark| match mark {
        Mark::Line(style, _) => (style.name.as_str(), style.weight),
        other => panic!("{other:?}"),
    });
    let expected =
        [("hand, all runs", Weight::Hair), ("a: found", Weight::Dashed), ("b: found", Weight::Dashed)];
    assert_eq!(styles.collect::<Vec<_>>(), expected);
    assert!(!plots[0].caption.contains("touches"));
}

#[test]
fn what_never_changes_is_said_and_not_drawn() {
    let (moving, first) = trace("load", Kind::SCALAR, 1000, Form::OverTime, &[1.0, 2.0, 3.0]);
    let (silent, second) = trace("shake", Kind::SCALAR, 1000, Form::OverTime, &[0.0; 3]);
    let (event, never) = trace("too hard", Kind::EVENT, 1000, Form::OverTime, &[0.0; 6]);
    let asked = |signals: Vec<WatchedOutput>| asked_of("Forces", Form::OverTime, signals);
    let drawn = |traces| RunTraces { name: "", traces };
    let both = [first, second];
    let found = plots(&asked(vec![moving, silent.clone()]), &[drawn(&both)]);
    assert_eq!((found.len(), found[0].marks.len()), (1, 1));
    let caption = &found[0].caption;
    assert_eq!(caption, "Rises from 1 to 3 N. shake: constant 0 N.");
    for (signal, trace, text) in [(silent, &both[1], "constant 0 N."), (event, &never, "never.")] {
        let found = plots(&asked(vec![signal]), &[drawn(std::slice::from_ref(trace))]);
        assert_eq!((found.len(), found[0].caption.as_str()), (1, text));
        assert!(!found[0].to_figure().contains("<svg"), "{}", found[0].to_figure());
    }
}

#[test]
fn several_runs_share_a_frame_and_are_named() {
    let frames = [1.0, 2.0, 3.0];
    let (watch, first) = trace("load", Kind::SCALAR, 1000, Form::OverTime, &frames);
    let (_, second) = trace("load", Kind::SCALAR, 1000, Form::OverTime, &[1.0, 2.0, 4.0]);
    let asked = asked_of("force", Form::OverTime, vec![watch]);
    let runs = |other| {
        [("soft", &first), ("hard", other)]
            .map(|(name, trace)| RunTraces { name, traces: std::slice::from_ref(trace) })
    };
    let found = plots(&asked, &runs(&second));
    assert_eq!((found.len(), found[0].marks.len()), (1, 2));
    assert!(found[0].to_figure().contains("hard"));
    assert!(!asked.is_same(&runs(&second)) && asked.is_same(&runs(&first)));
    let found = plots(&asked, &runs(&first));
    assert_eq!((found.len(), found[0].marks.len()), (1, 1));
    assert!(found[0].note.contains("same in all runs"));
}

#[test]
fn plain_numbers_are_named_by_what_they_are() {
    let number = |name: &str, values: &[f64]| {
        let (mut watch, mut trace) = trace(name, Kind::SCALAR, 1000, Form::OverTime, values);
        watch.stream.quantity = Quantity::NUMBER;
        trace.stream.quantity = Quantity::NUMBER;
        (watch, trace)
    };
    for (values, label, caption) in [
        (&[0.0, 1.0, 0.0, 0.0][..], "Too hard (0 or 1)", "1 for 25 % of the time."),
        (&[0.3, 0.4, 0.35][..], "Too hard (1)", "Mean 0.35, from 0.3 to 0.4."),
    ] {
        let (watch, trace) = number("too hard", values);
        let drawn = RunTraces { name: "", traces: &[trace] };
        let plot = plots(&asked_of("Warning", Form::OverTime, vec![watch]), &[drawn]).remove(0);
        assert_eq!((plot.y.label.as_str(), plot.caption.as_str()), (label, caption));
    }
}

#[test]
fn of_many_runs_the_smallest_and_the_largest_level_are_told() {
    let of = |gain: f64| trace("load", Kind::SCALAR, 1000, Form::OverTime, &[gain, -gain, gain]);
    let (watch, first) = of(2.0);
    let traces = [first, of(1.0).1, of(3.0).1];
    let runs = ["a = 2", "a = 1", "a = 3"].iter().zip(&traces);
    let runs = runs.map(|(name, trace)| RunTraces { name, traces: std::slice::from_ref(trace) });
    let asked = asked_of("force", Form::OverTime, vec![watch]);
    let plot = plots(&asked, &runs.collect::<Vec<_>>()).remove(0);
    assert_eq!(plot.caption, "RMS from 1 N (a = 1) to 3 N (a = 3).");
}
