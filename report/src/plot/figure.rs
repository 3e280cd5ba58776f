//! A plot as a figure of a page: as wide as the page, with text in the size of the page. The marks are
//! stretched, the text is not; the attributes give `page/script.js` the data for its cursor and for zooming.

use super::super::scale::{Scale, Spread};
use super::super::svg::{Rect, Svg, escape, num};
use super::super::theme;
use super::marks::{draw_mark, draw_words};
use super::{Axis, Image, Mark, Plot, Weight};

/// Width of the coordinate system of the marks.
const SPAN: f64 = 1000.0;
/// Height reserved for title and axis.
const AROUND: f64 = 78.0;
/// Width of a usual frame, which determines the ticks.
const USUAL_WIDTH: f64 = 680.0;
/// Width left of the frame, as in the style sheet: plots below each other share their left edge unless a
/// label is wider.
const USUAL_ROOM: f64 = 54.0;

impl Plot {
    /// The plot as an HTML figure for a page with the style sheet.
    pub(crate) fn to_figure(&self) -> String {
        self.figure("plot", "")
    }

    /// A close-up of the page's sound, which the page's script may replace: samples at this rate, with a
    /// sample of 1 at `full_scale` on the vertical axis.
    pub(crate) fn to_close_up(&self, rate_hz: f64, full_scale: f64) -> String {
        let what = format!(" data-rate=\"{rate_hz}\" data-peak=\"{full_scale}\"");
        self.figure("plot close-up", &what)
    }

    fn figure(&self, class: &str, what: &str) -> String {
        if self.marks.is_empty() && !self.caption.is_empty() {
            return self.sentence(&self.caption);
        }
        let has_point = |mark: &Mark| mark.extent().any(|(x, y)| x.is_finite() && y.is_finite());
        if !self.marks.is_empty() && !self.marks.iter().any(has_point) {
            return self.sentence("no points.");
        }
        let height = self.size().1 - AROUND;
        let frame = Rect { x: 0.0, y: 0.0, width: SPAN, height };
        let (x, y) = self.scales(frame);
        let shape = match self.aspect {
            Some(aspect) => format!("aspect-ratio:{}", num(aspect)),
            None => format!("height:{}px", num(height)),
        };
        let room = match self.widest_tick(height) + 10.0 {
            wide if wide > USUAL_ROOM => format!(" style=\"padding-left:{}px\"", num(wide)),
            _ => String::new(),
        };
        let caption = match self.caption.as_str() {
            "" => String::new(),
            text => format!("<p class=\"caption\">{}</p>", escape(text)),
        };
        format!(
            "<figure class=\"{class}\"{what}>{}<div class=\"frame-box\"{room}><svg class=\"plot figure\" style=\"{shape}\" role=\"img\" \
             aria-label=\"{}\"{}>\n{}</svg></div>{caption}</figure>\n",
            self.head(),
            escape(&self.title),
            self.scales_for_script(&x, &y),
            self.body(frame, &x, &y),
        )
    }

    /// An empty plot is replaced by a sentence.
    fn sentence(&self, text: &str) -> String {
        format!("<p><b>{}</b>: {}</p>\n", escape(&self.title), escape(text))
    }

    /// Title, remark, legend, and label of the vertical axis.
    fn head(&self) -> String {
        let note = match self.note.as_str() {
            "" => String::new(),
            note => format!(" <span class=\"note\">{}</span>", escape(note)),
        };
        let mut keys: String = self.marks.iter().filter_map(|mark| self.key(mark)).collect();
        let image = self.marks.iter().find_map(|mark| match mark {
            Mark::Image(image) => Some(image),
            _ => None,
        });
        keys += &image.map_or_else(String::new, colours);
        let label = match self.y.label.as_str() {
            "" => String::new(),
            label => format!("<span class=\"axis-label\">{}</span>", escape(label)),
        };
        format!(
            "<figcaption><b>{}</b>{note}<span class=\"keys\">{keys}</span>{label}</figcaption>",
            escape(&self.title)
        )
    }

    /// Colour and name of a mark, with a field for its value at the cursor.
    fn key(&self, mark: &Mark) -> Option<String> {
        let style = mark.style()?;
        let value = match mark {
            Mark::Line(..) | Mark::Band(..) if self.x.is_time => "<output></output>",
            _ if style.name.is_empty() => return None,
            _ => "",
        };
        let shape = match mark {
            Mark::Dots(..) => " round",
            _ if style.weight == Weight::Dashed => " dashed",
            _ => "",
        };
        let swatch = match style.name.as_str() {
            "" => String::new(),
            _ => format!("<i class=\"swatch b{}{shape}\"></i>", style.ink.class()),
        };
        Some(format!("<span class=\"key\">{swatch}{} {value}</span>", escape(&style.name)))
    }

    fn scales_for_script(&self, x: &Scale, y: &Scale) -> String {
        if !self.x.is_time {
            return String::new();
        }
        let spread = match y.spread {
            Spread::Linear => "linear",
            Spread::Log => "log",
        };
        format!(
            " data-time=\"{} {}\" data-y=\"{} {}\" data-spread=\"{spread}\"",
            x.low, x.high, y.low, y.high
        )
    }

    fn body(&self, frame: Rect, x: &Scale, y: &Scale) -> String {
        let across = |value: f64| percent(x.pixel(value) / SPAN);
        let down = |value: f64| percent(y.pixel(value) / frame.height);
        let xs = Self::ticks(&self.x, x, USUAL_WIDTH);
        let ys = Self::ticks(&self.y, y, frame.height);
        let mut svg = Svg::default();
        svg.raw(format_args!("<g class=\"ticks\">"));
        let few = xs.len() <= 6;
        for (number, (value, text)) in xs.iter().enumerate() {
            let number = if few { 0 } else { number };
            tick_across(&mut svg, &across(*value), text, number);
        }
        svg.raw(format_args!("</g>"));
        for (value, text) in &ys {
            let at = down(*value);
            svg.raw(format_args!("<line class=\"grid\" x1=\"0\" x2=\"100%\" y1=\"{at}\" y2=\"{at}\"/>"));
            if !text.is_empty() {
                svg.raw(format_args!(
                    "<text class=\"small soft\" x=\"0\" y=\"{at}\" dx=\"-6\" dy=\"3.5\" text-anchor=\"end\">{}</text>",
                    escape(text)
                ));
            }
        }
        svg.raw(format_args!(
            "<svg class=\"marks\" viewBox=\"0 0 {SPAN} {}\" preserveAspectRatio=\"none\">",
            num(frame.height)
        ));
        for mark in &self.marks {
            draw_mark(&mut svg, mark, x, y);
        }
        svg.raw(format_args!("</svg>"));
        for mark in &self.marks {
            draw_words(&mut svg, mark, &|a, b| (across(a), down(b)));
        }
        svg.raw(format_args!("<rect class=\"axis\" width=\"100%\" height=\"100%\"/>"));
        if !self.x.label.is_empty() {
            svg.raw(format_args!(
                "<text class=\"soft\" x=\"50%\" y=\"100%\" dy=\"31\" text-anchor=\"middle\">{}</text>",
                escape(&self.x.label)
            ));
        }
        svg.into_text()
    }
}

/// A grid line and a number; odd numbers are hidden if there is little space.
fn tick_across(svg: &mut Svg, at: &str, text: &str, number: usize) {
    svg.raw(format_args!("<line class=\"grid\" x1=\"{at}\" x2=\"{at}\" y1=\"0\" y2=\"100%\"/>"));
    if !text.is_empty() {
        let odd = if number % 2 == 1 { " odd" } else { "" };
        svg.raw(format_args!(
            "<text class=\"small soft{odd}\" x=\"{at}\" y=\"100%\" dy=\"15\" text-anchor=\"middle\">{}</text>",
            escape(text)
        ));
    }
}

fn percent(part: f64) -> String {
    let text = format!("{:.3}", 100.0 * part);
    format!("{}%", text.trim_end_matches('0').trim_end_matches('.'))
}

/// The colour scale of an image.
fn colours(image: &Image) -> String {
    let stops: Vec<String> = (0..=8)
        .map(|i| {
            let [r, g, b] = theme::heat(f64::from(i) / 8.0);
            format!("#{r:02x}{g:02x}{b:02x}")
        })
        .collect();
    let (low, high) = image.colours;
    format!(
        "<span class=\"key\">{} <i class=\"colours\" style=\"background:linear-gradient(to right,{})\"></i> {} {}</span>",
        super::super::scale::plain(low),
        stops.join(","),
        super::super::scale::plain(high),
        escape(&image.label)
    )
}

impl Axis {
    /// Time in seconds. The page's plots over time share one cursor.
    pub fn time() -> Self {
        Self { is_time: true, ..Self::of("Time (s)") }
    }
}
