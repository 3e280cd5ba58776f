//! Kinds of frames and how each lies in memory: every frame is a fixed number of f64 components, so that one arena of
//! aligned numbers holds every signal, and copying a frame copies its components.

use std::fmt;

/// The shape of one frame of a signal.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Kind {
    /// One number.
    Scalar,
    /// Three numbers, x y z.
    Vector,
    /// Force x y z (N), then torque x y z (N m).
    Wrench,
    /// A contact of a tool with an object: see [`Contact`].
    Contact,
    /// Where a (speed, force) point lies in a triangulation: see [`Weights`].
    Weights,
    /// A synthesis filter: see [`Coefficients`].
    Coefficients,
    /// Something that happens at a tick: see [`Event`].
    Event,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 7] = [
        Self::Scalar,
        Self::Vector,
        Self::Wrench,
        Self::Contact,
        Self::Weights,
        Self::Coefficients,
        Self::Event,
    ];

    /// Components of one frame.
    pub const fn width(self) -> usize {
        match self {
            Self::Scalar => 1,
            Self::Vector => 3,
            Self::Wrench => 6,
            Self::Contact => Contact::WIDTH,
            Self::Weights => Weights::WIDTH,
            Self::Coefficients => Coefficients::WIDTH,
            Self::Event => Event::WIDTH,
        }
    }

    /// May frames of this kind be scaled, summed and filtered component by component?
    pub const fn is_linear(self) -> bool {
        matches!(self, Self::Scalar | Self::Vector | Self::Wrench)
    }

    /// The name used in messages and tables, and a name for each component in CSV headers.
    pub fn component_names(self) -> Vec<String> {
        let fixed: &[&str] = match self {
            Self::Scalar => &[""],
            Self::Vector => &["x", "y", "z"],
            Self::Wrench => &[
                "force_x", "force_y", "force_z", "torque_x", "torque_y", "torque_z",
            ],
            Self::Contact => &Contact::COMPONENTS,
            Self::Weights => &Weights::COMPONENTS,
            Self::Event => &["fired", "value"],
            Self::Coefficients => {
                let head = ["ar_order", "ma_order", "gain", "variance", "warping"].map(str::to_owned);
                let ar = (1..=Coefficients::MAX_ORDER).map(|k| format!("a{k}"));
                let ma = (1..=Coefficients::MAX_ORDER).map(|k| format!("b{k}"));
                let lines = LinesAt::COMPONENTS.map(str::to_owned);
                return head.into_iter().chain(ar).chain(ma).chain(lines).collect();
            }
        };
        fixed.iter().map(|name| (*name).to_owned()).collect()
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Scalar => "scalar",
            Self::Vector => "3-vector",
            Self::Wrench => "wrench",
            Self::Contact => "contact",
            Self::Weights => "weights",
            Self::Coefficients => "coefficients",
            Self::Event => "event",
        })
    }
}

/// A frame of one number.
pub type Scalar = f64;
/// A frame of three numbers, x y z.
pub type Vector = [f64; 3];
/// A frame of force x y z (N), then torque x y z (N m).
pub type Wrench = [f64; 6];

/// Stands for scalars, 3-vectors and wrenches in the handle of a port that takes all of them, component by component.
#[derive(Clone, Copy, Debug)]
pub enum Linear {}

/// Stands for frames of every kind in the handle of a port, read and written as components.
#[derive(Clone, Copy, Debug)]
pub enum AnyKind {}

/// A type that stands for the kind of frames of a port in its handle: [`Scalar`], [`Vector`], [`Wrench`], [`Contact`],
/// [`Weights`], [`Coefficients`], [`Event`], [`Linear`] or [`AnyKind`].
pub trait FrameKind: sealed::Sealed + 'static {
    /// One frame: a number, an array of components, or a slice of them where the width is not fixed.
    type Frame<'a>;
    /// Successive frames: a slice of numbers or arrays, or of all components where the width is not fixed.
    type Frames<'a>;
    /// Successive frames to be filled.
    type FramesMut<'a>;
    #[doc(hidden)]
    const KINDS: Kinds;
    #[doc(hidden)]
    fn frame(components: &[f64]) -> Option<Self::Frame<'_>>;
    #[doc(hidden)]
    fn frames(components: &[f64]) -> Self::Frames<'_>;
    #[doc(hidden)]
    fn frames_mut(components: &mut [f64]) -> Self::FramesMut<'_>;
}

/// The kinds that a [`FrameKind`] stands for.
#[doc(hidden)]
#[derive(Clone, Copy, Debug)]
pub enum Kinds {
    One(Kind),
    Linear,
    Any,
}

impl Kinds {
    /// Whether one of these has frames of this width.
    pub(crate) fn have_width(self, width: usize) -> bool {
        match self {
            Self::One(kind) => kind.width() == width,
            Self::Linear => Kind::ALL
                .iter()
                .any(|kind| kind.is_linear() && kind.width() == width),
            Self::Any => true,
        }
    }
}

mod sealed {
    pub trait Sealed {}
}

/// Kinds whose frames are arrays of a fixed number of components.
macro_rules! arrays {
    ($($type:ty, $kind:ident;)+) => { $(
        impl sealed::Sealed for $type {}

        impl FrameKind for $type {
            type Frame<'a> = &'a [f64; Kind::$kind.width()];
            type Frames<'a> = &'a [[f64; Kind::$kind.width()]];
            type FramesMut<'a> = &'a mut [[f64; Kind::$kind.width()]];
            const KINDS: Kinds = Kinds::One(Kind::$kind);

            #[inline]
            fn frame(components: &[f64]) -> Option<Self::Frame<'_>> {
                components.first_chunk()
            }
            #[inline]
            fn frames(components: &[f64]) -> Self::Frames<'_> {
                components.as_chunks().0
            }
            #[inline]
            fn frames_mut(components: &mut [f64]) -> Self::FramesMut<'_> {
                components.as_chunks_mut().0
            }
        }
    )+ };
}

arrays! {
    Vector, Vector;
    Wrench, Wrench;
    Contact, Contact;
    Weights, Weights;
    Coefficients<'static>, Coefficients;
    Event, Event;
}

impl sealed::Sealed for Scalar {}

impl FrameKind for Scalar {
    type Frame<'a> = f64;
    type Frames<'a> = &'a [f64];
    type FramesMut<'a> = &'a mut [f64];
    const KINDS: Kinds = Kinds::One(Kind::Scalar);

    #[inline]
    fn frame(components: &[f64]) -> Option<f64> {
        components.first().copied()
    }
    #[inline]
    fn frames(components: &[f64]) -> &[f64] {
        components
    }
    #[inline]
    fn frames_mut(components: &mut [f64]) -> &mut [f64] {
        components
    }
}

/// Kinds whose frames are components of a width that is known only when the graph runs.
macro_rules! components {
    ($($type:ty, $kinds:expr;)+) => { $(
        impl sealed::Sealed for $type {}

        impl FrameKind for $type {
            type Frame<'a> = &'a [f64];
            type Frames<'a> = &'a [f64];
            type FramesMut<'a> = &'a mut [f64];
            const KINDS: Kinds = $kinds;

            #[inline]
            fn frame(components: &[f64]) -> Option<&[f64]> {
                Some(components)
            }
            #[inline]
            fn frames(components: &[f64]) -> &[f64] {
                components
            }
            #[inline]
            fn frames_mut(components: &mut [f64]) -> &mut [f64] {
                components
            }
        }

        impl AnyWidth for $type {}
    )+ };
}

components! {
    Linear, Kinds::Linear;
    AnyKind, Kinds::Any;
}

/// A [`FrameKind`] of no fixed width: [`Linear`] or [`AnyKind`].
pub trait AnyWidth: FrameKind {}

/// A [`FrameKind`] whose frames are values of its own type: [`Contact`], [`Weights`] or [`Event`].
pub trait Record: FrameKind + Sized {
    /// The values of successive frames.
    fn decode(frames: Self::Frames<'_>) -> impl Iterator<Item = Self>;
}

impl Record for Contact {
    #[inline]
    fn decode(frames: Self::Frames<'_>) -> impl Iterator<Item = Self> {
        frames.iter().map(Self::from_components)
    }
}

impl Record for Weights {
    #[inline]
    fn decode(frames: Self::Frames<'_>) -> impl Iterator<Item = Self> {
        frames.iter().map(Self::from_components)
    }
}

impl Record for Event {
    #[inline]
    fn decode(frames: Self::Frames<'_>) -> impl Iterator<Item = Self> {
        frames.iter().map(Self::from_components)
    }
}

/// A contact between tool and object. Positions in m, in the object's frame; the normal points out of the object.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Contact {
    /// Does the tool touch the object?
    pub touching: bool,
    /// Haptic interface point: where the device is.
    pub hip_m: [f64; 3],
    /// Ideal haptic interface point: the proxy on the surface. Equals the HIP while free.
    pub ihip_m: [f64; 3],
    /// Outward unit normal at the IHIP; zero while free.
    pub normal: [f64; 3],
    /// Distance from IHIP to HIP into the object.
    pub penetration_m: f64,
    /// Which face of the object; 0 for shapes without faces.
    pub face: u32,
}

impl Contact {
    /// Components of one contact frame.
    pub const WIDTH: usize = 12;
    const COMPONENTS: [&str; 12] = [
        "touching",
        "hip_x",
        "hip_y",
        "hip_z",
        "ihip_x",
        "ihip_y",
        "ihip_z",
        "normal_x",
        "normal_y",
        "normal_z",
        "penetration_m",
        "face",
    ];

    /// Reads a frame.
    pub fn from_components(components: &[f64; Self::WIDTH]) -> Self {
        let [touching, hx, hy, hz, px, py, pz, nx, ny, nz, penetration_m, face] = *components;
        Self {
            touching: touching != 0.0,
            hip_m: [hx, hy, hz],
            ihip_m: [px, py, pz],
            normal: [nx, ny, nz],
            penetration_m,
            face: face as u32,
        }
    }

    /// Writes a frame.
    pub fn to_components(&self) -> [f64; Self::WIDTH] {
        let ([hx, hy, hz], [px, py, pz], [nx, ny, nz]) = (self.hip_m, self.ihip_m, self.normal);
        let touching = f64::from(u8::from(self.touching));
        [
            touching,
            hx,
            hy,
            hz,
            px,
            py,
            pz,
            nx,
            ny,
            nz,
            self.penetration_m,
            f64::from(self.face),
        ]
    }
}

/// A point of the speed-force plane as a triangle of models and its barycentric weights (Eq. 2.4.1).
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Weights {
    /// 0-based numbers of the three models.
    pub models: [u32; 3],
    /// Their weights; they sum to 1.
    pub weights: [f64; 3],
    /// The speed after saturation at the modelled maximum.
    pub speed_m_s: f64,
    /// The force after saturation at the modelled maximum.
    pub force_n: f64,
}

impl Weights {
    /// Components of one weights frame.
    pub const WIDTH: usize = 8;
    const COMPONENTS: [&str; 8] = [
        "model_1",
        "model_2",
        "model_3",
        "weight_1",
        "weight_2",
        "weight_3",
        "speed_m_s",
        "force_n",
    ];

    /// Reads a frame.
    pub fn from_components(components: &[f64; Self::WIDTH]) -> Self {
        let [i, j, k, u, v, w, speed_m_s, force_n] = *components;
        Self {
            models: [i as u32, j as u32, k as u32],
            weights: [u, v, w],
            speed_m_s,
            force_n,
        }
    }

    /// Writes a frame.
    pub fn to_components(&self) -> [f64; Self::WIDTH] {
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
    /// Warping factor of the frequency axis of `ar`; 0 where it is plain.
    pub warping: f64,
}

impl<'a> Coefficients<'a> {
    /// The highest AR and MA order a frame can hold.
    pub const MAX_ORDER: usize = 32;
    /// Components of one coefficients frame.
    pub const WIDTH: usize = Self::HEAD + 2 * Self::MAX_ORDER + LinesAt::COMPONENTS.len();
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

    /// Writes a frame without lines. Orders beyond [`Self::MAX_ORDER`] are cut to it.
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

/// Lines fixed in space, at the place that a frame of [`Coefficients`] is for and in the same frame.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct LinesAt {
    /// The speed for which the coefficients are.
    pub speed_m_s: f64,
    /// Power of each line of the surface, (m/s2)^2; 0 from their number on.
    pub powers_m2_s4: [f64; 3],
}

impl LinesAt {
    const COMPONENTS: [&str; 4] = ["speed_m_s", "line_1", "line_2", "line_3"];

    /// Reads them from a frame of coefficients.
    pub fn from_components(components: &[f64; Coefficients::WIDTH]) -> Self {
        let [.., speed_m_s, a, b, c] = *components;
        Self {
            speed_m_s,
            powers_m2_s4: [a, b, c],
        }
    }

    /// Adds them to a frame of coefficients that is written.
    pub fn write(&self, components: &mut [f64; Coefficients::WIDTH]) {
        let [.., speed_m_s, a, b, c] = components;
        *speed_m_s = self.speed_m_s;
        [*a, *b, *c] = self.powers_m2_s4;
    }
}

/// Something that may happen at a tick.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Event {
    /// Did it happen at this tick?
    pub fired: bool,
    /// Its value, in the port's quantity; 0 when it did not fire.
    pub value: f64,
}

impl Event {
    /// Components of one event frame.
    pub const WIDTH: usize = 2;

    /// Reads a frame.
    pub fn from_components(components: &[f64; Self::WIDTH]) -> Self {
        Self {
            fired: components[0] != 0.0,
            value: components[1],
        }
    }

    /// Writes a frame.
    pub fn to_components(&self) -> [f64; Self::WIDTH] {
        [f64::from(u8::from(self.fired)), self.value]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_survive_their_components() {
        let contact = Contact {
            touching: true,
            hip_m: [1.0, 2.0, 3.0],
            ihip_m: [4.0, 5.0, 6.0],
            normal: [0.0, 0.0, 1.0],
            penetration_m: 0.25,
            face: 99_999,
        };
        assert_eq!(Contact::from_components(&contact.to_components()), contact);
        let weights = Weights {
            models: [7, 8, 9],
            weights: [0.5, 0.25, 0.25],
            speed_m_s: 0.1,
            force_n: 1.5,
        };
        assert_eq!(Weights::from_components(&weights.to_components()), weights);
        let mut components = [1.0; Coefficients::WIDTH];
        Coefficients {
            ar: &[-0.5, 0.25],
            ma: &[0.1],
            gain: 2.0,
            variance: 0.5,
            warping: 0.8,
        }
        .write(&mut components);
        let read = Coefficients::from_components(&components);
        assert_eq!(
            (read.ar, read.ma, read.gain, read.variance, read.warping),
            (&[-0.5, 0.25][..], &[0.1][..], 2.0, 0.5, 0.8)
        );
        assert_eq!(LinesAt::from_components(&components), LinesAt::default());
        let lines = LinesAt {
            speed_m_s: 0.1,
            powers_m2_s4: [0.5, 0.25, 0.0],
        };
        lines.write(&mut components);
        assert_eq!(LinesAt::from_components(&components), lines);
        assert_eq!(Coefficients::from_components(&components).ma, &[0.1]);
    }

    #[test]
    fn every_component_of_every_kind_has_a_name() {
        for kind in Kind::ALL {
            assert_eq!(kind.component_names().len(), kind.width(), "{kind}");
        }
    }
}
