//! Frames between the nodes of a texture: places among the models of a surface, and synthesis filters.

use haptograph_engine::frame::{Kind, KindSpec, Level, OneKind, Record};
use haptograph_engine::host::HostFrame;
use haptograph_surfaces::layers;

/// The head, and the AR and the MA coefficients up to [`Coefficients::MAX_ORDER`].
#[rustfmt::skip]
const FILTER: [&str; 69] = [
    "ar_order", "ma_order", "gain", "variance", "warping",
    "a1", "a2", "a3", "a4", "a5", "a6", "a7", "a8", "a9", "a10", "a11", "a12", "a13", "a14", "a15", "a16",
    "a17", "a18", "a19", "a20", "a21", "a22", "a23", "a24", "a25", "a26", "a27", "a28", "a29", "a30", "a31", "a32",
    "b1", "b2", "b3", "b4", "b5", "b6", "b7", "b8", "b9", "b10", "b11", "b12", "b13", "b14", "b15", "b16",
    "b17", "b18", "b19", "b20", "b21", "b22", "b23", "b24", "b25", "b26", "b27", "b28", "b29", "b30", "b31", "b32",
];

/// The filter, the speed, and what the layers of a texture interpolate.
const NAMES: [&str; FILTER.len() + 1 + layers::COMPONENTS] = {
    let mut names = ["speed_m_s"; FILTER.len() + 1 + layers::COMPONENTS];
    let mut at = 0;
    while at < FILTER.len() {
        names[at] = FILTER[at];
        at += 1;
    }
    while at < FILTER.len() + layers::COMPONENTS {
        names[at + 1] = layers::COMPONENT_NAMES[at - FILTER.len()];
        at += 1;
    }
    names
};

/// A point of the speed-force plane as a triangle of models and its barycentric weights (Eq. 2.4.1).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Weights {
    /// 0-based numbers of the three models.
    pub models: [u32; 3],
    /// The weights; they sum to 1.
    pub weights: [f64; 3],
    /// The speed after saturation at the modelled maximum.
    pub speed_m_s: f64,
    /// The force after saturation at the modelled maximum.
    pub force_n: f64,
}

impl OneKind for Weights {
    const KIND: Kind = Kind::new(&KindSpec {
        name: "weights",
        one: "weights",
        components: &[
            "model_1",
            "model_2",
            "model_3",
            "weight_1",
            "weight_2",
            "weight_3",
            "speed_m_s",
            "force_n",
        ],
        neutral: &[],
        is_linear: false,
        bridges: &[],
        level: Level {
            name: "largest weight",
            unit: Some("1"),
            square: |frame| {
                let weights = frame.get(3..6).unwrap_or_default();
                weights.iter().fold(0.0, |most, x| f64::max(most, x * x))
            },
        },
    });
    type Array = [f64; Self::KIND.width()];
}

impl Record for Weights {
    fn from_components(components: &Self::Array) -> Self {
        let [i, j, k, u, v, w, speed_m_s, force_n] = *components;
        Self { models: [i as u32, j as u32, k as u32], weights: [u, v, w], speed_m_s, force_n }
    }

    fn to_components(&self) -> Self::Array {
        let ([i, j, k], [u, v, w]) = (self.models.map(f64::from), self.weights);
        [i, j, k, u, v, w, self.speed_m_s, self.force_n]
    }
}

/// A synthesis filter, a view of its components: `gain (e + sum b_k e[-k]) - sum a_k y[-k]`, e of the given variance.
#[derive(Clone, Copy, Debug)]
pub struct Coefficients<'a> {
    /// a_1 .. a_p of A(z) = 1 + sum a_k z^-k.
    pub ar: &'a [f64],
    /// b_1 .. b_q of the monic B(z); empty for an AR model.
    pub ma: &'a [f64],
    /// Multiplies the whole B(z); 1 for an AR model.
    pub gain: f64,
    /// Innovation variance, (m/s2)^2.
    pub variance: f64,
    /// Warping factor of the frequency axis of `ar`; 0 for an unwarped axis.
    pub warping: f64,
}

impl OneKind for Coefficients<'static> {
    const KIND: Kind = Kind::new(&KindSpec {
        name: "coefficients",
        one: "coefficients",
        components: &NAMES,
        neutral: &[],
        is_linear: false,
        bridges: &[],
        level: Level {
            name: "excitation",
            unit: Some("m/s2"),
            square: |frame| match frame {
                [_, _, gain, variance, ..] => gain * gain * variance,
                _ => 0.0,
            },
        },
    });
    type Array = [f64; NAMES.len()];
}

impl<'a> Coefficients<'a> {
    /// The highest AR and MA order a frame can hold.
    pub const MAX_ORDER: usize = haptograph_signal::arma::MAX_ORDER;
    /// Components of one coefficients frame.
    pub const WIDTH: usize = NAMES.len();
    const HEAD: usize = 5;

    /// Reads a frame. Orders beyond [`Self::MAX_ORDER`] are cut to it.
    pub fn from_components(components: &'a [f64; Coefficients::WIDTH]) -> Self {
        let order = |component: f64| (component as usize).min(Self::MAX_ORDER);
        let (ar, ma) = components[Self::HEAD..][..2 * Self::MAX_ORDER].split_at(Self::MAX_ORDER);
        Self {
            ar: &ar[..order(components[0])],
            ma: &ma[..order(components[1])],
            gain: components[2],
            variance: components[3],
            warping: components[4],
        }
    }

    /// Writes a frame without layers. Orders beyond [`Self::MAX_ORDER`] are cut to it.
    pub fn write(&self, components: &mut [f64; Coefficients::WIDTH]) {
        let p = self.ar.len().min(Self::MAX_ORDER);
        let q = self.ma.len().min(Self::MAX_ORDER);
        *components = [0.0; Self::WIDTH];
        (components[0], components[1], components[2], components[3]) =
            (p as f64, q as f64, self.gain, self.variance);
        components[4] = self.warping;
        components[Self::HEAD..][..p].copy_from_slice(&self.ar[..p]);
        components[Self::HEAD + Self::MAX_ORDER..][..q].copy_from_slice(&self.ma[..q]);
    }
}

/// A model that an embedding program gives while the graph runs: the innovation variance, then up to 32 coefficients, which
/// end with the last that is not 0. What they are is the setting of the `SteeredModel` that takes them.
///
/// ```
/// use haptograph_nodes::texture::Model;
/// assert_eq!(Model::new(0.5, &[-0.9, 0.2]).unwrap().0[..4], [0.5, -0.9, 0.2, 0.0]);
/// assert!(Model::new(0.5, &[0.0; 33]).is_none());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model(pub [f64; Model::WIDTH]);

impl Model {
    /// Numbers of a frame.
    pub const WIDTH: usize = 1 + Coefficients::MAX_ORDER;

    /// A frame of this variance, (m/s2)^2, and these coefficients; `None` for more than 32.
    pub fn new(variance: f64, coefficients: &[f64]) -> Option<Self> {
        let mut frame = [0.0; Self::WIDTH];
        frame[0] = variance;
        frame.get_mut(1..=coefficients.len())?.copy_from_slice(coefficients);
        Some(Self(frame))
    }
}

/// Silence.
impl Default for Model {
    fn default() -> Self {
        Self([0.0; Self::WIDTH])
    }
}

/// The variance, and the coefficients by the names that AR coefficients have.
const MODEL: [&str; Model::WIDTH] = {
    let mut names = ["variance"; Model::WIDTH];
    let mut at = 1;
    while at < Model::WIDTH {
        names[at] = FILTER[Coefficients::HEAD + at - 1];
        at += 1;
    }
    names
};

impl OneKind for Model {
    const KIND: Kind = Kind::new(&KindSpec {
        name: "model",
        one: "a model",
        components: &MODEL,
        neutral: &[],
        is_linear: false,
        bridges: &[],
        level: Level {
            name: "excitation",
            unit: Some("m/s2"),
            square: |frame| frame.first().copied().unwrap_or_default(),
        },
    });
    type Array = [f64; Self::WIDTH];
}

impl HostFrame for Model {
    const KIND: Kind = <Self as OneKind>::KIND;
    fn components(&self) -> &[f64] {
        &self.0
    }
    fn components_mut(&mut self) -> &mut [f64] {
        &mut self.0
    }
}

/// What the layers of a texture have at the place that a frame of [`Coefficients`] is for, in the same frame.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub(crate) struct LayersAt {
    /// The speed for which the coefficients are.
    pub speed_m_s: f64,
    /// The components of all [`layers::LAYERS`]; 0 for layers that the texture does not have.
    pub components: [f64; layers::COMPONENTS],
}

impl LayersAt {
    /// Reads them from a frame of coefficients.
    pub(crate) fn from_components(components: &[f64; Coefficients::WIDTH]) -> Self {
        let mut at = Self { speed_m_s: components[FILTER.len()], ..Self::default() };
        at.components.copy_from_slice(&components[FILTER.len() + 1..]);
        at
    }

    /// Adds them to a frame of coefficients that is written.
    pub(crate) fn write(&self, components: &mut [f64; Coefficients::WIDTH]) {
        components[FILTER.len()] = self.speed_m_s;
        components[FILTER.len() + 1..].copy_from_slice(&self.components);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_survive_their_components() {
        let weights = Weights { models: [7, 8, 9], weights: [0.5, 0.25, 0.25], speed_m_s: 0.1, force_n: 1.5 };
        assert_eq!(Weights::from_components(&weights.to_components()), weights);
        let mut components = [1.0; Coefficients::WIDTH];
        Coefficients { ar: &[-0.5, 0.25], ma: &[0.1], gain: 2.0, variance: 0.5, warping: 0.8 }
            .write(&mut components);
        let read = Coefficients::from_components(&components);
        assert_eq!(
            (read.ar, read.ma, read.gain, read.variance, read.warping),
            (&[-0.5, 0.25][..], &[0.1][..], 2.0, 0.5, 0.8)
        );
        assert_eq!(LayersAt::from_components(&components), LayersAt::default());
        let lines = LayersAt { speed_m_s: 0.1, components: [0.5, 0.25, 0.0, 1.0] };
        lines.write(&mut components);
        assert_eq!(LayersAt::from_components(&components), lines);
        assert_eq!(Coefficients::from_components(&components).ma, &[0.1]);
    }
}
