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
/// A field without `= default` is required. `[live]` marks a setting that may change while the graph runs, whose handle
/// is `LiveId::<LowPass>::named("cutoff_hz")` (see [`LiveId`](crate::settings::LiveId)), and `[live, below_nyquist]`
/// a frequency that has to stay below half of the node's rate when it does. `[limit]` marks the limit of an actuator
/// sink, and `[output_file]` the file that a sink writes. There are no other flags, and a misspelt one does not
/// compile:
///
/// ```compile_fail
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
    (@live live) => { true };
    (@live $other:ident) => { false };
    (@limit limit) => { true };
    (@limit $other:ident) => { false };
    (@mark live $spec:ident) => { $spec.live = true };
    (@mark below_nyquist $spec:ident) => { $spec.below_nyquist = true };
    (@mark limit $spec:ident) => { $spec.role = $crate::settings::SettingRole::Limit };
    (@mark output_file $spec:ident) => { $spec.role = $crate::settings::SettingRole::OutputFile };
    (@mark $other:ident $spec:ident) => {
        compile_error!(concat!(
            "unknown flag `", stringify!($other),
            "` of a setting; the flags are `live`, `below_nyquist`, `limit` and `output_file`"
        ))
    };
    ($(#[doc = $summary:expr])* $vis:vis struct $name:ident {
        $($(#[doc = $doc:expr])* $([$($flag:ident),+])? $field:ident : $type:ty $(= $default:expr)? $(, in $range:expr)? ;)*
    }) => {
        $(#[doc = $summary])*
        #[derive(Debug, Clone, PartialEq)]
        $vis struct $name { $($(#[doc = $doc])* pub $field: $type,)* }

        $(const _: () = $crate::settings::check_unit::<$type>(stringify!($field));)*

        impl $crate::settings::Settings for $name {
            const FIELDS: &'static [$crate::settings::DeclaredField] = &[$($crate::settings::DeclaredField {
                name: stringify!($field),
                is_live: $crate::settings::any(&[$($($crate::settings!(@live $flag)),+)?]),
                is_limit: $crate::settings::any(&[$($($crate::settings!(@limit $flag)),+)?]),
            }),*];

            fn specs() -> Vec<$crate::settings::SettingSpec> {
                vec![$({
                    #[allow(unused_mut, unused_assignments)]
                    let (mut default, mut range): (Option<$type>, Option<(f64, f64)>) = (None, None);
                    $(default = Some($default);)?
                    $(range = Some((f64::from(*($range).start()), f64::from(*($range).end())));)?
                    let doc = [$($doc),*].concat().trim().to_owned();
                    #[allow(unused_mut)]
                    let mut spec = $crate::settings::SettingSpec::new(stringify!($field), doc, default.as_ref(), range);
                    $($($crate::settings!(@mark $flag spec);)+)?
                    spec
                }),*]
            }

            #[allow(unused_variables, unused_mut, unused_assignments)]
            fn take_from(
                fields: &mut $crate::settings::Fields,
                reading: &mut $crate::settings::Reading<'_>,
            ) -> Option<Self> {
                // All fields are read before the first `?`, so that all errors are reported.
                $(let $field = {
                    let mut default: Option<$type> = None;
                    $(default = Some($default);)?
                    let mut range = None;
                    $(range = Some((f64::from(*($range).start()), f64::from(*($range).end())));)?
                    fields.setting(stringify!($field), default, range, reading)
                };)*
                Some(Self { $($field: $field?,)* })
            }
        }

        impl $crate::settings::Setting for $name {
            fn expected() -> $crate::settings::Expected {
                $crate::settings::Expected::Structure(vec![$(stringify!($field)),*])
            }
            fn parts() -> Vec<$crate::settings::Part> {
                let doc: &[&str] = &[$($summary),*];
                vec![$crate::settings::Part {
                    choice: None,
                    doc: doc.concat().trim().to_owned(),
                    fields: <Self as $crate::settings::Settings>::specs(),
                }]
            }
            fn read(
                value: &$crate::document::value::Value,
                reading: &mut $crate::settings::Reading<'_>,
            ) -> Option<Self> {
                let owner = reading.owner(stringify!($name));
                let mut fields = $crate::settings::fields_of(value, &owner, reading)?;
                let read = <Self as $crate::settings::Settings>::take_from(&mut fields, reading);
                fields.finish(reading);
                read
            }
            fn value(&self) -> $crate::document::value::Value {
                let fields: [(&str, $crate::document::value::Value); _] =
                    [$((stringify!($field), $crate::settings::Setting::value(&self.$field))),*];
                $crate::document::value::Value::structure(fields)
            }
        }
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
                vec![$($crate::settings::Part {
                    choice: Some(stringify!($variant)),
                    doc: [$($doc),*].concat().trim().to_owned(),
                    fields: $crate::choices!(@fields $($payload)?),
                }),*]
            }
            fn read(
                value: &$crate::document::value::Value,
                reading: &mut $crate::settings::Reading<'_>,
            ) -> Option<Self> {
                // Full paths: the enum itself may be called `Shape`.
                let $crate::document::value::Shape::Tagged($crate::document::value::Tagged {
                    name: Some(name), ..
                }) = &value.shape else {
                    reading.not_a_choice(value, &[$(stringify!($variant)),*]);
                    return None;
                };
                match name.text.as_str() {
                    $(stringify!($variant) => $crate::choices!(@read $name $variant value reading $($payload)?),)*
                    unknown => {
                        $crate::settings::unknown_choice(unknown, &[$(stringify!($variant)),*], name.span, reading);
                        None
                    }
                }
            }
            fn value(&self) -> $crate::document::value::Value {
                match self { $($crate::choices!(@pattern $variant payload $($payload)?) =>
                    $crate::choices!(@value $variant payload $($payload)?),)* }
            }
        }
    };
    (@fields) => { Vec::new() };
    (@fields $payload:ty) => { <$payload as $crate::settings::Settings>::specs() };
    (@read $name:ident $variant:ident $value:ident $reading:ident) => {{
        let fields = $crate::settings::fields_of($value, concat!("`", stringify!($variant), "`"), $reading)?;
        fields.finish($reading);
        Some($name::$variant)
    }};
    (@read $name:ident $variant:ident $value:ident $reading:ident $payload:ty) => {{
        let mut fields =
            $crate::settings::fields_of($value, concat!("`", stringify!($variant), "`"), $reading)?;
        let read = <$payload as $crate::settings::Settings>::take_from(&mut fields, $reading);
        fields.finish($reading);
        read.map($name::$variant)
    }};
    (@pattern $variant:ident $settings:ident) => { Self::$variant };
    (@pattern $variant:ident $settings:ident $payload:ty) => { Self::$variant($settings) };
    (@value $variant:ident $settings:ident) => { $crate::document::value::Value::name(stringify!($variant)) };
    (@value $variant:ident $settings:ident $payload:ty) => {
        $crate::settings::Setting::value($settings).named(stringify!($variant))
    };
}
