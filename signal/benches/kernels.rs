//! Each kernel beside the plain version of it, in one run: outputs compared, then timed in turns, medians of each.

#[path = "../../benches/contest/mod.rs"]
mod contest;

use contest::Work;
use criterion::{Criterion, Throughput};
use haptograph_signal::arma::{ArmaFilter, Form, VoiceBank, WarpedBank, WarpedLattice};
use haptograph_signal::filter::{Sections, SectionsState, butterworth_highpass};
use haptograph_signal::noise::Gaussian;
use haptograph_signal::resample::{Quality, Resampler};
use haptograph_signal::time::Rate;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use std::f64::consts::TAU;
use std::hint::black_box;

/// Samples a call works on.
const BLOCK: usize = 4100;
/// Samples a set of coefficients lasts: 240 Hz at 10 kHz.
const FRAME: usize = 41;
/// Turns each contender gets.
const TURNS: usize = 101;

fn main() {
    ratios();
    if std::env::args().any(|arg| arg == "--ratios") {
        return;
    }
    let mut criterion = Criterion::default().configure_from_args();
    regressions(&mut criterion);
    criterion.final_summary();
}

fn samples(title: &str, units: usize) -> Work<'_> {
    Work { title, unit: "sample", units, turns: TURNS }
}

fn ratios() {
    noise();
    one_voice(&[], "AR(20), one voice, new coefficients every 41 samples");
    one_voice(&[0.5, -0.3, 0.2, 0.1], "ARMA(20, 4), one voice, new coefficients every 41 samples");
    frozen();
    warped_voice();
    updates();
    voices(Form::Direct);
    voices(Form::Lattice);
    warped_voices();
    resampling();
}

fn noise() {
    let mut x = vec![0.0; BLOCK];
    let mut y = vec![0.0; BLOCK];
    let mut gaussian = Gaussian::new(1);
    let mut generator = Xoshiro256PlusPlus::seed_from_u64(1);
    let mut ziggurat = || {
        for x in black_box(&mut x).iter_mut() {
            *x = StandardNormal.sample(&mut generator);
        }
    };
    let mut ours = || gaussian.fill(black_box(&mut y));
    let contenders: &mut [(&str, &mut dyn FnMut())] =
        &mut [("rand_distr ziggurat", &mut ziggurat), ("Gaussian::fill", &mut ours)];
    contest::compare(samples("unit normal noise", BLOCK), contenders);
}

/// The filter as one first writes it: histories shifted by one at every sample.
struct HistoryShift {
    ar: Vec<f64>,
    ma: Vec<f64>,
    y: Vec<f64>,
    e: Vec<f64>,
}

impl HistoryShift {
    fn new(p: usize, q: usize) -> Self {
        Self { ar: vec![0.0; p], ma: vec![0.0; q], y: vec![0.0; p], e: vec![0.0; q] }
    }

    fn process(&mut self, excitation: &[f64], out: &mut [f64]) {
        for (e, out) in excitation.iter().zip(out) {
            let mut y = *e;
            for k in 0..self.ma.len() {
                y += self.ma[k] * self.e[k];
            }
            for k in 0..self.ar.len() {
                y -= self.ar[k] * self.y[k];
            }
            for k in (1..self.y.len()).rev() {
                self.y[k] = self.y[k - 1];
            }
            for k in (1..self.e.len()).rev() {
                self.e[k] = self.e[k - 1];
            }
            if let Some(newest) = self.y.first_mut() {
                *newest = y;
            }
            if let Some(newest) = self.e.first_mut() {
                *newest = *e;
            }
            *out = y;
        }
    }
}

/// Models of order 20 along a stroke: ten resonances that move a little from frame to frame.
fn models(count: usize, seed: usize) -> Vec<Vec<f64>> {
    let model = |i: usize| {
        let mut a = vec![1.0];
        for pair in 0..10 {
            let radius = 0.98 - 0.02 * pair as f64;
            let frequency = (0.5 + pair as f64) / 20.5 + 0.002 * ((i + seed) as f64 * 0.1).sin();
            let factor = [1.0, -2.0 * radius * (TAU * frequency).cos(), radius * radius];
            let mut product = vec![0.0; a.len() + 2];
            for (i, x) in a.iter().enumerate() {
                for (j, y) in factor.iter().enumerate() {
                    product[i + j] += x * y;
                }
            }
            a = product;
        }
        a.split_off(1)
    };
    (0..count).map(model).collect()
}

fn one_voice(ma: &[f64], title: &str) {
    let sets = models(BLOCK / FRAME, 0);
    let mut e = vec![0.0; BLOCK];
    Gaussian::new(2).fill(&mut e);
    let mut shift = HistoryShift::new(20, ma.len());
    shift.ma.copy_from_slice(ma);
    let mut naive = |out: &mut [f64]| {
        for ((set, e), out) in sets.iter().zip(e.chunks(FRAME)).zip(out.chunks_mut(FRAME)) {
            shift.ar.copy_from_slice(set);
            shift.process(e, out);
        }
    };
    let render = |filter: &mut ArmaFilter, out: &mut [f64]| {
        for ((set, e), out) in sets.iter().zip(e.chunks(FRAME)).zip(out.chunks_mut(FRAME)) {
            let _ = filter.set_coefficients(set, ma, 1.0);
            filter.process(e, out);
        }
    };
    let mut direct = ArmaFilter::new(Form::Direct);
    let mut lattice = ArmaFilter::new(Form::Lattice);
    let (mut x, mut y, mut z) = (vec![0.0; BLOCK], vec![0.0; BLOCK], vec![0.0; BLOCK]);
    naive(&mut x);
    render(&mut direct, &mut y);
    assert!(
        x.iter().zip(&y).all(|(x, y)| (x - y).abs() < 1e-9 * (1.0 + x.abs())),
        "the direct form is wrong"
    );
    let mut naive = || naive(black_box(&mut x));
    let mut direct = || render(&mut direct, black_box(&mut y));
    let mut lattice = || render(&mut lattice, black_box(&mut z));
    let contenders: &mut [(&str, &mut dyn FnMut())] =
        &mut [("history shift", &mut naive), ("DirectForm", &mut direct), ("Lattice", &mut lattice)];
    contest::compare(samples(title, BLOCK), contenders);
}

/// The warping factor of learned surfaces.
const WARPING: f64 = 0.8;

/// The high-pass of learned surfaces, at rest.
fn output_highpass() -> Option<SectionsState> {
    let once = butterworth_highpass(2, 20.0, 10_000.0).ok()?;
    let sections = once.sections.iter().chain(&once.sections).copied().collect();
    Some(SectionsState::new(&Sections { sections }))
}

/// The warped lattice with its high-pass beside the plain one, which has none.
fn warped_voice() {
    let sets = models(BLOCK / FRAME, 0);
    let mut e = vec![0.0; BLOCK];
    Gaussian::new(2).fill(&mut e);
    let (mut plain, mut warped) = (ArmaFilter::new(Form::Lattice), WarpedLattice::new());
    let Some(mut highpass) = output_highpass() else {
        return;
    };
    let (mut x, mut y, mut z) = (vec![0.0; BLOCK], vec![0.0; BLOCK], vec![0.0; BLOCK]);
    for (lasting, title) in [(FRAME, "new coefficients every 41 samples"), (BLOCK, "one set of coefficients")]
    {
        let chunks = || sets.iter().zip(e.chunks(lasting));
        let mut run_plain = || {
            for ((set, e), out) in chunks().zip(black_box(&mut x).chunks_mut(lasting)) {
                let _ = plain.set_coefficients(set, &[], 1.0);
                plain.process(e, out);
            }
        };
        let mut run_warped = || {
            for ((set, e), out) in chunks().zip(black_box(&mut y).chunks_mut(lasting)) {
                let _ = warped.set_coefficients(set, WARPING, 1.0);
                warped.process(e, out);
            }
        };
        let mut run_highpass = || highpass.process_in_place(black_box(&mut z));
        let contenders: &mut [(&str, &mut dyn FnMut())] = &mut [
            ("Lattice", &mut run_plain),
            ("WarpedLattice", &mut run_warped),
            ("its high-pass, to be added", &mut run_highpass),
        ];
        contest::compare(samples(&format!("AR(20), one voice, {title}"), BLOCK), contenders);
    }
}

/// The cost of new coefficients alone.
fn updates() {
    let sets = models(BLOCK / FRAME, 0);
    let (mut plain, mut warped) = (ArmaFilter::new(Form::Lattice), WarpedLattice::new());
    let mut set_plain = || {
        for set in &sets {
            let _ = plain.set_coefficients(black_box(set), &[], 1.0);
        }
    };
    let mut set_warped = || {
        for set in &sets {
            let _ = warped.set_coefficients(black_box(set), WARPING, 1.0);
        }
    };
    let contenders: &mut [(&str, &mut dyn FnMut())] =
        &mut [("Lattice", &mut set_plain), ("WarpedLattice", &mut set_warped)];
    let work = Work { title: "AR(20), new coefficients", unit: "set", units: sets.len(), turns: TURNS };
    contest::compare(work, contenders);
}

fn frozen() {
    let sets = models(1, 0);
    let mut e = vec![0.0; BLOCK];
    Gaussian::new(2).fill(&mut e);
    let mut shift = HistoryShift::new(20, 0);
    shift.ar.copy_from_slice(&sets[0]);
    let mut direct = ArmaFilter::new(Form::Direct);
    let mut lattice = ArmaFilter::new(Form::Lattice);
    for filter in [&mut direct, &mut lattice] {
        let _ = filter.set_coefficients(&sets[0], &[], 1.0);
    }
    let (mut x, mut y, mut z) = (vec![0.0; BLOCK], vec![0.0; BLOCK], vec![0.0; BLOCK]);
    shift.process(&e, &mut x);
    direct.process(&e, &mut y);
    lattice.process(&e, &mut z);
    for (x, (y, z)) in x.iter().zip(y.iter().zip(&z)) {
        assert!((x - y).abs() < 1e-9 * (1.0 + x.abs()) && (x - z).abs() < 1e-9 * (1.0 + x.abs()));
    }
    let mut naive = || shift.process(&e, black_box(&mut x));
    let mut run_direct = || direct.process(&e, black_box(&mut y));
    let mut run_lattice = || lattice.process(&e, black_box(&mut z));
    let contenders: &mut [(&str, &mut dyn FnMut())] =
        &mut [("history shift", &mut naive), ("DirectForm", &mut run_direct), ("Lattice", &mut run_lattice)];
    contest::compare(samples("AR(20), one voice, one set of coefficients", BLOCK), contenders);
}

fn voices(form: Form) {
    const VOICES: usize = 64;
    let sets = models(BLOCK / FRAME, 0);
    // As in a graph, buffers of one frame are used again and again; the single voice has as many samples in the cache.
    let mut e = vec![0.0; FRAME * VOICES];
    Gaussian::new(3).fill(&mut e);
    let mut bank = VoiceBank::new(form, VOICES);
    let mut single = ArmaFilter::new(form);
    let (mut x, mut y) = (vec![0.0; FRAME * VOICES], vec![0.0; FRAME * VOICES]);
    let mut alone = |out: &mut [f64]| {
        for ((set, e), out) in sets.iter().cycle().zip(e.chunks(FRAME)).zip(out.chunks_mut(FRAME)) {
            let _ = single.set_coefficients(set, &[], 1.0);
            single.process(e, out);
        }
    };
    let mut together = |out: &mut [f64]| {
        for i in 0..sets.len() {
            for voice in 0..VOICES {
                let _ = bank.set_coefficients(voice, &sets[(i + voice) % sets.len()], &[], 1.0);
            }
            bank.process(&e, out);
        }
    };
    let mut alone = || alone(black_box(&mut x));
    let mut run_together = || together(black_box(&mut y));
    let title = format!("AR(20), {VOICES} voices, {form:?}, new coefficients every 41 samples, a voice");
    // The two work on different numbers of samples: count the single voice as so many.
    let contenders: &mut [(&str, &mut dyn FnMut())] = &mut [("one voice", &mut alone)];
    let one = contest::compare(samples(&title, FRAME * VOICES), contenders)[0];
    let contenders: &mut [(&str, &mut dyn FnMut())] = &mut [("VoiceBank", &mut run_together)];
    let many = contest::compare(samples("", BLOCK * VOICES), contenders)[0];
    println_ratio(one / many);
}

/// Plain and warped lattices side by side.
fn warped_voices() {
    const VOICES: usize = 64;
    let sets = models(BLOCK / FRAME, 0);
    let mut e = vec![0.0; FRAME * VOICES];
    Gaussian::new(3).fill(&mut e);
    let (mut x, mut y, mut z) = (e.clone(), e.clone(), e.clone());
    let new = || VoiceBank::new(Form::Lattice, VOICES);
    let (mut plain, mut together, mut warped) = (new(), new(), WarpedBank::new(VOICES));
    let mut run_plain = || {
        for i in 0..sets.len() {
            for voice in 0..VOICES {
                let _ = plain.set_coefficients(voice, &sets[(i + voice) % sets.len()], &[], 1.0);
            }
            plain.process(&e, black_box(&mut x));
        }
    };
    // As texture models come out of the interpolation of many voices: row k has the coefficient k of each.
    const GROUP: usize = WarpedBank::GROUP;
    let rows = |i: usize, group: usize| -> Vec<[f64; GROUP]> {
        let of = |voice: usize, k: usize| sets[(i + group * GROUP + voice) % sets.len()][k];
        (0..20).map(|k| std::array::from_fn(|voice| of(voice, k))).collect()
    };
    let groups: Vec<Vec<Vec<[f64; GROUP]>>> =
        (0..sets.len()).map(|i| (0..VOICES / GROUP).map(|group| rows(i, group)).collect()).collect();
    let mut run_together = || {
        for rows in &groups {
            for (group, rows) in rows.iter().enumerate() {
                let _ = together.set_group(group, rows, &[], &[1.0; GROUP]);
            }
            together.process(&e, black_box(&mut z));
        }
    };
    let mut run_warped = || {
        for rows in &groups {
            for (group, rows) in rows.iter().enumerate() {
                let _ = warped.set_group(group, rows, WARPING, &[1.0; GROUP]);
            }
            warped.process(&e, black_box(&mut y));
        }
    };
    let contenders: &mut [(&str, &mut dyn FnMut())] = &mut [
        ("VoiceBank of lattices", &mut run_plain),
        ("VoiceBank, a group at once", &mut run_together),
        ("WarpedBank", &mut run_warped),
    ];
    let title = "AR(20), 64 voices, new coefficients every 41 samples, a voice";
    contest::compare(samples(title, BLOCK * VOICES), contenders);
    for (group, rows) in groups[0].iter().enumerate() {
        let _ = together.set_group(group, rows, &[], &[1.0; GROUP]);
        let _ = warped.set_group(group, rows, WARPING, &[1.0; GROUP]);
    }
    let mut run_plain = || together.process(&e, black_box(&mut x));
    let mut run_warped = || warped.process(&e, black_box(&mut y));
    let contenders: &mut [(&str, &mut dyn FnMut())] =
        &mut [("VoiceBank of lattices", &mut run_plain), ("WarpedBank", &mut run_warped)];
    let title = "AR(20), 64 voices, one set of coefficients, a voice";
    contest::compare(samples(title, FRAME * VOICES), contenders);
}

#[expect(clippy::print_stdout, reason = "a bench reports")]
fn println_ratio(ratio: f64) {
    println!("  a voice is {ratio:.2} x cheaper");
}

fn resampling() {
    let (input, output) = (Rate::from_hz(10_000), Rate::from_hz(48_000));
    let (Ok(input), Ok(output)) = (input, output) else {
        return;
    };
    let mut x = vec![0.0; 5000];
    Gaussian::new(4).fill(&mut x);
    let mut y = vec![0.0; 24_000];
    for quality in [Quality::LOW_LATENCY, Quality::STANDARD] {
        let Ok(mut resampler) = Resampler::new(input, output, quality) else {
            return;
        };
        let mut run = || {
            resampler.process(&x, black_box(&mut y));
        };
        contest::compare(
            samples(&format!("resampling 10 to 48 kHz, {quality:?}"), 24_000),
            &mut [("Resampler", &mut run)],
        );
    }
}

/// The same kernels for criterion's history of earlier runs.
fn regressions(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("kernels");
    group.throughput(Throughput::Elements(BLOCK as u64));
    let mut e = vec![0.0; BLOCK];
    let mut y = vec![0.0; BLOCK];
    let mut gaussian = Gaussian::new(1);
    group.bench_function("gaussian", |b| b.iter(|| gaussian.fill(black_box(&mut e))));
    let sets = models(1, 0);
    for form in [Form::Direct, Form::Lattice] {
        let mut filter = ArmaFilter::new(form);
        let _ = filter.set_coefficients(&sets[0], &[], 1.0);
        group
            .bench_function(format!("{form:?} AR(20)"), |b| b.iter(|| filter.process(&e, black_box(&mut y))));
    }
    group.finish();
}
