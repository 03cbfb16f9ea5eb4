//! Small plots as SVG text: step and line charts, bars, and intervals with their values.
//!
//! In: numbers with names and units. Out: an SVG element to be put in the page (it takes its font from there) or saved as a
//! file. Text is escaped. Coordinates are written with two decimals, so bytes are stable.

use std::fmt::Write;

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SeriesStyle {
    /// Straight lines between points.
    Line,
    /// A step that holds each value up to the next point.
    Step,
    /// A bar from zero, centred on its x, four fifths as wide as the least gap.
    Bars,
    /// Dots.
    Dots,
}

/// Points with a name and a colour.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Name in the legend.
    pub name: String,
    /// CSS colour.
    pub colour: String,
    /// How it is drawn.
    pub style: SeriesStyle,
    /// `(x, y)`, x ascending.
    pub points: Vec<[f64; 2]>,
}

/// A vertical line with a word on it.
#[derive(Clone, Debug, PartialEq)]
pub struct Marker {
    /// Where.
    pub x: f64,
    /// The word.
    pub label: String,
}

/// A chart; y is linear, x linear or logarithmic.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chart {
    /// What the picture shows, also its text for readers who cannot see it.
    pub title: String,
    /// Name and unit of x.
    pub x_label: String,
    /// Name and unit of y.
    pub y_label: String,
    /// What is drawn, in this order.
    pub series: Vec<Series>,
    /// Vertical lines.
    pub markers: Vec<Marker>,
    /// Logarithmic x; points with x not above 0 are left out.
    pub log_x: bool,
}

/// Text safe inside an XML element or a quoted attribute.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

/// About `count` round numbers from `lo` to `hi`; `lo` alone where they are too near each other to be told apart.
pub fn ticks(lo: f64, hi: f64, count: usize) -> Vec<f64> {
    let span = hi - lo;
    let least = (1e-12 * lo.abs().max(hi.abs())).max(1e-300);
    if !span.is_finite() || span < least {
        return vec![lo];
    }
    let raw = span / count.max(1) as f64;
    let power = 10f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 2.5, 5.0, 10.0]
        .map(|m| m * power)
        .into_iter()
        .find(|s| *s >= raw * 0.999)
        .unwrap_or(10.0 * power);
    let first = (lo / step - 1e-9).ceil() as i64;
    let last = (hi / step + 1e-9).floor() as i64;
    (first..=last).map(|i| i as f64 * step).collect()
}

/// A number for people: three significant digits below 1000, whole above, no trailing zeros; a power of ten below 0.0001.
pub fn pretty(x: f64) -> String {
    if !x.is_finite() {
        return "-".to_owned();
    }
    let a = x.abs();
    if a == 0.0 {
        return "0".to_owned();
    }
    if a < 1e-4 {
        let text = format!("{x:.2e}");
        let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
        let digits = digits.trim_end_matches('0').trim_end_matches('.');
        // No line may break inside a number.
        return format!("{digits}×10{}", superscript(power));
    }
    let decimals = if a >= 999.5 {
        0
    } else {
        (2 - a.log10().floor() as i32).clamp(0, 9) as usize
    };
    let mut text = format!("{x:.decimals$}");
    if text.contains('.') {
        text.truncate(text.trim_end_matches('0').trim_end_matches('.').len());
    }
    if text == "-0" { "0".to_owned() } else { text }
}

fn superscript(number: &str) -> String {
    number
        .chars()
        .map(|c| match c {
            '-' => '⁻',
            '1' => '¹',
            '2' => '²',
            '3' => '³',
            // The others stand together, from zero up.
            c => char::from_u32(0x2070 + u32::from(c) - u32::from('0')).unwrap_or(c),
        })
        .collect()
}

/// 1, 2 and 5 times powers of ten between two logarithms.
fn log_ticks(range: [f64; 2]) -> Vec<f64> {
    let powers = range[0].floor() as i32..=range[1].ceil() as i32;
    let all = powers.flat_map(|p| [1.0, 2.0, 5.0].map(|m| m * 10f64.powi(p)));
    all.filter(|t| (range[0]..=range[1]).contains(&t.log10()))
        .collect()
}

const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 300.0;
const LEFT: f64 = 58.0;
const RIGHT: f64 = 16.0;
const TOP: f64 = 34.0;
const BOTTOM: f64 = 46.0;

/// Data to picture.
struct Frame {
    x: [f64; 2],
    y: [f64; 2],
    log_x: bool,
}

impl Frame {
    fn of(chart: &Chart) -> Self {
        let all = || {
            chart
                .series
                .iter()
                .flat_map(|s| &s.points)
                .filter(|p| p[0].is_finite() && p[1].is_finite())
        };
        let (mut x, mut y) = ([f64::INFINITY, f64::NEG_INFINITY], [0f64, f64::NEG_INFINITY]);
        for p in all() {
            let at = if chart.log_x { p[0].log10() } else { p[0] };
            if at.is_finite() {
                x = [x[0].min(at), x[1].max(at)];
            }
            y = [y[0].min(p[1]), y[1].max(p[1])];
        }
        for s in chart.series.iter().filter(|s| s.style == SeriesStyle::Bars) {
            x = [x[0] - 0.5 * bar_gap(s), x[1] + 0.5 * bar_gap(s)];
        }
        for m in &chart.markers {
            let at = if chart.log_x { m.x.log10() } else { m.x };
            x = [x[0].min(at), x[1].max(at)];
        }
        if x[0] > x[1] {
            x = [0.0, 1.0];
        }
        if x[0] == x[1] {
            x = [x[0] - 0.5, x[1] + 0.5];
        }
        let margin = 0.02 * (x[1] - x[0]);
        x = [x[0] - margin, x[1] + margin];
        if y[1] <= y[0] {
            y[1] = y[0] + 1.0;
        }
        y[1] += 0.06 * (y[1] - y[0]);
        Self {
            x,
            y,
            log_x: chart.log_x,
        }
    }

    fn px(&self, x: f64) -> f64 {
        let x = if self.log_x { x.log10() } else { x };
        LEFT + (x - self.x[0]) / (self.x[1] - self.x[0]) * (WIDTH - LEFT - RIGHT)
    }

    fn py(&self, y: f64) -> f64 {
        HEIGHT - BOTTOM - (y - self.y[0]) / (self.y[1] - self.y[0]) * (HEIGHT - TOP - BOTTOM)
    }
}

impl Chart {
    /// The chart as an SVG element.
    pub fn svg(&self) -> String {
        let frame = Frame::of(self);
        let mut out = open(&self.title, WIDTH, HEIGHT);
        self.axes(&frame, &mut out);
        for s in &self.series {
            draw_series(&frame, s, &mut out);
        }
        for m in &self.markers {
            let x = frame.px(m.x);
            // Writing to a string cannot fail; the results are dropped here and below.
            let _ = write!(
                out,
                "<line x1=\"{x:.2}\" x2=\"{x:.2}\" y1=\"{TOP}\" y2=\"{:.2}\" class=\"marker\"/>",
                HEIGHT - BOTTOM
            );
            let (anchor, dx) = if x > 0.7 * WIDTH {
                ("end", -5.0)
            } else {
                ("start", 5.0)
            };
            let _ = write!(
                out,
                "<text x=\"{:.2}\" y=\"{:.2}\" text-anchor=\"{anchor}\" class=\"note\">{}</text>",
                x + dx,
                HEIGHT - BOTTOM - 8.0,
                escape(&m.label)
            );
        }
        self.legend(&mut out);
        out.push_str("</svg>");
        out
    }

    fn axes(&self, frame: &Frame, out: &mut String) {
        let bottom = HEIGHT - BOTTOM;
        let whole = |k: usize| {
            self.series
                .iter()
                .flat_map(|s| &s.points)
                .all(|p| p[k].fract() == 0.0)
        };
        let keep = |whole: bool, t: f64| !whole || (t - t.round()).abs() < 1e-9;
        for t in ticks(frame.y[0], frame.y[1], 5)
            .into_iter()
            .filter(|t| keep(whole(1), *t))
        {
            let y = frame.py(t);
            let _ = write!(
                out,
                "<line x1=\"{LEFT}\" x2=\"{:.2}\" y1=\"{y:.2}\" y2=\"{y:.2}\" class=\"grid\"/><text x=\"{:.2}\" y=\"{:.2}\" text-anchor=\"end\">{}</text>",
                WIDTH - RIGHT,
                LEFT - 7.0,
                y + 4.0,
                pretty(t)
            );
        }
        let x_ticks: Vec<f64> = if self.log_x {
            log_ticks(frame.x)
        } else {
            let round = ticks(frame.x[0], frame.x[1], 7);
            round.into_iter().filter(|t| keep(whole(0), *t)).collect()
        };
        for t in x_ticks {
            let x = frame.px(t);
            let _ = write!(
                out,
                "<line x1=\"{x:.2}\" x2=\"{x:.2}\" y1=\"{bottom:.2}\" y2=\"{:.2}\" class=\"axis\"/><text x=\"{x:.2}\" y=\"{:.2}\" text-anchor=\"middle\">{}</text>",
                bottom + 4.0,
                bottom + 17.0,
                pretty(t)
            );
        }
        let _ = write!(
            out,
            "<line x1=\"{LEFT}\" x2=\"{:.2}\" y1=\"{bottom:.2}\" y2=\"{bottom:.2}\" class=\"axis\"/>",
            WIDTH - RIGHT
        );
        let _ = write!(
            out,
            "<text x=\"{:.2}\" y=\"{:.2}\" text-anchor=\"middle\" class=\"label\">{}</text>",
            0.5 * (LEFT + WIDTH - RIGHT),
            HEIGHT - 8.0,
            escape(&self.x_label)
        );
        let middle = 0.5 * (TOP + bottom);
        let _ = write!(
            out,
            "<text x=\"14\" y=\"{middle:.2}\" text-anchor=\"middle\" class=\"label\" transform=\"rotate(-90 14 {middle:.2})\">{}</text>",
            escape(&self.y_label)
        );
    }

    fn legend(&self, out: &mut String) {
        if self.series.len() < 2 {
            return;
        }
        let mut x = LEFT;
        for s in &self.series {
            let _ = write!(
                out,
                "<rect x=\"{x:.2}\" y=\"9\" width=\"11\" height=\"11\" rx=\"2\" fill=\"{}\"/><text x=\"{:.2}\" y=\"19\">{}</text>",
                escape(&s.colour),
                x + 16.0,
                escape(&s.name)
            );
            x += 34.0 + 6.6 * s.name.chars().count() as f64;
        }
    }
}

fn open(title: &str, width: f64, height: f64) -> String {
    let title = escape(title);
    format!(
        "<svg class=\"plot\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" role=\"img\" aria-label=\"{title}\" xmlns=\"http://www.w3.org/2000/svg\"><title>{title}</title>"
    )
}

/// The least distance between bars; 1 for a single one.
fn bar_gap(s: &Series) -> f64 {
    let gaps = s
        .points
        .windows(2)
        .map(|w| w[1][0] - w[0][0])
        .filter(|g| *g > 0.0);
    let gap = gaps.fold(f64::INFINITY, f64::min);
    if gap.is_finite() { gap } else { 1.0 }
}

fn draw_series(frame: &Frame, s: &Series, out: &mut String) {
    let colour = escape(&s.colour);
    let finite = s
        .points
        .iter()
        .filter(|p| p[0].is_finite() && p[1].is_finite() && (!frame.log_x || p[0] > 0.0));
    let points: Vec<[f64; 2]> = finite.map(|p| [frame.px(p[0]), frame.py(p[1])]).collect();
    match s.style {
        SeriesStyle::Line | SeriesStyle::Step => {
            let mut path = String::new();
            for (i, p) in points.iter().enumerate() {
                if i == 0 {
                    let _ = write!(path, "M{:.2} {:.2}", p[0], p[1]);
                } else if s.style == SeriesStyle::Step {
                    let _ = write!(path, "H{:.2}V{:.2}", p[0], p[1]);
                } else {
                    let _ = write!(path, "L{:.2} {:.2}", p[0], p[1]);
                }
            }
            let _ = write!(
                out,
                "<path d=\"{path}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>"
            );
        }
        SeriesStyle::Bars => {
            let zero = frame.py(0.0);
            let gap = bar_gap(s);
            let width = (frame.px(frame.x[0] + 0.8 * gap) - frame.px(frame.x[0])).max(1.0);
            for p in &points {
                let _ = write!(
                    out,
                    "<rect x=\"{:.2}\" y=\"{:.2}\" width=\"{width:.2}\" height=\"{:.2}\" fill=\"{colour}\"/>",
                    p[0] - 0.5 * width,
                    p[1].min(zero),
                    (zero - p[1]).abs()
                );
            }
        }
        SeriesStyle::Dots => {
            for p in &points {
                let _ = write!(
                    out,
                    "<circle cx=\"{:.2}\" cy=\"{:.2}\" r=\"3.2\" fill=\"{colour}\"/>",
                    p[0], p[1]
                );
            }
        }
    }
}

/// A value with its interval, one row of [`interval_plot`].
#[derive(Clone, Debug, PartialEq)]
pub struct IntervalRow {
    /// Name at the left.
    pub label: String,
    /// The value.
    pub value: f64,
    /// The two ends of its interval.
    pub interval: [f64; 2],
    /// Drawn in the strong colour.
    pub significant: bool,
}

/// Values with intervals about zero, one row each, as SVG.
pub fn interval_plot(title: &str, unit: &str, rows: &[IntervalRow]) -> String {
    const ROW: f64 = 26.0;
    const NAMES: f64 = 150.0;
    let height = 56.0 + ROW * rows.len() as f64;
    let mut x = [0f64, 0f64];
    for v in rows
        .iter()
        .flat_map(|r| [r.value, r.interval[0], r.interval[1]])
        .filter(|v| v.is_finite())
    {
        x = [x[0].min(v), x[1].max(v)];
    }
    let room = (x[1] - x[0]).max(1e-6);
    let x = [x[0] - 0.06 * room, x[1] + 0.06 * room];
    let px = |v: f64| NAMES + (v.clamp(x[0], x[1]) - x[0]) / (x[1] - x[0]) * (WIDTH - NAMES - RIGHT - 70.0);
    let mut out = open(title, WIDTH, height);
    let bottom = height - 40.0;
    for t in ticks(x[0], x[1], 6) {
        let class = if t == 0.0 { "axis" } else { "grid" };
        let _ = write!(
            out,
            "<line x1=\"{0:.2}\" x2=\"{0:.2}\" y1=\"6\" y2=\"{bottom:.2}\" class=\"{class}\"/><text x=\"{0:.2}\" y=\"{1:.2}\" text-anchor=\"middle\">{2}</text>",
            px(t),
            bottom + 15.0,
            pretty(t)
        );
    }
    for (i, r) in rows.iter().enumerate() {
        let y = 12.0 + ROW * (i as f64 + 0.5);
        let colour = match (r.significant, r.value > 0.0) {
            (false, _) => "#7b8794",
            (true, true) => "#b2182b",
            (true, false) => "#2166ac",
        };
        let _ = write!(
            out,
            "<text x=\"{:.2}\" y=\"{:.2}\" text-anchor=\"end\">{}</text><line x1=\"{:.2}\" x2=\"{:.2}\" y1=\"{y:.2}\" y2=\"{y:.2}\" stroke=\"{colour}\" stroke-width=\"3\"/><circle cx=\"{:.2}\" cy=\"{y:.2}\" r=\"5\" fill=\"{colour}\"/><text x=\"{:.2}\" y=\"{:.2}\">{} {}</text>",
            NAMES - 12.0,
            y + 4.0,
            escape(&r.label),
            px(r.interval[0]),
            px(r.interval[1]),
            px(r.value),
            WIDTH - RIGHT - 60.0,
            y + 4.0,
            signed(r.value),
            escape(unit)
        );
    }
    let _ = write!(
        out,
        "<text x=\"{:.2}\" y=\"{:.2}\" text-anchor=\"middle\" class=\"label\">{} [{}]</text></svg>",
        0.5 * (NAMES + WIDTH - 70.0),
        height - 7.0,
        escape(title),
        escape(unit)
    );
    out
}

/// [`pretty`] with a plus sign for what grows.
pub fn signed(x: f64) -> String {
    let text = pretty(x);
    if x > 0.0 && text != "0" {
        format!("+{text}")
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_true() {
        for (x, text) in [
            (0.0, "0"),
            (1234.5, "1234"),
            (999.7, "1000"),
            (12.345, "12.3"),
            (0.012345, "0.0123"),
            (-2.5, "-2.5"),
            (100.0, "100"),
            (1.39e-5, "1.39×10⁻⁵"),
            (-2e-17, "-2×10⁻¹⁷"),
            (f64::NAN, "-"),
        ] {
            assert_eq!(pretty(x), text);
        }
        assert_eq!(signed(2.0), "+2");
    }

    #[test]
    fn ticks_of_a_range_without_numbers_between_are_one() {
        for (lo, hi) in [
            (0.0, 5e-324),
            (-5e-324, 0.0),
            (1.0, 1.0 + f64::EPSILON),
            (1e300, 1e300 * (1.0 + f64::EPSILON)),
            (f64::MIN, f64::MAX),
        ] {
            assert_eq!(ticks(lo, hi, 5), [lo]);
        }
        assert!(ticks(0.0, 1e-200, 5).len() > 3 && ticks(-1e300, 1e300, 5).len() > 3);
    }

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks(0.0, 10.0, 5), vec![0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        for t in ticks(-0.37, 1.91, 6) {
            assert!((-0.371..=1.911).contains(&t));
        }
        assert_eq!(ticks(3.0, 3.0, 5), vec![3.0]);
    }

    #[test]
    fn text_cannot_leave_its_element() {
        let chart = Chart {
            title: "<script>alert(1)</script>".to_owned(),
            ..Chart::default()
        };
        assert!(!chart.svg().contains("<script>"));
    }
}
