//! The four rendering conditions of thesis section 4.5: vibrations that respond to force and speed, to one of
//! them, or to neither.

use crate::metrics::WindowSettings;
use crate::metrics::responsiveness::{VariationLoss, responsiveness_differences, variation_loss};
use haptograph_signal::resample::{Quality, resample_whole};
use haptograph_signal::statistics::mean;
use haptograph_signal::time::Rate;
use haptograph_surfaces::rendering::{RandomWalk, SynthesisError, Trajectory, synthesise};
use haptograph_surfaces::{TextureModel, VertexKind};

/// The inputs that a rendered texture responds to (Table 4.1); the others are constant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Condition {
    /// Force and speed: the control condition.
    ForceAndSpeed,
    /// Force, at a constant speed.
    Force,
    /// Speed, at a constant force.
    Speed,
    /// Neither: constant force and speed.
    Neither,
}

/// Constant speed, m/s, and force, N, of the thesis: the centre of the usual range.
pub(crate) const CENTRE: (f64, f64) = (0.130, 1.2);
/// Largest force that the thesis renders, N. Models beyond it do not count for the centre of a set.
const SATURATION_N: f64 = 2.75;
/// Rate of the vibrations whose variation is measured, Hz.
const LOSS_HZ: f64 = 1000.0;
/// Length of the rendered vibrations, s.
const SECONDS: f64 = 8.0;
/// With a constant speed, a tool slower than this counts as at rest, m/s.
const REST_M_S: f64 = 0.001;

impl Condition {
    /// All conditions, the control first.
    pub(crate) const ALL: [Condition; 4] = [Self::ForceAndSpeed, Self::Force, Self::Speed, Self::Neither];

    /// Symbol in the thesis.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::ForceAndSpeed => "FS",
            Self::Force => "F",
            Self::Speed => "S",
            Self::Neither => "ϕ",
        }
    }

    /// The trajectory that a texture is rendered along for the motion `hand`; `centre` holds the constant
    /// speed in m/s and force in N.
    pub fn trajectory(self, hand: &Trajectory, centre: (f64, f64)) -> Trajectory {
        let mut played = hand.clone();
        if matches!(self, Self::Force | Self::Neither) {
            let constant = |speed: &mut f64| *speed = if *speed < REST_M_S { 0.0 } else { centre.0 };
            played.speed_m_s.iter_mut().for_each(constant);
        }
        if matches!(self, Self::Speed | Self::Neither) {
            // A tool in the air stays silent.
            let constant = |force: &mut f64| *force = if *force > 0.0 { centre.1 } else { 0.0 };
            played.force_n.iter_mut().for_each(constant);
        }
        played
    }
}

/// The constant speed and force for a texture: [`CENTRE`], or the centre of its map if that lies outside.
fn centre_for(texture: &TextureModel) -> (f64, f64) {
    let (speed, force) = (texture.max_speed_m_s(), texture.max_force_n());
    if CENTRE.0 < speed && CENTRE.1 < force { CENTRE } else { (0.5 * speed, 0.5 * force) }
}

/// The centre of a set of textures (thesis 4.5.2): the mean speed, m/s, and force, N, of all their measured models up to
/// 2.75 N. `None` if there is none, as in textures that follow a law.
pub fn centre_of<'t>(textures: impl IntoIterator<Item = &'t TextureModel>) -> Option<(f64, f64)> {
    let models = textures.into_iter().flat_map(TextureModel::models);
    let counted = models.filter(|at| at.kind == VertexKind::Measured && at.force_n <= SATURATION_N);
    let (speeds, forces): (Vec<f64>, Vec<f64>) = counted.map(|at| (at.speed_m_s, at.force_n)).unzip();
    (!speeds.is_empty()).then(|| (mean(&speeds), mean(&forces)))
}

/// The vibrations of the four conditions along one trajectory (Fig. 4.9).
#[derive(Debug, Clone, PartialEq)]
pub struct Responses {
    /// The motion of the hand.
    pub hand: Trajectory,
    /// The constant speed, m/s, and force, N.
    pub centre: (f64, f64),
    /// The vibration of each condition, m/s², the control first.
    pub played: Vec<(Condition, Vec<f64>)>,
}

impl Responses {
    /// Renders the conditions along a random walk over nearly the whole map.
    pub fn of(texture: &TextureModel) -> Result<Self, SynthesisError> {
        let (speed, force) = (texture.max_speed_m_s(), texture.max_force_n());
        let walk = RandomWalk {
            seconds: SECONDS,
            speed_m_s: (0.03 * speed, 0.95 * speed),
            force_n: (0.05 * force, 0.95 * force),
            ..RandomWalk::default()
        }
        .at(texture.rate_hz());
        let (hand, centre) = (walk.trajectory(), centre_for(texture));
        let play = |condition: Condition| {
            let played = synthesise(texture, &condition.trajectory(&hand, centre), &Default::default());
            played.map(|played| (condition, played))
        };
        let played = Condition::ALL.into_iter().map(play).collect::<Result<_, _>>()?;
        Ok(Self { hand, centre, played })
    }

    /// Losses of the conditions other than the control (Eq. 4.5.1 and 4.5.3), at 1 kHz over windows of 32 samples. Empty if
    /// the vibration cannot be resampled to that rate.
    pub fn losses(&self) -> Vec<(Condition, VariationLoss)> {
        let resampled = |played: &[f64]| {
            let rate = |hz: f64| Rate::parse(&hz.to_string()).ok();
            let (from, to) = (rate(self.hand.rate_hz)?, rate(LOSS_HZ)?);
            resample_whole(played, from, to, Quality::FINE).ok()
        };
        let Some(control) = self.played.first().and_then(|(_, played)| resampled(played)) else {
            return vec![];
        };
        let loss = |(condition, played): &(Condition, Vec<f64>)| {
            let windows = WindowSettings::RESPONSIVENESS;
            let loss = variation_loss(&control, &resampled(played)?, LOSS_HZ, &windows).ok()?;
            Some((*condition, loss))
        };
        self.played.iter().skip(1).filter_map(loss).collect()
    }
}

/// What the vibration of a surface loses under one condition.
#[derive(Debug, Clone, PartialEq)]
pub struct ConditionLoss {
    /// Name of the surface.
    pub surface: String,
    /// The condition.
    pub condition: Condition,
    /// The losses of variation.
    pub loss: VariationLoss,
    /// SD_x of Eq. 4.5.4; `None` for a single surface, over which nothing deviates.
    pub difference: Option<f64>,
}

/// The losses of named textures under each condition, by condition and then in the order of the textures, without those that cannot be
/// rendered.
pub fn condition_losses(textures: &[(&str, &TextureModel)]) -> Vec<ConditionLoss> {
    let mut found = vec![];
    for (name, texture) in textures {
        let losses = Responses::of(texture).map_or_else(|_| vec![], |responses| responses.losses());
        found.extend(losses.into_iter().map(|(condition, loss)| (*name, condition, loss)));
    }
    let of_condition = |condition: Condition| {
        let of: Vec<_> = found.iter().filter(|(_, of, _)| *of == condition).collect();
        let losses: Vec<VariationLoss> = of.iter().map(|(.., loss)| *loss).collect();
        let differences = responsiveness_differences(&losses);
        let several = of.len() > 1;
        let one = move |(&(surface, condition, loss), difference): (&(&str, _, _), f64)| ConditionLoss {
            surface: surface.to_owned(),
            condition,
            loss,
            difference: several.then_some(difference),
        };
        of.into_iter().zip(differences).map(one).collect::<Vec<_>>()
    };
    Condition::ALL.into_iter().flat_map(of_condition).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use haptograph_surfaces::hull::Hull;
    use haptograph_surfaces::{ArmaModel, ModelAt};

    /// A texture whose power grows with speed and force.
    fn texture(loudness: f64, kind: VertexKind) -> TextureModel {
        let at = |(speed_m_s, force_n): (f64, f64)| ModelAt {
            speed_m_s,
            force_n,
            model: ArmaModel::from_ar(&[-0.9, 0.2], loudness * speed_m_s * force_n).unwrap(),
            kind,
        };
        let places = [(0.05, 0.5), (0.2, 0.5), (0.05, 2.5), (0.2, 2.5), (0.2, 4.0)];
        TextureModel::from_measured(10_000.0, places.map(at).to_vec(), &Hull::default()).unwrap()
    }

    #[test]
    fn the_centre_of_a_set_is_the_mean_of_its_measured_models_up_to_saturation() {
        let (measured, law) = (texture(1.0, VertexKind::Measured), texture(1.0, VertexKind::Fitted));
        let (speed_m_s, force_n) = centre_of([&measured, &measured]).unwrap();
        // Neither the edges of the map nor the model at 4 N count.
        assert!((speed_m_s - 0.125).abs() < 1e-12 && (force_n - 1.5).abs() < 1e-12);
        assert_eq!(centre_of([&law]), None);
    }

    #[test]
    fn a_vibration_that_responds_to_less_varies_less() {
        let (soft, loud) = (texture(1.0, VertexKind::Measured), texture(4.0, VertexKind::Measured));
        let found = condition_losses(&[("soft", &soft), ("loud", &loud)]);
        let named: Vec<_> = found.iter().map(|one| (one.condition, &*one.surface)).collect();
        let expected = [Condition::Force, Condition::Speed, Condition::Neither];
        assert_eq!(named, expected.map(|of| [(of, "soft"), (of, "loud")]).concat());
        assert!(found.iter().all(|one| one.loss.power > 0.0), "{found:?}");
        // Four times the power has four times the variation to lose, whose deviation is that of the two.
        let [soft, loud] = &found[4..] else { panic!() };
        assert!((loud.loss.power / soft.loss.power - 4.0).abs() < 1e-6, "{found:?}");
        assert!(loud.difference.unwrap() > soft.difference.unwrap());
        let alone = condition_losses(&[("soft", &texture(1.0, VertexKind::Measured))]);
        assert!(alone.iter().all(|one| one.difference.is_none()));
    }

    #[test]
    fn what_a_condition_does_not_respond_to_is_constant() {
        let hand =
            Trajectory { rate_hz: 1000.0, speed_m_s: vec![0.0, 0.05, 0.2], force_n: vec![0.5, 0.0, 2.0] };
        let played = |condition: Condition| {
            let played = condition.trajectory(&hand, (0.1, 1.0));
            (played.speed_m_s, played.force_n)
        };
        assert_eq!(played(Condition::ForceAndSpeed), (hand.speed_m_s.clone(), hand.force_n.clone()));
        assert_eq!(played(Condition::Force), (vec![0.0, 0.1, 0.1], hand.force_n.clone()));
        assert_eq!(played(Condition::Speed), (hand.speed_m_s.clone(), vec![1.0, 0.0, 1.0]));
        assert_eq!(played(Condition::Neither), (vec![0.0, 0.1, 0.1], vec![1.0, 0.0, 1.0]));
    }
}
