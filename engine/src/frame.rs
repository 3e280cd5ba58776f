//! Kinds of frames and how each lies in memory: every frame is a fixed number of f64 components, so that one arena of
//! aligned numbers holds every signal, and copying a frame copies its components.
//!
//! The engine has four kinds, of [`Kind::ENGINE`]; a [`Registry`](crate::registry::Registry) adds others.

use crate::settings::same;
use std::fmt;
use std::hash::{Hash, Hasher};

/// The shape of one frame of a signal. Kinds are equal if they have one name and one width; a registry has one kind of
/// each name.
///
/// ```
/// use haptograph_engine::frame::{Kind, KindSpec, Level};
/// use haptograph_engine::registry::Registry;
///
/// const ORIENTATION: Kind = Kind::new(&KindSpec {
///     name: "orientation",
///     one: "an orientation",
///     components: &["w", "x", "y", "z"],
///     neutral: &[1.0],
///     is_linear: false,
///     bridges: &["Slerp"],
///     level: Level::norm("norm"),
/// });
///
/// let mut registry = Registry::new();
/// registry.add_kind(ORIENTATION);
/// let kind = registry.kind("orientation").unwrap();
/// assert_eq!(kind.width(), 4);
/// assert!(kind.neutral().eq([1.0, 0.0, 0.0, 0.0]));
/// ```
///
/// A linear kind that is wider than a wrench does not compile:
/// ```compile_fail,E0080
/// # use haptograph_engine::frame::{Kind, KindSpec, Level};
/// const LOUDNESS: Kind = Kind::new(&KindSpec {
///     name: "loudness",
///     one: "a loudness",
///     components: &["a", "b", "c", "d", "e", "f", "g"],
///     neutral: &[],
///     is_linear: true,
///     bridges: &[],
///     level: Level::norm("loudness"),
/// });
/// # assert_eq!(LOUDNESS.width(), 7);
/// ```
#[derive(Clone, Copy)]
pub struct Kind(&'static KindSpec);

/// Specification of a kind of frames; the source of its messages, checks and tables.
#[derive(Debug, Clone, Copy)]
pub struct KindSpec {
    /// Name in messages, files and tables: `contact`.
    pub name: &'static str,
    /// A frame of the kind in a sentence: `a contact`, `an event`, `weights`.
    pub one: &'static str,
    /// Name of each component, in the headers of CSV files; their number is the width of a frame.
    pub components: &'static [&'static str],
    /// The neutral frame, used before a frame has arrived; components beyond its end are 0.
    pub neutral: &'static [f64],
    /// True if frames may be scaled, summed and filtered component by component.
    pub is_linear: bool,
    /// Bridges that are made for this kind. `Hold` and `Delay` carry every kind, and bridges that mix components
    /// every linear one.
    pub bridges: &'static [&'static str],
    /// The number that stands for a frame on a page.
    pub level: Level,
}

/// A number that stands for a whole frame where the level of a signal is shown.
#[derive(Debug, Clone, Copy)]
pub struct Level {
    /// The name: `penetration`.
    pub name: &'static str,
    /// The unit; `None` for that of the port's quantity.
    pub unit: Option<&'static str>,
    /// The square, of the components of a frame.
    pub square: fn(&[f64]) -> f64,
}

impl Level {
    /// The length of the frame as a vector, in the unit of the port.
    pub const fn norm(name: &'static str) -> Self {
        Self { name, unit: None, square: |frame| frame.iter().map(|x| x * x).sum() }
    }
}

impl Kind {
    /// One number.
    pub const SCALAR: Self = Self(&KindSpec {
        name: "scalar",
        one: "a scalar",
        components: &[""],
        neutral: &[],
        is_linear: true,
        bridges: &[],
        level: Level::norm("level"),
    });
    /// Three numbers, x y z.
    pub const VECTOR: Self = Self(&KindSpec {
        name: "3-vector",
        one: "a 3-vector",
        components: &["x", "y", "z"],
        neutral: &[],
        is_linear: true,
        bridges: &[],
        level: Level::norm("length"),
    });
    /// Force x y z (N), then torque x y z (N m).
    pub const WRENCH: Self = Self(&KindSpec {
        name: "wrench",
        one: "a wrench",
        components: &["force_x", "force_y", "force_z", "torque_x", "torque_y", "torque_z"],
        neutral: &[],
        is_linear: true,
        bridges: &[],
        level: Level {
            name: "force",
            unit: Some("N"),
            square: |frame| frame.iter().take(3).map(|x| x * x).sum(),
        },
    });
    /// Something that happens at a tick: see [`Event`].
    pub const EVENT: Self = Self(&KindSpec {
        name: "event",
        one: "an event",
        components: &["fired", "value"],
        neutral: &[],
        is_linear: false,
        bridges: &[],
        level: Level {
            name: "events in a tick",
            unit: Some("1"),
            square: |frame| frame.iter().take(1).map(|x| x * x).sum(),
        },
    });

    /// The kinds that every registry has.
    pub const ENGINE: [Self; 4] = [Self::SCALAR, Self::VECTOR, Self::WRENCH, Self::EVENT];

    /// Makes a kind, to be registered by [`Registry::add_kind`](crate::registry::Registry::add_kind). In a constant a
    /// wrong number of components is a compile error.
    ///
    /// # Panics
    /// If it has no components, or is linear and has more components than a wrench: nodes that take linear frames keep
    /// state for six.
    pub const fn new(spec: &'static KindSpec) -> Self {
        assert!(!spec.components.is_empty(), "a frame has at least one component");
        assert!(
            !spec.is_linear || spec.components.len() <= Self::WRENCH.width(),
            "a linear frame has at most six components"
        );
        Self(spec)
    }

    /// The specification.
    pub const fn spec(self) -> &'static KindSpec {
        self.0
    }

    /// Components of one frame, at least 1.
    pub const fn width(self) -> usize {
        self.0.components.len()
    }

    /// True if frames of this kind may be scaled, summed and filtered component by component.
    pub const fn is_linear(self) -> bool {
        self.0.is_linear
    }

    /// The components of its neutral frame.
    pub fn neutral(self) -> impl Iterator<Item = f64> {
        let rest = std::iter::repeat(0.0);
        self.0.neutral.iter().copied().chain(rest).take(self.width())
    }

    /// Fills frames with the neutral one.
    pub(crate) fn fill_neutral(self, frames: &mut [f64]) {
        for frame in frames.chunks_exact_mut(self.width()) {
            frame.iter_mut().zip(self.neutral()).for_each(|(x, neutral)| *x = neutral);
        }
    }

    /// True if both are equal, for constants.
    pub(crate) const fn is(self, other: Self) -> bool {
        same(self.0.name, other.0.name) && self.width() == other.width()
    }

    /// True if two definitions of one name agree in everything but their level and their words.
    pub(crate) fn agrees_with(self, other: Self) -> bool {
        let (a, b) = (self.0, other.0);
        (a.name, a.components, a.is_linear, a.bridges) == (b.name, b.components, b.is_linear, b.bridges)
            && self.neutral().eq(other.neutral())
    }
}

impl PartialEq for Kind {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self.0, other.0) || self.is(*other)
    }
}

impl Eq for Kind {}

impl Hash for Kind {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.0.name.hash(state);
    }
}

impl fmt::Debug for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Kind({})", self.0.name)
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0.name)
    }
}

/// A frame of one number.
pub type Scalar = f64;
/// A frame of three numbers, x y z.
pub type Vector = [f64; 3];
/// A frame of force x y z (N), then torque x y z (N m).
pub type Wrench = [f64; 6];

/// Stands for all linear kinds in the handle of a port that takes all of them, component by component.
#[derive(Clone, Copy, Debug)]
pub enum Linear {}

/// Stands for frames of every kind in the handle of a port, read and written as components.
#[derive(Clone, Copy, Debug)]
pub enum AnyKind {}

/// A type that stands for one kind of frames in the handles of ports: [`Vector`], [`Wrench`], [`Event`], and types of
/// other crates for the kinds that these register.
///
/// ```
/// use haptograph_engine::frame::{Kind, KindSpec, Level, OneKind};
/// use haptograph_engine::node::Port;
/// use haptograph_engine::settings::NoSettings;
/// use haptograph_signal::quantity::Quantity;
///
/// const COLOUR: Kind = Kind::new(&KindSpec {
///     name: "colour",
///     one: "a colour",
///     components: &["red", "green", "blue"],
///     neutral: &[],
///     is_linear: true,
///     bridges: &[],
///     level: Level::norm("brightness"),
/// });
///
/// struct Colour;
///
/// impl OneKind for Colour {
///     const KIND: Kind = COLOUR;
///     type Array = [f64; COLOUR.width()];
/// }
///
/// haptograph_engine::node! {
///     /// A light.
///     struct Lamp(NoSettings) in "mine";
///     example: "";
///     out LIGHT: Colour = Port::of(Quantity::NUMBER, "Its colour.");
/// }
/// ```
///
/// A frame with another number of components does not compile:
/// ```compile_fail,E0080
/// # use haptograph_engine::frame::{Kind, KindSpec, Level, OneKind};
/// # use haptograph_engine::node::Port;
/// # use haptograph_engine::settings::NoSettings;
/// # use haptograph_signal::quantity::Quantity;
/// # const COLOUR: Kind = Kind::new(&KindSpec {
/// #     name: "colour",
/// #     one: "a colour",
/// #     components: &["red", "green", "blue"],
/// #     neutral: &[],
/// #     is_linear: true,
/// #     bridges: &[],
/// #     level: Level::norm("brightness"),
/// # });
/// # struct Colour;
/// impl OneKind for Colour {
///     const KIND: Kind = COLOUR;
///     type Array = [f64; 4];
/// }
/// haptograph_engine::node! {
///     /// A light.
///     struct Lamp(NoSettings) in "mine";
///     example: "";
///     out LIGHT: Colour = Port::of(Quantity::NUMBER, "Its colour.");
/// }
/// ```
pub trait OneKind: 'static {
    /// The kind.
    const KIND: Kind;
    /// One frame: an array of as many components as frames of the kind have.
    type Array: FrameArray;
}

/// An array of components; implemented for arrays of every length.
pub trait FrameArray: sealed::Array + Sized + 'static {
    #[doc(hidden)]
    const WIDTH: usize;
    #[doc(hidden)]
    fn first(components: &[f64]) -> Option<&Self>;
    #[doc(hidden)]
    fn all(components: &[f64]) -> &[Self];
    #[doc(hidden)]
    fn all_mut(components: &mut [f64]) -> &mut [Self];
}

impl<const N: usize> FrameArray for [f64; N] {
    const WIDTH: usize = N;

    #[inline]
    fn first(components: &[f64]) -> Option<&Self> {
        components.first_chunk()
    }
    #[inline]
    fn all(components: &[f64]) -> &[Self] {
        components.as_chunks().0
    }
    #[inline]
    fn all_mut(components: &mut [f64]) -> &mut [Self] {
        components.as_chunks_mut().0
    }
}

impl OneKind for Vector {
    const KIND: Kind = Kind::VECTOR;
    type Array = Self;
}

impl OneKind for Wrench {
    const KIND: Kind = Kind::WRENCH;
    type Array = Self;
}

/// A type that stands for the kind of frames of a port in its handle: [`Scalar`], a type of one kind ([`OneKind`]),
/// [`Linear`] or [`AnyKind`].
pub trait FrameKind: sealed::Kinds + 'static {
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
    /// True if one of these has frames of this width.
    pub(crate) fn have_width(self, width: usize) -> bool {
        match self {
            Self::One(kind) => kind.width() == width,
            Self::Linear | Self::Any => width > 0,
        }
    }
}

mod sealed {
    pub trait Kinds {}
    impl Kinds for f64 {}
    impl Kinds for super::Linear {}
    impl Kinds for super::AnyKind {}
    impl<T: super::OneKind> Kinds for T {}

    pub trait Array {}
    impl<const N: usize> Array for [f64; N] {}
}

impl<T: OneKind> FrameKind for T {
    type Frame<'a> = &'a T::Array;
    type Frames<'a> = &'a [T::Array];
    type FramesMut<'a> = &'a mut [T::Array];
    const KINDS: Kinds = {
        assert!(
            T::Array::WIDTH == T::KIND.width(),
            "the array has another number of components than the kind"
        );
        Kinds::One(T::KIND)
    };

    #[inline]
    fn frame(components: &[f64]) -> Option<&T::Array> {
        T::Array::first(components)
    }
    #[inline]
    fn frames(components: &[f64]) -> &[T::Array] {
        T::Array::all(components)
    }
    #[inline]
    fn frames_mut(components: &mut [f64]) -> &mut [T::Array] {
        T::Array::all_mut(components)
    }
}

impl FrameKind for Scalar {
    type Frame<'a> = f64;
    type Frames<'a> = &'a [f64];
    type FramesMut<'a> = &'a mut [f64];
    const KINDS: Kinds = Kinds::One(Kind::SCALAR);

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

/// A kind whose frames are read and written as values of its own type: [`Event`].
pub trait Record: OneKind + Sized {
    /// Reads a frame.
    fn from_components(components: &Self::Array) -> Self;
    /// Writes a frame.
    fn to_components(&self) -> Self::Array;
}

/// Something that may happen at a tick.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Event {
    /// True if the event happened at this tick.
    pub fired: bool,
    /// The event's value, in the port's quantity; 0 if `fired` is false.
    pub value: f64,
}

impl OneKind for Event {
    const KIND: Kind = Kind::EVENT;
    type Array = [f64; 2];
}

impl Record for Event {
    fn from_components([fired, value]: &[f64; 2]) -> Self {
        Self { fired: *fired != 0.0, value: *value }
    }

    fn to_components(&self) -> [f64; 2] {
        [f64::from(u8::from(self.fired)), self.value]
    }
}
