//! Line charts as SVG text, with title, axes and units.

use super::chart::{Axis, LEFT, LINE, PLOT, Scale, TOP, colour, escape, shown, text};

/// Width of the plot, in pixels.
const WIDTH: f64 = 440.0;
/// Room on the right for half a number.
const RIGHT: f64 = 30.0;

/// A line and its name.
#[derive(Clone, Debug)]
pub struct Line {
    /// In the legend.
    pub name: String,
    /// Ends of its segments.
    pub points: Vec<[f64; 2]>,
    /// Points that are marked.
    pub marks: Vec<[f64; 2]>,
}

/// Lines over one quantity.
#[derive(Clone, Copy, Debug)]
pub struct LineChart<'a> {
    /// Heading.
    pub title: &'a str,
    /// What lies across, with its unit.
    pub across: &'a str,
    /// What goes up, with its unit.
    pub unit: &'a str,
    /// The lines.
    pub lines: &'a [Line],
    /// How values become places, both ways.
    pub scale: Scale,
}

impl LineChart<'_> {
    /// The chart as an `<svg>` element.
    pub fn svg(&self) -> String {
        let points = || self.lines.iter().flat_map(|line| &line.points);
        let across = Axis::new(self.scale, points().map(|point| point[0]));
        let up = Axis::new(self.scale, points().map(|point| point[1]));
        let height = TOP + PLOT + (3.0 + self.lines.len() as f64) * LINE;
        let width = LEFT + WIDTH + RIGHT;
        let mut out = format!(
            "<svg class=\"chart\" width=\"{width:.0}\" height=\"{height:.0}\" viewBox=\"0 0 {width:.0} {height:.0}\" role=\"img\">\
             <title>{}</title>",
            escape(self.title)
        );
        text(&mut out, [LEFT, TOP - 16.0], "class=\"heading\"", self.title);
        self.axes(&mut out, &across, &up);
        let place = |point: &[f64; 2]| [LEFT + WIDTH * across.part(point[0]), TOP + PLOT * (1.0 - up.part(point[1]))];
        for (index, line) in self.lines.iter().enumerate() {
            draw(&mut out, index, line, &place);
        }
        out.push_str("</svg>");
        out
    }

    fn axes(&self, out: &mut String, across: &Axis, up: &Axis) {
        for &tick in &up.ticks {
            let y = TOP + PLOT * (1.0 - up.part(tick));
            grid(out, [LEFT, y], [LEFT + WIDTH, y]);
            text(out, [LEFT - 6.0, y + 4.0], "text-anchor=\"end\"", &shown(tick));
        }
        for &tick in &across.ticks {
            let x = LEFT + WIDTH * across.part(tick);
            grid(out, [x, TOP], [x, TOP + PLOT]);
            text(out, [x, TOP + PLOT + LINE], "text-anchor=\"middle\"", &shown(tick));
        }
        let (x, y) = (16.0, TOP + PLOT / 2.0);
        text(out, [x, y], &format!("text-anchor=\"middle\" transform=\"rotate(-90 {x} {y})\""), self.unit);
        text(out, [LEFT + WIDTH / 2.0, TOP + PLOT + 2.0 * LINE], "text-anchor=\"middle\"", self.across);
    }
}

fn grid(out: &mut String, from: [f64; 2], to: [f64; 2]) {
    out.push_str(&format!(
        "<line class=\"grid\" x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\"/>",
        from[0], from[1], to[0], to[1]
    ));
}

/// A line, its marks and its entry in the legend.
fn draw(out: &mut String, index: usize, line: &Line, place: &dyn Fn(&[f64; 2]) -> [f64; 2]) {
    let points: Vec<String> = line.points.iter().map(place).map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
    let colour = colour(index);
    out.push_str(&format!(
        "<polyline class=\"line\" stroke=\"{colour}\" points=\"{}\"><title>{}</title></polyline>",
        points.join(" "),
        escape(&line.name)
    ));
    for [x, y] in line.marks.iter().map(place) {
        out.push_str(&format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{colour}\"/>"));
    }
    let y = TOP + PLOT + (3.0 + index as f64) * LINE;
    out.push_str(&format!("<rect x=\"{LEFT}\" y=\"{:.1}\" width=\"11\" height=\"11\" fill=\"{colour}\"/>", y - 10.0));
    text(out, [LEFT + 17.0, y], "", &line.name);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_lie_inside_the_plot() {
        let lines = [Line { name: "<a>".to_owned(), points: vec![[0.0, 1.0], [3.0, 0.25]], marks: vec![[3.0, 0.25]] }];
        for scale in [Scale::Linear, Scale::Logarithmic] {
            let chart = LineChart { title: "t", across: "round", unit: "paths", lines: &lines, scale };
            let svg = chart.svg();
            assert!(svg.contains("&lt;a&gt;") && svg.contains("<circle"));
            let points = svg.split("points=\"").nth(1).and_then(|rest| rest.split('"').next()).unwrap_or_default();
            for point in points.split(' ') {
                let (x, y) = point.split_once(',').unwrap_or_default();
                let (x, y) = (x.parse().unwrap_or(f64::NAN), y.parse().unwrap_or(f64::NAN));
                assert!((LEFT..=LEFT + WIDTH).contains(&x) && (TOP..=TOP + PLOT).contains(&y), "{points}");
            }
        }
    }
}
