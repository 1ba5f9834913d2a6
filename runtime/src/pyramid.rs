//! Pictures of the strategies (s, t) of a bidirectional pipeline, arranged as a pyramid: a row for each length of path.

use crate::error::Error;
use crate::picture::{to_srgb, write_png};
use std::path::{Path, PathBuf};

/// Width of a tile, pixels; smaller pictures are shown as they are.
const TILE: u32 = 160;
/// Between tiles, pixels.
const GAP: u32 = 4;
/// Height of the line of text above a tile: a glyph of 5 pixels, twice as large, and space around it.
const LABEL: u32 = 16;
/// Side of a glyph's pixel.
const SCALE: u32 = 2;

/// What a pyramid shows of each strategy.
type Pixels = fn(&Strategy) -> &[f32];
/// The pyramids: how the names of their files end, and what they show.
const PYRAMIDS: [(&str, Pixels); 2] =
    [("weighted.png", |strategy| &strategy.weighted), ("unweighted.png", |strategy| &strategy.unweighted)];

/// One strategy: `s` vertices from the eye walk, `t` from the light walk.
#[derive(Clone, Debug, PartialEq)]
pub struct Strategy {
    /// Vertices of the eye walk, the camera not counted.
    pub s: u32,
    /// Vertices of the light walk.
    pub t: u32,
    /// What it adds to the picture, three channels a pixel.
    pub weighted: Vec<f32>,
    /// What the paths of its length would look like by it alone.
    pub unweighted: Vec<f32>,
}

impl Strategy {
    /// Names and pixels of its two layers in a file.
    pub fn layers(&self) -> [(String, Vec<f32>); 2] {
        let Strategy { s, t, weighted, unweighted } = self;
        [
            (format!("strategy.s{s}t{t}.weighted"), weighted.clone()),
            (format!("strategy.s{s}t{t}.unweighted"), unweighted.clone()),
        ]
    }
}

/// Collects the strategies from layers numbered by edges and then by `s`, all unweighted ones behind all weighted ones. Strategies that
/// a pipeline never uses, which stay black, are left out.
pub fn strategies(layer: &dyn Fn(u32) -> Option<Vec<f32>>) -> Vec<Strategy> {
    let count = (0..).take_while(|&index| layer(index).is_some()).count() as u32;
    let half = count / 2;
    let mut found = Vec::new();
    for edges in (1..).take_while(|&edges| index_of(edges, edges) < half) {
        for s in (0..=edges).rev() {
            let index = index_of(edges, s);
            if let (Some(weighted), Some(unweighted)) = (layer(index), layer(half + index))
                && unweighted.iter().any(|&value| value != 0.0)
            {
                found.push(Strategy { s, t: edges - s, weighted, unweighted });
            }
        }
    }
    found
}

fn index_of(edges: u32, s: u32) -> u32 {
    edges * (edges + 1) / 2 + s
}

/// Where the pyramids of a picture lie: `OUT.weighted.png` and `OUT.unweighted.png` beside `OUT.exr`.
pub fn files(picture: &Path) -> [PathBuf; 2] {
    PYRAMIDS.map(|(end, _)| picture.with_extension(end))
}

/// Writes the pyramids of a picture of this size beside it, all tiles with one exposure. Gives their paths.
///
/// # Errors
/// Failed, when a file cannot be written.
pub fn write(picture: &Path, strategies: &[Strategy], size: [u32; 2], factor: f32) -> Result<Vec<PathBuf>, Error> {
    let drawn = PYRAMIDS.map(|(_, pixels)| draw(strategies, size, factor, pixels));
    let written = drawn.into_iter().zip(files(picture)).map(|((size, rgb), file)| {
        write_png(&file, size, &rgb)?;
        Ok(file)
    });
    written.collect()
}

/// The pyramid as 8-bit RGB with its size: a row for each length, strategies with more eye vertices on the left, each labelled.
fn draw(strategies: &[Strategy], size: [u32; 2], factor: f32, pixels: Pixels) -> ([u32; 2], Vec<u8>) {
    let shrink = size[0].div_ceil(TILE).max(1);
    let tile = [size[0] / shrink, size[1] / shrink];
    let mut lengths: Vec<u32> = strategies.iter().map(|strategy| strategy.s + strategy.t).collect();
    lengths.dedup();
    let rows: Vec<Vec<&Strategy>> = lengths
        .iter()
        .map(|&edges| strategies.iter().filter(|strategy| strategy.s + strategy.t == edges).collect())
        .collect();
    let widest = rows.iter().map(Vec::len).max().unwrap_or(0) as u32;
    let width = widest * (tile[0].max(label_width()) + GAP) + GAP;
    let height = rows.len() as u32 * (tile[1] + LABEL + GAP) + GAP;
    let mut canvas = Canvas { width, rgb: vec![24; (width * height * 3) as usize] };
    for (row, tiles) in rows.iter().enumerate() {
        let step = tile[0].max(label_width()) + GAP;
        let left = (width - tiles.len() as u32 * step + GAP) / 2;
        let top = GAP + row as u32 * (tile[1] + LABEL + GAP);
        for (column, strategy) in tiles.iter().enumerate() {
            let x = left + column as u32 * step;
            canvas.text(&format!("s={} t={}", strategy.s, strategy.t), x, top + 3);
            let small = shrunk(pixels(strategy), size, shrink);
            canvas.tile(&to_srgb(&small, factor), tile[0], x, top + LABEL);
        }
    }
    ([width, height], canvas.rgb)
}

/// Room for `s=10 t=10`.
fn label_width() -> u32 {
    9 * 4 * SCALE
}

/// Means over squares of `factor` pixels.
fn shrunk(pixels: &[f32], size: [u32; 2], factor: u32) -> Vec<f32> {
    let [width, height] = [size[0] / factor, size[1] / factor];
    let mut small = Vec::with_capacity((width * height * 3) as usize);
    for y in 0..height {
        for x in 0..width {
            for channel in 0..3 {
                let at = |dx: u32, dy: u32| (((y * factor + dy) * size[0] + x * factor + dx) * 3 + channel) as usize;
                let square = (0..factor * factor).map(|i| pixels[at(i % factor, i / factor)]);
                small.push(square.sum::<f32>() / (factor * factor) as f32);
            }
        }
    }
    small
}

struct Canvas {
    width: u32,
    rgb: Vec<u8>,
}

impl Canvas {
    fn tile(&mut self, rgb: &[u8], width: u32, x: u32, y: u32) {
        for (row, line) in rgb.chunks_exact(3 * width as usize).enumerate() {
            let start = (((y + row as u32) * self.width + x) * 3) as usize;
            self.rgb[start..start + line.len()].copy_from_slice(line);
        }
    }

    fn text(&mut self, text: &str, x: u32, y: u32) {
        for (place, letter) in text.chars().enumerate() {
            let glyph = glyph(letter);
            for bit in (0..15).filter(|bit| glyph >> (14 - bit) & 1 == 1) {
                let left = x + (place as u32 * 4 + bit % 3) * SCALE;
                self.square(left, y + bit / 3 * SCALE);
            }
        }
    }

    fn square(&mut self, x: u32, y: u32) {
        for (dx, dy) in (0..SCALE).flat_map(|dy| (0..SCALE).map(move |dx| (dx, dy))) {
            let start = (((y + dy) * self.width + x + dx) * 3) as usize;
            self.rgb[start..start + 3].fill(224);
        }
    }
}

/// A letter as 5 rows of 3 bits, the upper left one first.
fn glyph(letter: char) -> u16 {
    match letter {
        '0' => 0b111_101_101_101_111,
        '1' => 0b010_110_010_010_111,
        '2' => 0b111_001_111_100_111,
        '3' => 0b111_001_111_001_111,
        '4' => 0b101_101_111_001_001,
        '5' => 0b111_100_111_001_111,
        '6' => 0b111_100_111_101_111,
        '7' => 0b111_001_001_001_001,
        '8' => 0b111_101_111_101_111,
        '9' => 0b111_101_111_001_111,
        's' => 0b011_100_010_001_110,
        't' => 0b010_111_010_010_011,
        '=' => 0b000_111_000_111_000,
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layer(index: u32) -> Option<Vec<f32>> {
        // max_edges = 2: six weighted layers, six unweighted ones; (0, 1) is never used.
        let black = [0, 1].contains(&(index % 6));
        (index < 12).then(|| vec![if black { 0.0 } else { index as f32 }; 2 * 2 * 3])
    }

    #[test]
    fn strategies_are_found_by_number() {
        let found = strategies(&layer);
        let pairs: Vec<_> = found.iter().map(|strategy| (strategy.s, strategy.t)).collect();
        assert_eq!(pairs, [(1, 0), (2, 0), (1, 1), (0, 2)]);
        assert_eq!((found[0].weighted[0], found[0].unweighted[0]), (2.0, 8.0));
        assert_eq!(found[3].layers()[1].0, "strategy.s0t2.unweighted");
    }

    #[test]
    fn a_pyramid_has_a_row_for_each_length() {
        let ([width, height], rgb) = draw(&strategies(&layer), [2, 2], 1.0, |strategy| &strategy.weighted);
        assert_eq!(rgb.len(), (width * height * 3) as usize);
        assert_eq!(height, 2 * (2 + LABEL + GAP) + GAP);
        assert_eq!(width, 3 * (label_width() + GAP) + GAP);
        assert!(rgb.contains(&255) && rgb.contains(&224) && rgb.contains(&24), "tiles, labels, background");
    }
}
