//! The bias of an image: how far its mean is from that of a reference, and how sure that is.

use super::Image;
use serde::{Deserialize, Serialize};

/// Half the width of a 95 % confidence interval, in standard errors.
const INTERVAL_95: f64 = 1.96;

/// The difference of two means over the reference's mean.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bias {
    /// Above 0 where the image is brighter.
    pub relative: f64,
    /// Half the width of its 95 % confidence interval; unknown without standard errors of both.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_width: Option<f64>,
}

impl Bias {
    /// Of an image of the reference's size; `None` where the reference is black. Noise is taken to be independent from pixel to pixel,
    /// and the same in all channels of one.
    pub fn of(image: &Image, reference: &Image) -> Option<Self> {
        let (own, expected) = (mean(&image.radiance), mean(&reference.radiance));
        let errors = image.standard_error.as_deref().zip(reference.standard_error.as_deref());
        let variance = errors.map(|(own, expected)| variance_of_mean(own) + variance_of_mean(expected));
        (expected > 0.0).then(|| Self {
            relative: (own - expected) / expected,
            half_width: variance.map(|variance| INTERVAL_95 * variance.sqrt() / expected),
        })
    }

    /// The part of it, without sign, that is beyond its interval: 0 where the interval holds 0 or is unknown.
    pub fn certain(&self) -> f64 {
        self.half_width.map_or(0.0, |half_width| (self.relative.abs() - half_width).max(0.0))
    }
}

fn mean(values: &[f32]) -> f64 {
    values.iter().map(|&value| f64::from(value)).sum::<f64>() / values.len().max(1) as f64
}

/// The variance of the mean over pixels and channels, from the standard errors of the values.
fn variance_of_mean(errors: &[f32]) -> f64 {
    let pixels = (errors.len() / 3).max(1) as f64;
    errors.chunks_exact(3).map(|pixel| mean(pixel).powi(2)).sum::<f64>() / pixels.powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(radiance: f32, error: f32) -> Image {
        Image {
            size: [2, 2],
            radiance: vec![radiance; 12],
            standard_error: Some(vec![error; 12]),
            fixed: None,
            settings: None,
        }
    }

    #[test]
    fn bias_and_its_interval_by_hand() {
        // Four pixels with an error of 0.4 each: the mean has 0.2. The reference is exact.
        let bias = Bias::of(&image(3.0, 0.4), &image(2.0, 0.0));
        let half_width = 1.96 * 0.2 / 2.0;
        assert!(bias.is_some_and(|bias| (bias.relative - 0.5).abs() < 1e-6));
        assert!(bias.and_then(|bias| bias.half_width).is_some_and(|found| (found - half_width).abs() < 1e-6));
        assert!(bias.is_some_and(|bias| (bias.certain() - (0.5 - half_width)).abs() < 1e-6));
    }

    #[test]
    fn noise_is_no_bias_and_black_has_none() {
        assert_eq!(Bias::of(&image(2.1, 1.0), &image(2.0, 1.0)).map(|bias| bias.certain()), Some(0.0));
        assert_eq!(Bias::of(&image(1.0, 0.0), &image(0.0, 0.0)), None);
    }
}
