//! Synthesis filters that an embedding program gives while the graph runs.

use super::frames::{Coefficients, Model};
use haptograph_engine::frame::Scalar;
use haptograph_engine::node::{BuildContext, BuildError, Built, Io, NodeKind, Port, Processor, Tick};
use haptograph_engine::settings::NoSettings;
use haptograph_signal::prediction::{step_down, step_up};
use haptograph_signal::quantity::Quantity;
use haptograph_signal::units::Milliseconds;
use haptograph_surfaces::lsf::lsf_to_ar;
use std::f64::consts::PI;

haptograph_engine::node! {
    /// Models that an embedding program gives while the graph runs, such as the output of a neural network: one frame is
    /// the innovation variance, then up to 32 coefficients. Its endpoint is a `Host`.
    pub(crate) struct LiveModel(NoSettings) in "texture";
    example: r#""network": LiveModel(clock: "control", endpoint: "network")"#;
    out MODEL: Model = Port::of(Quantity::NUMBER, "The model; it holds while the program gives none.");
}

haptograph_engine::choices! {
    /// What the coefficients of a model are.
    pub(crate) enum ModelForm {
        /// a_1 .. a_p of A(z) = 1 + sum a_k z^-k.
        Ar,
        /// Line spectral frequencies, rad, ascending between 0 and pi.
        Lsf,
    }
}

haptograph_engine::settings! {
    /// Settings of [`SteeredModel`].
    pub(crate) struct SteeredModelSettings {
        /// What the coefficients are.
        form: ModelForm;
        /// Warping factor of their frequency axis: that of the surface from which they come; 0 for an unwarped axis.
        warping: f64, in -0.99..=0.99;
        /// Duration of the cross-fade to a new model.
        fade_ms: Milliseconds = Milliseconds(10.0), in 0.0..=10_000.0;
    }
}

haptograph_engine::node! {
    /// Makes a stable synthesis filter of whatever models it gets, and fades to each from where it is. A new model takes part
    /// from the tick of its arrival on, and alone after `fade_ms`. LSFs that do not ascend are sorted and moved apart; the
    /// poles of a model that is unstable, or nearly so (a reflection coefficient beyond 0.9999), are moved towards 0 by the
    /// largest common factor that makes it stable (bandwidth expansion), and so are those of a filter that is stable but not
    /// with coefficients rounded to `f64`; a negative variance and coefficients that are not finite are refused, and the
    /// model before stays.
    pub(crate) struct SteeredModel(SteeredModelSettings) in "texture";
    source: "2.4.1; fades between reflection coefficients, under which a filter stays stable (Gray and Markel 1975)";
    example: r#""steer": SteeredModel(model: "network", form: Lsf, warping: 0.85)"#;
    in MODEL: Model = Port::of(Quantity::NUMBER, "The variance, then the coefficients.");
    out COEFFICIENTS: Coefficients<'static> = Port::of(Quantity::NUMBER, "The synthesis filter and its variance.");
    out REFUSED: Scalar = Port::of(Quantity::NUMBER, "Number of models refused so far.");
    out CORRECTED: Scalar = Port::of(Quantity::NUMBER, "Number of models made stable so far; one that holds counts once.");
}

impl NodeKind for SteeredModel {
    fn build(settings: SteeredModelSettings, cx: &BuildContext) -> Result<Built<Self>, BuildError> {
        let SteeredModelSettings { form, warping, fade_ms } = settings;
        let fade_ticks = (fade_ms.si() * cx.rate.hz()).round().max(1.0);
        Ok(Built::new(Steering {
            form,
            warping,
            fade_ticks,
            ticks: fade_ticks,
            given: Model::default(),
            ends: [Point::default(); 2],
            refused: 0.0,
            corrected: 0.0,
        }))
    }
}

const MAX_ORDER: usize = Coefficients::MAX_ORDER;
/// Least distance of corrected LSFs, rad: between neighbours, from 0 and from pi.
const LEAST_GAP: f64 = 1e-3;
/// Steps in which the factor of poles that are moved is found.
const HALVINGS: i32 = 60;
/// Largest reflection coefficient: beyond it a filter rings for seconds.
const MOST: f64 = 0.9999;
/// Largest one of a filter whose coefficients were rounded.
const MOST_ROUNDED: f64 = 0.99995;

/// A filter between which others lie.
#[derive(Debug, Clone, Copy, Default)]
struct Point {
    /// Standard deviation of the innovation, m/s2.
    deviation: f64,
    reflection: [f64; MAX_ORDER],
}

impl Point {
    fn towards(&self, to: &Self, share: f64) -> Self {
        let mix = |from: f64, to: f64| from + share * (to - from);
        Self {
            deviation: mix(self.deviation, to.deviation),
            reflection: std::array::from_fn(|k| mix(self.reflection[k], to.reflection[k])),
        }
    }
}

/// A point, and whether the model was corrected to make it.
fn point_of(form: &ModelForm, model: &Model) -> Option<(Point, bool)> {
    let [variance, given @ ..] = &model.0;
    let order = given.iter().rposition(|c| *c != 0.0).map_or(0, |last| last + 1);
    if !(variance.is_finite() && *variance >= 0.0 && given.iter().all(|c| c.is_finite())) {
        return None;
    }
    let mut point = Point { deviation: variance.sqrt(), ..Point::default() };
    let mut coefficients = *given;
    let corrected = match form {
        ModelForm::Ar => false,
        ModelForm::Lsf => {
            let mut lsf = *given;
            let moved = ascend(&mut lsf[..order]);
            lsf_to_ar(&lsf[..order], &mut coefficients[..order]).ok()?;
            moved
        }
    };
    let factor = stable_factor(&coefficients[..order], MOST);
    point.reflection = expanded(&coefficients[..order], factor);
    step_down(&mut point.reflection[..order]).ok()?;
    Some((point, corrected || factor < 1.0))
}

/// The largest factor of a polynomial's roots, up to 1, with which no reflection coefficient is larger than `most`.
fn stable_factor(ar: &[f64], most: f64) -> f64 {
    let is_stable = |factor| {
        let mut reflection = expanded(ar, factor);
        step_down(&mut reflection[..ar.len()]).is_ok() && reflection.iter().all(|k| k.abs() <= most)
    };
    if is_stable(1.0) {
        return 1.0;
    }
    (1..=HALVINGS)
        .map(|halving| 0.5_f64.powi(halving))
        .fold(0.0, |stable, step| if is_stable(stable + step) { stable + step } else { stable })
}

/// A polynomial with its roots multiplied by `factor`.
fn expanded(ar: &[f64], factor: f64) -> [f64; MAX_ORDER] {
    let (mut moved, mut power) = ([0.0; MAX_ORDER], factor);
    for (to, a) in moved.iter_mut().zip(ar) {
        *to = a * power;
        power *= factor;
    }
    moved
}

/// Sorts LSFs and moves them apart, if they do not ascend; returns whether they were changed.
fn ascend(lsf: &mut [f64]) -> bool {
    let ascends = lsf.windows(2).all(|pair| pair[0] < pair[1]);
    if ascends && lsf.first().is_none_or(|w| *w > 0.0) && lsf.last().is_none_or(|w| *w < PI) {
        return false;
    }
    lsf.sort_unstable_by(f64::total_cmp);
    let mut least = 0.0;
    for w in &mut *lsf {
        *w = w.max(least + LEAST_GAP);
        least = *w;
    }
    let mut most = PI;
    for w in lsf.iter_mut().rev() {
        *w = w.min(most - LEAST_GAP);
        most = *w;
    }
    true
}

#[derive(Debug, Clone)]
struct Steering {
    form: ModelForm,
    warping: f64,
    fade_ticks: f64,
    /// Ticks since the fade began, up to `fade_ticks`.
    ticks: f64,
    given: Model,
    /// Where the fade begins and ends.
    ends: [Point; 2],
    refused: f64,
    corrected: f64,
}

impl Steering {
    fn now(&self) -> Point {
        let [from, to] = &self.ends;
        if self.ticks < self.fade_ticks { from.towards(to, self.ticks / self.fade_ticks) } else { *to }
    }

    fn take(&mut self, model: &[f64; Model::WIDTH]) {
        if model.iter().zip(&self.given.0).all(|(x, given)| x.to_bits() == given.to_bits()) {
            return;
        }
        self.given = Model(*model);
        match point_of(&self.form, &self.given) {
            Some((to, corrected)) => {
                self.ends = [self.now(), to];
                self.ticks = 0.0;
                self.corrected += f64::from(u8::from(corrected));
            }
            None => self.refused += 1.0,
        }
    }

    fn write(&self, components: &mut [f64; Coefficients::WIDTH]) {
        let Point { deviation, reflection: mut ar } = self.now();
        let order = ar.iter().rposition(|k| *k != 0.0).map_or(0, |last| last + 1);
        step_up(&mut ar[..order]);
        ar = expanded(&ar[..order], stable_factor(&ar[..order], MOST_ROUNDED));
        let (variance, warping) = (deviation * deviation, self.warping);
        Coefficients { ar: &ar[..order], ma: &[], gain: 1.0, variance, warping }.write(components);
    }
}

impl Processor<SteeredModel> for Steering {
    fn process(&mut self, _: &Tick, io: &mut Io<'_, SteeredModel>) {
        let models = io.read(SteeredModel::MODEL);
        for (frame, model) in models.iter().enumerate() {
            self.take(model);
            self.ticks = (self.ticks + 1.0).min(self.fade_ticks);
            self.write(&mut io.write(SteeredModel::COEFFICIENTS)[frame]);
            io.write(SteeredModel::REFUSED)[frame] = self.refused;
            io.write(SteeredModel::CORRECTED)[frame] = self.corrected;
        }
    }

    fn copy_state_into(&self, new: &mut Self) {
        if (&self.form, self.warping) == (&new.form, new.warping) {
            (new.ends, new.given) = (self.ends, self.given);
            // As far in its fade as the old one.
            new.ticks = self.ticks * (new.fade_ticks / self.fade_ticks);
            (new.refused, new.corrected) = (self.refused, self.corrected);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_engine::frame::OneKind;
    use haptograph_engine::testing::Bench;
    use proptest::prelude::*;

    const RATE_HZ: f64 = 1000.0;

    fn bench(form: ModelForm) -> Bench {
        let settings = SteeredModelSettings { form, warping: 0.0, fade_ms: Milliseconds(10.0) };
        Bench::new::<SteeredModel>(settings, RATE_HZ, &[Model::KIND]).unwrap()
    }

    fn given(variance: f64, coefficients: &[f64]) -> Vec<f64> {
        Model::new(variance, coefficients).unwrap().0.to_vec()
    }

    /// What each tick gives: order, variance and AR coefficients; refused; corrected.
    fn run(form: ModelForm, models: &[Vec<f64>]) -> (Vec<(Vec<f64>, f64)>, [f64; 2]) {
        let out = bench(form).run_in_blocks(&[&models.concat()], &[1, 5, 64]);
        let filters = out[0].as_chunks().0.iter().map(|frame| {
            let filter = Coefficients::from_components(frame);
            (filter.ar.to_vec(), filter.variance)
        });
        (filters.collect(), [out[1].last().copied().unwrap(), out[2].last().copied().unwrap()])
    }

    #[test]
    fn a_model_is_reached_in_the_duration_of_the_fade_and_held() {
        let model = given(4.0, &[-1.2, 0.7]);
        let (filters, counts) = run(ModelForm::Ar, &vec![model; 30]);
        assert!(filters[4].1 > 0.0 && filters[4].1 < 2.0);
        for (ar, variance) in &filters[9..] {
            assert!((variance - 4.0).abs() < 1e-12);
            assert!(ar.iter().zip([-1.2, 0.7]).all(|(a, b)| (a - b).abs() < 1e-12));
        }
        assert_eq!(counts, [0.0, 0.0]);
    }

    #[test]
    fn frequencies_and_coefficients_of_one_filter_are_one_filter() {
        let ar = [-1.2, 0.9, -0.3, 0.2];
        let mut lsf = [0.0; 4];
        haptograph_surfaces::lsf::ar_to_lsf(&ar, &mut lsf).unwrap();
        let (by_ar, _) = run(ModelForm::Ar, &vec![given(1.0, &ar); 12]);
        let (by_lsf, counts) = run(ModelForm::Lsf, &vec![given(1.0, &lsf); 12]);
        assert!(by_ar[11].0.iter().zip(&by_lsf[11].0).all(|(a, b)| (a - b).abs() < 1e-9));
        assert_eq!(counts, [0.0, 0.0]);
    }

    #[test]
    fn an_unstable_model_keeps_the_angles_of_its_poles() {
        let (radius, angle) = (1.05_f64, 0.6_f64);
        let unstable = given(1.0, &[-2.0 * radius * angle.cos(), radius * radius]);
        let (filters, counts) = run(ModelForm::Ar, &vec![unstable; 12]);
        let [a1, a2] = filters[11].0[..] else { panic!("two coefficients") };
        assert!(a2 < 1.0 && a2 > 0.99 && (a1 / (-2.0 * a2.sqrt()) - angle.cos()).abs() < 1e-9);
        assert_eq!(counts, [0.0, 1.0]);
    }

    #[test]
    fn what_is_no_model_is_refused_and_the_one_before_stays() {
        let good = given(1.0, &[-0.5]);
        let mut models = vec![good.clone(); 20];
        models.push(given(-1.0, &[-0.9]));
        models.extend(vec![given(1.0, &[f64::NAN]); 5]);
        models.extend(vec![given(1.0, &[f64::INFINITY]); 20]);
        let (filters, counts) = run(ModelForm::Ar, &models);
        assert_eq!(filters.last(), filters.get(15));
        assert_eq!(counts[1], 0.0);
        assert_eq!(counts[0], 3.0);
    }

    proptest! {
        // One in some thousands is stable, but not with its coefficients rounded.
        #![proptest_config(ProptestConfig::with_cases(5000))]
        #[test]
        fn every_filter_is_stable_whatever_comes(
            lsf in any::<bool>(),
            models in proptest::collection::vec((0.0..1e3, proptest::collection::vec(-4.0..4.0_f64, 0..=MAX_ORDER), -3..12_i32), 1..6),
        ) {
            let scaled = |scale: i32, c: &f64| c * 10_f64.powi(scale);
            let models: Vec<Vec<f64>> = models
                .iter()
                .flat_map(|(variance, c, scale)| {
                    let c: Vec<f64> = c.iter().map(|c| scaled(*scale, c)).collect();
                    vec![given(*variance, &c); 7]
                })
                .collect();
            let (filters, counts) = run(if lsf { ModelForm::Lsf } else { ModelForm::Ar }, &models);
            for (mut ar, variance) in filters {
                prop_assert!(variance.is_finite() && variance >= 0.0);
                prop_assert!(step_down(&mut ar).is_ok() && ar.iter().all(|k| k.abs() <= MOST_ROUNDED), "{ar:?}");
            }
            prop_assert_eq!(counts[0], 0.0);
        }
    }
}
