//! Bar charts as SVG text, with title, axes and units.

/// Colours that most colour-blind people tell apart (Okabe and Ito 2008).
const COLOURS: [&str; 8] = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#8a8a8a", "#b8a800"];
/// Height of the plot, and the room around it, in pixels.
pub(super) const PLOT: f64 = 220.0;
pub(super) const LEFT: f64 = 84.0;
pub(super) const TOP: f64 = 34.0;
/// Width of a bar, of the gap between groups, and of a letter.
const BAR: f64 = 22.0;
const GAP: f64 = 26.0;
const LETTER: f64 = 7.0;
/// Height of a line of text.
pub(super) const LINE: f64 = 18.0;
/// The narrowest plot: its title needs room.
const NARROWEST: f64 = 360.0;

/// How values become heights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// From zero.
    Linear,
    /// By decades.
    Logarithmic,
}

/// Groups of bars, one bar of a group for each series.
#[derive(Clone, Debug)]
pub struct Chart<'a> {
    /// Heading.
    pub title: &'a str,
    /// Unit of the values, beside the vertical axis.
    pub unit: &'a str,
    /// What the groups are, below the horizontal axis.
    pub groups_are: &'a str,
    /// Names of the groups.
    pub groups: &'a [String],
    /// Names of the series.
    pub series: &'a [String],
    /// Values by series, then by group.
    pub values: Vec<Vec<Option<f64>>>,
    /// How values become heights.
    pub scale: Scale,
}

/// The vertical axis: values of its ends, and of the ticks.
pub(super) struct Axis {
    scale: Scale,
    low: f64,
    high: f64,
    pub ticks: Vec<f64>,
}

impl Axis {
    /// That shows all values.
    pub fn new(scale: Scale, values: impl Iterator<Item = f64> + Clone) -> Self {
        let most = values.clone().fold(0.0, f64::max);
        match scale {
            Scale::Linear => Self::linear(most),
            Scale::Logarithmic => {
                Self::logarithmic(values.filter(|&value| value > 0.0).fold(f64::INFINITY, f64::min), most)
            }
        }
    }

    fn linear(most: f64) -> Self {
        let step = nice_step(if most > 0.0 { most } else { 1.0 });
        let count = (most / step).ceil().max(1.0) as u32;
        let ticks = (0..=count).map(|tick| f64::from(tick) * step).collect();
        Self { scale: Scale::Linear, low: 0.0, high: f64::from(count) * step, ticks }
    }

    fn logarithmic(least: f64, most: f64) -> Self {
        let (least, most) = if most > 0.0 { (least, most) } else { (1.0, 10.0) };
        let high = most.log10().ceil() as i32;
        // A bar that is a whole power of ten must not vanish.
        let low = ((least.log10().floor() as i32).min(high - 1)) - i32::from(least.log10().fract() == 0.0);
        let ticks = (low..=high).map(|power| 10.0_f64.powi(power)).collect();
        Self { scale: Scale::Logarithmic, low: f64::from(low), high: f64::from(high), ticks }
    }

    /// Height of a value above the lower end, 0 to 1.
    pub fn part(&self, value: f64) -> f64 {
        let at = match self.scale {
            Scale::Linear => value,
            Scale::Logarithmic if value <= 0.0 => self.low,
            Scale::Logarithmic => value.log10(),
        };
        ((at - self.low) / (self.high - self.low)).clamp(0.0, 1.0)
    }
}

/// A step of 1, 2 or 5 times a power of ten that divides the range into about five.
fn nice_step(range: f64) -> f64 {
    let rough = range / 5.0;
    let power = 10.0_f64.powf(rough.log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| factor * power >= rough * 0.999).unwrap_or(10.0);
    factor * power
}

impl Chart<'_> {
    /// The chart as an `<svg>` element.
    pub fn svg(&self) -> String {
        let known = self.values.iter().flatten().copied().flatten();
        let axis = Axis::new(self.scale, known);
        let width = (self.group_width() * self.groups.len() as f64).max(NARROWEST);
        let height = TOP + PLOT + (3.0 + self.series.len() as f64) * LINE;
        let mut out = format!(
            "<svg class=\"chart\" width=\"{0:.0}\" height=\"{height:.0}\" viewBox=\"0 0 {0:.0} {height:.0}\" role=\"img\">",
            LEFT + width + GAP
        );
        out.push_str(&format!("<title>{}</title>", escape(self.title)));
        text(&mut out, [LEFT, TOP - 16.0], "class=\"heading\"", self.title);
        self.axes(&mut out, &axis, width);
        self.bars(&mut out, &axis);
        self.legend(&mut out);
        out.push_str("</svg>");
        out
    }

    fn group_width(&self) -> f64 {
        let label = self.groups.iter().map(|name| name.chars().count()).max().unwrap_or(0) as f64 * LETTER;
        (self.series.len() as f64 * BAR).max(label) + GAP
    }

    fn axes(&self, out: &mut String, axis: &Axis, width: f64) {
        for &tick in &axis.ticks {
            let y = TOP + PLOT * (1.0 - axis.part(tick));
            out.push_str(&format!(
                "<line class=\"grid\" x1=\"{LEFT}\" y1=\"{y:.1}\" x2=\"{:.1}\" y2=\"{y:.1}\"/>",
                LEFT + width
            ));
            text(out, [LEFT - 6.0, y + 4.0], "text-anchor=\"end\"", &shown(tick));
        }
        let (x, y) = (16.0, TOP + PLOT / 2.0);
        text(out, [x, y], &format!("text-anchor=\"middle\" transform=\"rotate(-90 {x} {y})\""), self.unit);
        text(out, [LEFT + width / 2.0, TOP + PLOT + 2.0 * LINE], "text-anchor=\"middle\"", self.groups_are);
    }

    fn bars(&self, out: &mut String, axis: &Axis) {
        for (group, name) in self.groups.iter().enumerate() {
            let left = LEFT + self.group_width() * group as f64;
            let middle = left + self.group_width() / 2.0;
            text(out, [middle, TOP + PLOT + LINE], "text-anchor=\"middle\"", name);
            let first = middle - BAR * self.series.len() as f64 / 2.0;
            for (series, values) in self.values.iter().enumerate() {
                if let Some(value) = values[group] {
                    self.bar(out, axis, first + BAR * series as f64, series, value);
                }
            }
        }
    }

    fn bar(&self, out: &mut String, axis: &Axis, left: f64, series: usize, value: f64) {
        let height = PLOT * axis.part(value);
        out.push_str(&format!("<rect x=\"{left:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{height:.1}\" fill=\"{}\"><title>{}: {} {}</title></rect>",
            TOP + PLOT - height,
            BAR - 3.0,
            colour(series),
            escape(&self.series[series]),
            shown(value),
            escape(self.unit)));
    }

    fn legend(&self, out: &mut String) {
        for (series, name) in self.series.iter().enumerate() {
            let y = TOP + PLOT + (3.0 + series as f64) * LINE;
            out.push_str(&format!(
                "<rect x=\"{LEFT}\" y=\"{:.1}\" width=\"11\" height=\"11\" fill=\"{}\"/>",
                y - 10.0,
                colour(series)
            ));
            text(out, [LEFT + 17.0, y], "", name);
        }
    }
}

/// The colour of a series.
pub(super) fn colour(series: usize) -> &'static str {
    COLOURS[series % COLOURS.len()]
}

/// Adds a text.
pub(super) fn text(out: &mut String, at: [f64; 2], attributes: &str, words: &str) {
    out.push_str(&format!("<text x=\"{:.1}\" y=\"{:.1}\" {attributes}>{}</text>", at[0], at[1], escape(words)));
}

/// Text as HTML and SVG take it.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A number with four significant digits.
pub fn shown(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        "0".to_owned()
    } else if !(1e-3..1e6).contains(&size) {
        let scientific = format!("{value:.3e}");
        let (digits, power) = scientific.split_once('e').unwrap_or((&scientific, "0"));
        format!("{}e{power}", trimmed(digits))
    } else {
        let decimals = (3 - size.log10().floor() as i32).max(0) as usize;
        trimmed(&format!("{value:.decimals$}")).to_owned()
    }
}

fn trimmed(digits: &str) -> &str {
    if digits.contains('.') { digits.trim_end_matches('0').trim_end_matches('.') } else { digits }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let found = [0.0, 1234.56, 0.012_345, 12.0, 1.2e-5, 3e9, 0.5].map(shown);
        assert_eq!(found, ["0", "1235", "0.01235", "12", "1.2e-5", "3e9", "0.5"]);
    }

    #[test]
    fn axes_hold_their_values() {
        let linear = Axis::linear(43.0);
        assert_eq!((linear.high, linear.ticks.len()), (50.0, 6));
        let decades = Axis::logarithmic(0.01, 3.0);
        assert!(decades.part(0.01) > 0.0 && decades.part(3.0) < 1.0);
        assert_eq!(Axis::new(Scale::Logarithmic, std::iter::empty()).ticks.len(), 3);
    }

    #[test]
    fn words_are_escaped() {
        let names = ["<a> & b".to_owned()];
        let chart = Chart {
            title: "t",
            unit: "ms",
            groups_are: "scene",
            groups: &names,
            series: &names,
            values: vec![vec![Some(1.0)]],
            scale: Scale::Linear,
        };
        let svg = chart.svg();
        assert!(svg.contains("&lt;a&gt; &amp; b") && !svg.contains("<a>"));
    }
}
