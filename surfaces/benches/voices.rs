//! Many textures at once beside one after the other, and beside what the processor can do at most.
//!
//! `cargo bench -p haptograph-surfaces --bench voices`. For NumPy and SciPy see `benches/many_voices`.

#[path = "../../benches/contest/mod.rs"]
mod contest;

use contest::Work;
use haptograph_signal::noise::Gaussian;
use haptograph_surfaces::files;
use haptograph_surfaces::layers::Clips;
use haptograph_surfaces::rendering::{
    RandomWalk, SynthesisSettings, Trajectory, Voice, synthesise, synthesise_many,
};
use haptograph_surfaces::{ArmaModel, ModelAt, TextureModel};
use pulp::{Arch, Simd, WithSimd};
use std::hint::black_box;
use std::path::Path;

const VOICES: usize = 64;
const SECONDS: f64 = 1.0;
/// Multiplications and multiply-adds of a lattice, plain or warped, a stage and sample: see the bank of `haptograph_signal::arma`. The
/// additions of the plain one have units of their own on most processors.
const OPERATIONS: usize = 4;
/// The same of the rest of the chain, a sample: two sections of the high-pass, the gain of the grain, the scaling. The noise and
/// what is done once a tick are not counted.
const BESIDE: usize = 10 + 3 + 1;

fn main() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/surfaces/t2-canvas.ron");
    let surface = files::load(&path).expect("the shipped surface");
    let whole = surface.texture.expect("it has a texture");
    let bare = whole.clone().with_grain(None).with_highpass_hz(None).expect("less is sound");
    let mut recorded = vec![0.0; 200_000];
    Gaussian::new(1).fill(&mut recorded);
    let clips = Clips::new(&recorded).expect("20 s of noise");
    let clipped = whole.clone().with_grain(None).with_clips(Some(clips));
    let plain = on_the_plain_axis(&bare);
    for (name, texture) in [
        ("with its grain and high-pass", &whole),
        ("with clips and its high-pass", &clipped),
        ("the map alone", &bare),
        ("the thesis's kind", &plain),
    ] {
        voices(name, texture);
    }
    let filter = OPERATIONS * whole.ar_order();
    bound("the filter", filter);
    bound("the chain without its noise", filter + BESIDE);
}

/// The same map with the line spectral frequencies of its models on the plain axis.
fn on_the_plain_axis(texture: &TextureModel) -> TextureModel {
    let models = texture.models().iter().map(|at| {
        let model = ArmaModel::from_lsf(at.model.ar_lsf(), &[], 1.0, at.model.variance());
        ModelAt { model: model.expect("ascending frequencies are stable"), ..at.clone() }
    });
    let triangles = texture.triangles().to_vec();
    TextureModel::new(texture.rate_hz(), models.collect(), triangles).expect("the same map")
}

fn voices(name: &str, texture: &TextureModel) {
    let walk = |seed: u64| RandomWalk { seconds: SECONDS, seed, ..RandomWalk::default() }.trajectory();
    let walks: Vec<Trajectory> = (0..VOICES as u64).map(walk).collect();
    let settings = |seed: u64| SynthesisSettings { seed, ..SynthesisSettings::default() };
    let voice = |(trajectory, seed)| Voice { texture, trajectory, settings: settings(seed) };
    let voices: Vec<Voice<'_>> = walks.iter().zip(0..).map(voice).collect();
    let mut alone = || {
        for voice in &voices {
            let _ = black_box(synthesise(voice.texture, voice.trajectory, &voice.settings));
        }
    };
    let in_banks = |size: usize| {
        for bank in voices.chunks(size) {
            let _ = black_box(synthesise_many(bank, 1));
        }
    };
    let work = Work {
        title: &format!(
            "{VOICES} voices of order {} at 10 kHz, {name}, new coefficients at 240 Hz",
            texture.ar_order()
        ),
        unit: "voice and sample",
        units: VOICES * (SECONDS * texture.rate_hz()) as usize,
        turns: 7,
    };
    let contenders: &mut [(&str, &mut dyn FnMut())] = &mut [
        ("synthesise", &mut alone),
        ("synthesise_many, banks of 1", &mut || in_banks(1)),
        ("synthesise_many, banks of 16", &mut || in_banks(16)),
        ("synthesise_many, banks of 64", &mut || in_banks(64)),
    ];
    contest::compare(work, contenders);
}

/// Multiply-adds that wait for nothing but the units, as many as fit in the registers of any processor; gives how many they are.
struct Peak;

impl WithSimd for Peak {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> usize {
        const ROUNDS: usize = 100_000;
        const CHAINS: usize = 12;
        let (factor, offset) = (simd.splat_f64s(0.999), simd.splat_f64s(0.001));
        let mut sums = [simd.splat_f64s(black_box(0.5)); CHAINS];
        for _ in 0..ROUNDS {
            for sum in &mut sums {
                *sum = simd.mul_add_f64s(*sum, factor, offset);
            }
        }
        let nothing = simd.splat_f64s(0.0);
        let total = sums.into_iter().fold(nothing, |a, b| simd.add_f64s(a, b));
        black_box(simd.reduce_sum_f64s(total));
        ROUNDS * CHAINS * S::F64_LANES
    }
}

fn bound(what: &str, per_sample: usize) {
    let mut run = || {
        black_box(Arch::new().dispatch(Peak));
    };
    let work = Work {
        title: &format!("the {per_sample} operations of a sample of {what}, where they wait for nothing"),
        unit: "voice and sample",
        units: Arch::new().dispatch(Peak) / per_sample,
        turns: 21,
    };
    contest::compare(work, &mut [("multiply-adds", &mut run)]);
}
