//! Colours and typography of all figures, for light and dark themes.

/// A colour by its role; clocks and curves use them in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Ink {
    /// The first curve.
    Blue,
    /// The second.
    Orange,
    /// The third.
    Teal,
    /// The fourth.
    Plum,
    /// The fifth.
    Olive,
    /// The sixth.
    Rose,
    /// The colour of grids and other elements for orientation.
    Grey,
}

impl Ink {
    /// The colours of curves, in order.
    pub const CYCLE: [Self; 6] = [Self::Blue, Self::Orange, Self::Teal, Self::Plum, Self::Olive, Self::Rose];

    /// The colour of item `i`; the cycle repeats.
    pub fn number(i: usize) -> Self {
        Self::CYCLE[i % Self::CYCLE.len()]
    }

    /// The colour of run `i` of several: never the first, which marks a texture's models.
    pub(crate) fn of_run(i: usize) -> Self {
        Self::CYCLE[1 + i % (Self::CYCLE.len() - 1)]
    }

    /// Suffix of its CSS classes: `s0` sets the stroke, `f0` the fill, `t0` a tinted area, `b0` a background
    /// of a page.
    pub(crate) fn class(self) -> &'static str {
        match self {
            Self::Blue => "0",
            Self::Orange => "1",
            Self::Teal => "2",
            Self::Plum => "3",
            Self::Olive => "4",
            Self::Rose => "5",
            Self::Grey => "6",
        }
    }
}

/// Strong colour and tint of each ink: (light, light tint, dark, dark tint).
const INKS: [(&str, &str, &str, &str); 7] = [
    ("#2166ac", "#dfeaf6", "#79b4ee", "#1d3047"),
    ("#c85a17", "#faeadd", "#f0a066", "#412c1e"),
    ("#16836a", "#dcf1eb", "#5cc9ae", "#18382f"),
    ("#8f3f8a", "#f4e4f3", "#d79ad3", "#3a2439"),
    ("#7a7412", "#f2f0d6", "#c9c254", "#35331a"),
    ("#b93251", "#fae2e8", "#f08ba2", "#43202a"),
    ("#6b7580", "#eceff2", "#98a3af", "#2a3037"),
];

/// CSS rules with colours: (selector, property, light, dark).
const RULES: &[(&str, &str, &str, &str)] = &[
    (".paper", "fill", "#ffffff", "#14181d"),
    (".box", "fill", "#ffffff", "#1c2229"),
    (".ink", "fill", "#1c242c", "#e8edf2"),
    (".soft", "fill", "#59636e", "#a3aeb9"),
    (".remark-text", "fill", "#59636e", "#a3aeb9"),
    (".faint", "fill", "#87919c", "#7c8792"),
    (".grid", "stroke", "#e6eaee", "#2a3138"),
    (".axis", "stroke", "#aab3bd", "#56616c"),
    (".halo", "stroke", "#ffffff", "#14181d"),
    (".frame", "stroke", "#b8c1ca", "#4a545f"),
    (".wire", "stroke", "#56616d", "#a5b0bb"),
    (".panel", "fill", "#f6f8fa", "#191e24"),
];

/// CSS rules of shapes and typography, the same in both themes.
const SHAPES: &str = "\
.figure{font-family:system-ui,-apple-system,'Segoe UI','DejaVu Sans',sans-serif;font-size:11px;height:auto;max-width:100%}\
.title{font-size:13px;font-weight:600}\
.remark-text{font-size:10px;font-weight:400}.small{font-size:10px}.tiny{font-size:9px}.strong{font-weight:600}\
.grid,.axis,.frame{stroke-width:1;fill:none;shape-rendering:crispEdges}\
.curve{fill:none;stroke-width:1.3;stroke-linejoin:round;stroke-linecap:round}\
.hair{stroke-width:.7}.bold{stroke-width:2}\
.dash{stroke-dasharray:4 3}.dots{stroke-dasharray:1 3;stroke-linecap:round}\
.veil{opacity:.45}.solid{opacity:.85}\
.halo{stroke-width:3;paint-order:stroke;stroke-linejoin:round}";

/// Additional CSS of plots: dots.
pub(crate) const DOTS: &str = ".dot,.small-dot,.large-dot{fill:none;stroke-linecap:round;stroke-width:5.2}\
.small-dot{stroke-width:2.8}.large-dot{stroke-width:9}";

/// Additional CSS of pages: the inks as backgrounds, `b0` and so on.
pub(crate) fn grounds() -> String {
    let sheet = |dark: bool| -> String {
        let ground = |(i, (light, _, night, _)): (usize, &(&str, &str, &str, &str))| {
            let colour = if dark { night } else { light };
            format!(".b{i}{{background:{colour}}}")
        };
        INKS.iter().enumerate().map(ground).collect()
    };
    format!("{}@media (prefers-color-scheme:dark){{{}}}", sheet(false), sheet(true))
}

/// The style sheet of all figures; a page contains it once, a standalone file always.
pub(crate) fn css() -> String {
    let sheet = |dark: bool| {
        let pick = |light: &'static str, night: &'static str| if dark { night } else { light };
        let rules = RULES.iter().map(|(selector, property, light, night)| {
            format!("{selector}{{{property}:{}}}", pick(light, night))
        });
        let inks = INKS.iter().enumerate().map(|(i, (light, tint, night, night_tint))| {
            let (strong, tint) = (pick(light, night), pick(tint, night_tint));
            format!(
                ".s{i}{{stroke:{strong}}}.f{i}{{fill:{strong}}}.t{i}{{fill:{tint}}}.w{i}{{stroke:{tint}}}"
            )
        });
        rules.chain(inks).collect::<String>()
    };
    format!("{SHAPES}{}@media (prefers-color-scheme:dark){{{}}}", sheet(false), sheet(true))
}

/// A colour of a sequential scale, dark to bright, for `x` from 0 to 1.
pub(crate) fn heat(x: f64) -> [u8; 3] {
    const ANCHORS: [[u8; 3]; 10] = [
        [0, 0, 4],
        [24, 15, 61],
        [68, 15, 118],
        [114, 31, 129],
        [158, 47, 127],
        [205, 64, 113],
        [241, 96, 93],
        [253, 150, 104],
        [254, 202, 141],
        [252, 253, 191],
    ];
    let x = if x.is_finite() { x.clamp(0.0, 1.0) } else { 0.0 };
    let place = x * (ANCHORS.len() - 1) as f64;
    let below = (place as usize).min(ANCHORS.len() - 2);
    let part = place - below as f64;
    std::array::from_fn(|i| {
        let (a, b) = (f64::from(ANCHORS[below][i]), f64::from(ANCHORS[below + 1][i]));
        (a + (b - a) * part).round() as u8
    })
}
