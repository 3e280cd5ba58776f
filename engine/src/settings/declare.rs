//! Macros that declare settings and choices.

/// Declares a struct of settings with its documentation, defaults and ranges in one place.
///
/// ```
/// haptograph_engine::settings! {
///     /// Settings of a low-pass.
///     pub struct LowPassSettings {
///         /// Where the response has fallen by 3 dB.
///         [live] cutoff_hz: f64 = 20.0, in 0.01..=20_000.0;
///         /// Poles.
///         order: u32 = 2, in 1..=10;
///     }
/// }
/// ```
/// A number whose unit is not SI is declared with the type of its unit, at the end of its name too; `si()` is its value
/// for the processor. Numbers in SI (`_hz`, `_s`, `_n`) are plain: there is nothing to convert, and so nothing to forget.
///
/// ```
/// use haptograph_signal::units::Millimetres;
///
/// haptograph_engine::settings! {
///     /// Settings of a grating.
///     pub struct GratingSettings {
///         /// From one ridge to the next.
///         pitch_mm: Millimetres = Millimetres(2.0), in 0.01..=1000.0;
///     }
/// }
/// let pitch_m = GratingSettings { pitch_mm: Millimetres(2.0) }.pitch_mm.si();
/// assert_eq!(pitch_m, 0.002);
/// ```
/// A plain number in another unit does not compile, nor does a name with another unit than that of its type:
///
/// ```compile_fail,E0080
/// haptograph_engine::settings! {
///     /// Settings of a grating.
///     pub struct GratingSettings {
///         /// From one ridge to the next.
///         pitch_mm: f64 = 2.0;
///     }
/// }
/// ```
/// ```compile_fail,E0080
/// haptograph_engine::settings! {
///     /// Settings of a grating.
///     pub struct GratingSettings {
///         /// From one ridge to the next.
///         pitch: haptograph_signal::units::Millimetres;
///     }
/// }
/// ```
/// A field without `= default` is required. `[live]` marks a setting that may change while the graph runs; its handle is a
/// constant of the struct with the name of the field, `LowPassSettings::cutoff_hz` (see
/// [`LiveId`](crate::settings::LiveId)). `[live, below_nyquist]` marks a frequency that has to stay below half of the node's
/// rate, `[limit]` the limit of an actuator sink, and `[output_file]` the file that a sink writes. There are no
/// other [flags](crate::settings::Flag), and a misspelt one does not compile:
///
/// ```compile_fail,E0599
/// haptograph_engine::settings! {
///     /// Settings of a low-pass.
///     pub struct LowPassSettings {
///         /// Where the response has fallen by 3 dB.
///         [liev] cutoff_hz: f64 = 20.0;
///     }
/// }
/// ```
#[macro_export]
macro_rules! settings {
    (@handle live $field:ident) => {
        /// Handle of the live setting.
        #[allow(dead_code, non_upper_case_globals)]
        pub(crate) const $field: $crate::settings::LiveId<Self> = $crate::settings::LiveId::named(stringify!($field));
    };
    (@handle $flag:ident $field:ident) => {};
    ($(#[doc = $summary:expr])* $vis:vis struct $name:ident {
        $($(#[doc = $doc:expr])* $([$($flag:ident),+])? $field:ident : $type:ty $(= $default:expr)? $(, in $range:expr)? ;)*
    }) => {
        $(#[doc = $summary])*
        #[derive(Debug, Clone, PartialEq)]
        $vis struct $name { $($(#[doc = $doc])* pub $field: $type,)* }

        impl $name { $($($($crate::settings!(@handle $flag $field);)+)?)* }
        #[allow(clippy::unnecessary_cast, unused_variables)]
        impl $crate::settings::Settings for $name {
            const NAME: &'static str = stringify!($name);
            const DOC: &'static str = concat!($($summary),*);
            const FIELDS: &'static [$crate::settings::DeclaredField] = &[$($crate::settings::DeclaredField {
                name: stringify!($field),
                doc: concat!($($doc),*).trim_ascii(),
                range: <[(f64, f64)]>::first(&[$((*$range.start() as f64, *$range.end() as f64))?]).copied(),
                flags: &[$($($crate::settings::Flag::$flag),+)?],
            }),*];
            fn each<V: $crate::settings::EachField>(visitor: &mut V) -> Option<Self> {
                $(let $field = visitor.field::<$type>(
                    const { $crate::settings::declared(Self::FIELDS, stringify!($field)) },
                    None$(.or(Some($default)))?);)*
                Some(Self { $($field: $field?,)* })
            }
            fn specs() -> &'static [$crate::settings::SettingSpec] {
                static SPECS: std::sync::LazyLock<Vec<$crate::settings::SettingSpec>> = std::sync::LazyLock::new(<$name as $crate::settings::Settings>::list);
                &SPECS
            }
            fn fields(&self) -> Vec<(&'static str, $crate::document::value::Value)> { vec![$((stringify!($field), $crate::settings::Setting::value(&self.$field))),*] }
        }
        $(const _: () = $crate::settings::check_unit::<$type>(stringify!($field));)*
    };
}

/// Declares an enum that a setting chooses from: bare names, or names with settings of their own.
///
/// ```
/// use haptograph_signal::units::Millimetres;
///
/// haptograph_engine::settings! {
///     /// A circle.
///     pub struct CircleSettings {
///         /// Its radius.
///         radius_mm: Millimetres = Millimetres(30.0);
///     }
/// }
/// haptograph_engine::choices! {
///     /// A path to follow.
///     pub enum Stroke {
///         /// Stay where you are.
///         Still,
///         /// Round and round.
///         Circles(CircleSettings),
///     }
/// }
/// ```
#[macro_export]
macro_rules! choices {
    ($(#[doc = $summary:expr])* $vis:vis enum $name:ident {
        $($(#[doc = $doc:expr])* $variant:ident $(($payload:ty))? ,)*
    }) => {
        $(#[doc = $summary])*
        #[derive(Debug, Clone, PartialEq)]
        $vis enum $name { $($(#[doc = $doc])* $variant $(($payload))?,)* }

        impl $crate::settings::Setting for $name {
            fn expected() -> $crate::settings::Expected {
                $crate::settings::Expected::Choice(vec![$(stringify!($variant)),*])
            }
            fn parts() -> Vec<$crate::settings::Part> {
                vec![$($crate::settings::Part::of_choice(stringify!($variant), concat!($($doc),*),
                    [<&[_]>::default() $(, <$payload as $crate::settings::Settings>::specs())?].concat())),*]
            }
            #[allow(unused_variables)]
            fn read(value: &$crate::document::value::Value, into: &mut $crate::settings::Reading<'_>) -> Option<Self> {
                let choices = &[$(stringify!($variant)),*];
                $crate::settings::read_choice(value, choices, into, |choice, fields, reading| {
                    $(if choice == stringify!($variant) {
                        return Some(Self::$variant
                            $((<$payload as $crate::settings::Settings>::take_from(fields, reading)?))?);
                    })*
                    None
                })
            }
            fn value(&self) -> $crate::document::value::Value {
                match self { $($crate::choices!(@from $variant payload $($payload)?) =>
                    $crate::choices!(@value $variant payload $($payload)?),)* }
            }
        }
    };
    (@from $variant:ident $settings:ident) => { Self::$variant };
    (@from $variant:ident $settings:ident $payload:ty) => { Self::$variant($settings) };
    (@value $variant:ident $settings:ident) => { $crate::document::value::Value::name(stringify!($variant)) };
    (@value $variant:ident $settings:ident $payload:ty) => {
        $crate::settings::Setting::value($settings).named(stringify!($variant))
    };
}
