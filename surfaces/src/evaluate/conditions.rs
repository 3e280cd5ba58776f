//! The four rendering conditions of thesis section 4.5: vibrations that respond to force and speed, to one of
//! them, or to neither.

use super::synthesis::Trajectory;
use crate::TextureModel;

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
pub const CENTRE: (f64, f64) = (0.130, 1.2);
/// With a constant speed, a tool slower than this counts as at rest, m/s.
const REST_M_S: f64 = 0.001;

impl Condition {
    /// All conditions, the control first.
    pub const ALL: [Condition; 4] = [Self::ForceAndSpeed, Self::Force, Self::Speed, Self::Neither];

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
pub fn centre_for(texture: &TextureModel) -> (f64, f64) {
    let (speed, force) = (texture.max_speed_m_s(), texture.max_force_n());
    if CENTRE.0 < speed && CENTRE.1 < force {
        CENTRE
    } else {
        (0.5 * speed, 0.5 * force)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_condition_does_not_respond_to_is_constant() {
        let hand = Trajectory {
            rate_hz: 1000.0,
            speed_m_s: vec![0.0, 0.05, 0.2],
            force_n: vec![0.5, 0.0, 2.0],
        };
        let played = |condition: Condition| {
            let played = condition.trajectory(&hand, (0.1, 1.0));
            (played.speed_m_s, played.force_n)
        };
        assert_eq!(
            played(Condition::ForceAndSpeed),
            (hand.speed_m_s.clone(), hand.force_n.clone())
        );
        assert_eq!(
            played(Condition::Force),
            (vec![0.0, 0.1, 0.1], hand.force_n.clone())
        );
        assert_eq!(
            played(Condition::Speed),
            (hand.speed_m_s.clone(), vec![1.0, 0.0, 1.0])
        );
        assert_eq!(
            played(Condition::Neither),
            (vec![0.0, 0.1, 0.1], vec![1.0, 0.0, 1.0])
        );
    }
}
