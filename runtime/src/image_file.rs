//! EXR files: radiance, standard errors, the settings that made them, and what is needed to resume.

use crate::error::Error;
use crate::film::{Sums, Totals};
use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Encoding, FlatSamples, Layer, LayerAttributes, ReadChannels, ReadLayers,
    SmallVec, Text, WritableImage, read,
};
use std::path::{Path, PathBuf};

/// The attribute that holds the settings as TOML.
const ATTRIBUTE: &str = "pathloom";
const COLOURS: [&str; 3] = ["R", "G", "B"];

/// An image in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Linear radiance, three channels a pixel, row by row from the top.
    pub radiance: Vec<f32>,
    /// Its standard error.
    pub standard_error: Option<Vec<f32>>,
    /// Exact sums in units of 2^-24, of a fixed-point film.
    pub fixed: Option<Vec<i64>>,
    /// The settings that made it, as TOML.
    pub settings: Option<String>,
}

impl Image {
    /// Reads an EXR file with channels `R`, `G`, `B` and, where present, `sem.R`.. and `sum.R.low`...
    ///
    /// # Errors
    /// User input, when the file is missing, is no EXR or has no colour channels.
    pub fn load(path: &Path) -> Result<Self, Error> {
        let shown = path.display();
        let file = read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_file(path)
            .map_err(|error| Error::input(format!("cannot read `{shown}`: {error}")))?;
        let layer = &file.layer_data;
        let size = [layer.size.0 as u32, layer.size.1 as u32];
        let find = |name: &str| {
            let channels = &layer.channel_data.list;
            channels
                .iter()
                .find(|channel| channel.name.as_slice() == name.as_bytes())
                .map(|channel| &channel.sample_data)
        };
        let radiance = interleave(COLOURS.map(find))
            .ok_or_else(|| Error::input(format!("`{shown}` has no channels R, G and B")))?;
        let standard_error = interleave(["sem.R", "sem.G", "sem.B"].map(find));
        let fixed = fixed_sums(&find);
        let settings = layer.attributes.other.get(&Text::from(ATTRIBUTE)).and_then(text_of);
        Ok(Self { size, radiance, standard_error, fixed, settings })
    }

    /// Writes the image, to another name first so that a file is never half written.
    ///
    /// # Errors
    /// Failed, when the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), Error> {
        self.save_with_layers(path, &[])
    }

    /// `save` with further layers, three channels a pixel each: `NAME.R`, `NAME.G`, `NAME.B`.
    ///
    /// # Errors
    /// As `save`.
    pub fn save_with_layers(&self, path: &Path, layers: &[(String, Vec<f32>)]) -> Result<(), Error> {
        let mut channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = SmallVec::new();
        for (index, colour) in COLOURS.iter().enumerate() {
            channels.push(AnyChannel::new(*colour, FlatSamples::F32(plane(&self.radiance, index))));
            if let Some(errors) = &self.standard_error {
                channels
                    .push(AnyChannel::new(format!("sem.{colour}").as_str(), FlatSamples::F32(plane(errors, index))));
            }
            if let Some(sums) = &self.fixed {
                let half = |shift: u32| plane(sums, index).iter().map(|&sum| (sum >> shift) as u32).collect();
                channels.push(AnyChannel::new(format!("sum.{colour}.low").as_str(), FlatSamples::U32(half(0))));
                channels.push(AnyChannel::new(format!("sum.{colour}.high").as_str(), FlatSamples::U32(half(32))));
            }
        }
        for (name, pixels) in layers {
            for (index, colour) in COLOURS.iter().enumerate() {
                let samples = FlatSamples::F32(plane(pixels, index));
                channels.push(AnyChannel::new(format!("{name}.{colour}").as_str(), samples));
            }
        }
        let mut attributes = LayerAttributes::default();
        if let Some(settings) = &self.settings {
            let text = Text::from_slice_unchecked(settings.as_bytes());
            attributes.other.insert(Text::from(ATTRIBUTE), AttributeValue::Text(text));
        }
        let size = (self.size[0] as usize, self.size[1] as usize);
        let layer = Layer::new(size, attributes, Encoding::SMALL_LOSSLESS, AnyChannels::sort(channels));
        let image = exr::prelude::Image::from_layer(layer);
        replace(path, |temporary| image.write().to_file(temporary).map_err(|error| error.to_string()))
    }

    /// What is needed to continue: exact for a fixed-point film, rounded to f32 means otherwise.
    pub fn totals(&self, samples: u32, batches: u32) -> Totals {
        let sums = match &self.fixed {
            Some(units) => Sums::Fixed(units.clone()),
            None => Sums::Float(self.radiance.iter().map(|&mean| f64::from(mean) * f64::from(samples)).collect()),
        };
        let scale = f64::from(batches.saturating_sub(1)) * f64::from(samples);
        let spread = match &self.standard_error {
            Some(errors) => Some(errors.iter().map(|&error| (f64::from(error).powi(2) * scale) as f32).collect()),
            // One batch does not deviate from itself.
            None => (batches <= 1).then(|| vec![0.0; self.radiance.len()]),
        };
        Totals { samples, batches, sums, spread, shares: vec![1.0], tallied: None }
    }
}

/// Writes a file by way of a temporary one beside it.
///
/// # Errors
/// Failed, with the path and the reason.
pub fn replace(path: &Path, write: impl FnOnce(&Path) -> Result<(), String>) -> Result<(), Error> {
    let temporary = beside(path);
    let failed = |error: String| Error::failed(format!("cannot write `{}`: {error}", path.display()));
    let written = write(&temporary).and_then(|()| std::fs::rename(&temporary, path).map_err(|error| error.to_string()));
    written.map_err(|error| {
        // Nothing is lost if it stays behind, and the first error is the one to tell.
        drop(std::fs::remove_file(&temporary));
        failed(error)
    })
}

fn beside(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!(".{name}.{}.part", std::process::id()))
}

fn plane<T: Copy>(pixels: &[T], channel: usize) -> Vec<T> {
    pixels.iter().skip(channel).step_by(3).copied().collect()
}

fn interleave(channels: [Option<&FlatSamples>; 3]) -> Option<Vec<f32>> {
    let [red, green, blue] = channels;
    let planes = [red?, green?, blue?].map(|samples| samples.values_as_f32().collect::<Vec<_>>());
    Some((0..planes[0].len()).flat_map(|index| [planes[0][index], planes[1][index], planes[2][index]]).collect())
}

fn fixed_sums<'a>(find: &impl Fn(&str) -> Option<&'a FlatSamples>) -> Option<Vec<i64>> {
    let words = |name: String| match find(&name) {
        Some(FlatSamples::U32(values)) => Some(values),
        _ => None,
    };
    let mut planes = Vec::with_capacity(3);
    for colour in COLOURS {
        planes.push((words(format!("sum.{colour}.low"))?, words(format!("sum.{colour}.high"))?));
    }
    let sum =
        |pixel: usize, (low, high): &(&Vec<u32>, &Vec<u32>)| (i64::from(high[pixel]) << 32) | i64::from(low[pixel]);
    Some(
        (0..planes[0].0.len())
            .flat_map(|pixel| [sum(pixel, &planes[0]), sum(pixel, &planes[1]), sum(pixel, &planes[2])])
            .collect(),
    )
}

fn text_of(value: &AttributeValue) -> Option<String> {
    match value {
        AttributeValue::Text(text) => Some(String::from_utf8_lossy(text.as_slice()).into_owned()),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_survives_a_file() {
        let path = std::env::temp_dir().join(format!("pathloom-image-file-{}.exr", std::process::id()));
        let image = Image {
            size: [2, 1],
            radiance: vec![0.1, 0.2, 0.3, 4.0, 5.0, 6.0],
            standard_error: Some(vec![0.01; 6]),
            fixed: Some(vec![0, 1, i64::MAX, 1 << 40, 77, (1 << 33) + 5]),
            settings: Some("pipeline = \"pt\" # \u{e9}\u{4e2d}\n".to_owned()),
        };
        let saved = image.save(&path);
        let loaded = Image::load(&path);
        drop(std::fs::remove_file(&path));
        assert!(saved.is_ok());
        assert_eq!(loaded.ok(), Some(image));
    }

    #[test]
    fn standard_errors_survive_totals() {
        let (sums, spread) = (Sums::Float(vec![6.4; 3]), Some(vec![2.0; 3]));
        let totals = Totals { samples: 64, batches: 8, sums, spread, shares: vec![1.0], tallied: None };
        let image = Image {
            size: [1, 1],
            radiance: totals.mean(),
            standard_error: totals.standard_error(),
            fixed: None,
            settings: None,
        };
        let again = image.totals(64, 8);
        assert!(again.spread.is_some_and(|spread| spread.iter().all(|value| (value - 2.0).abs() < 1e-5)));
        assert!(again.sums.values().iter().all(|sum| (sum - 6.4).abs() < 1e-6));
    }
}
