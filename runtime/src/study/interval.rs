//! Means with their confidence intervals, and when repetitions suffice.

use serde::de::{self, MapAccess, Visitor, value::MapAccessDeserializer};
use serde::{Deserialize, Deserializer};
use std::fmt;

/// Quantiles of Student's t distribution at 97.5 %, by degrees of freedom from 1.
const STUDENT_T: [f64; 10] = [12.7062, 4.3027, 3.1824, 2.7764, 2.5706, 2.4469, 2.3646, 2.3060, 2.2622, 2.2281];
/// The same quantile of the normal distribution.
const NORMAL: f64 = 1.959_964;

/// A mean and half the width of its 95 % confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// The mean.
    pub mean: f64,
    /// Half the width; `None` of a single value.
    pub half_width: Option<f64>,
}

impl Interval {
    /// Of independent values with normal errors; `None` without values.
    pub fn of(values: &[f64]) -> Option<Self> {
        let count = values.len() as f64;
        if values.is_empty() {
            return None;
        }
        let mean = values.iter().sum::<f64>() / count;
        let square: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
        let half_width =
            (values.len() > 1).then(|| student_t(values.len() - 1) * (square / (count - 1.0) / count).sqrt());
        Some(Self { mean, half_width })
    }

    /// Half the width over the mean; infinite of a single value.
    pub fn relative(&self) -> f64 {
        match self.half_width {
            Some(0.0) => 0.0,
            Some(half_width) => half_width / self.mean.abs(),
            None => f64::INFINITY,
        }
    }
}

/// The 97.5 % quantile of Student's t distribution: from a table, and beyond it by the expansion in the inverse of the degrees of
/// freedom (Abramowitz and Stegun 26.7.5), which is off by less than 0.2 % there.
fn student_t(freedom: usize) -> f64 {
    if let Some(&quantile) = STUDENT_T.get(freedom.wrapping_sub(1)) {
        return quantile;
    }
    let inverse = 1.0 / freedom as f64;
    let (z, z3, z5) = (NORMAL, NORMAL.powi(3), NORMAL.powi(5));
    z + inverse * (z3 + z) / 4.0 + inverse.powi(2) * (5.0 * z5 + 16.0 * z3 + 3.0 * z) / 96.0
}

/// How often everything is rendered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Repeat {
    /// As often in any case.
    pub at_least: u32,
    /// No more often.
    pub at_most: u32,
    /// In between, until half the width of the confidence interval of the time is this part of it.
    pub within: f64,
}

/// The table form of it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Bounds {
    at_least: u32,
    at_most: u32,
    within: f64,
}

impl Default for Repeat {
    fn default() -> Self {
        Self::times(1)
    }
}

impl Repeat {
    /// A fixed number of times.
    fn times(count: u32) -> Self {
        Self { at_least: count, at_most: count, within: f64::INFINITY }
    }

    /// Whether another run is wanted after those that took these times.
    pub fn wants_more(&self, times: &[f64]) -> bool {
        let count = times.len() as u32;
        count < self.at_least
            || count < self.at_most && Interval::of(times).is_none_or(|interval| interval.relative() > self.within)
    }
}

impl<'de> Deserialize<'de> for Repeat {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(RepeatVisitor)
    }
}

/// Takes a number or a table.
struct RepeatVisitor;

impl<'de> Visitor<'de> for RepeatVisitor {
    type Value = Repeat;

    fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str("a number of repetitions, or `{ at_least = 3, at_most = 20, within = 0.02 }`")
    }

    fn visit_i64<E: de::Error>(self, count: i64) -> Result<Repeat, E> {
        match u32::try_from(count) {
            Ok(count @ 1..) => Ok(Repeat::times(count)),
            _ => Err(E::custom(format!("`repeat = {count}`: it must be at least 1"))),
        }
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Repeat, A::Error> {
        let Bounds { at_least, at_most, within } = Bounds::deserialize(MapAccessDeserializer::new(map))?;
        if at_least < 2 {
            return Err(de::Error::custom(format!(
                "`at_least = {at_least}`: an interval needs at least 2 repetitions"
            )));
        }
        if at_most < at_least {
            return Err(de::Error::custom(format!("`at_most = {at_most}` is less than `at_least = {at_least}`")));
        }
        if !(within > 0.0 && within < 1.0) {
            return Err(de::Error::custom(format!(
                "`within = {within}`: a part of the time, more than 0 and less than 1, such as 0.02"
            )));
        }
        Ok(Repeat { at_least, at_most, within })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (freedom, expected) in [(1, 12.706), (4, 2.776), (10, 2.228), (11, 2.201), (20, 2.086), (60, 2.000)] {
            assert!((student_t(freedom) / expected - 1.0).abs() < 2e-3, "{freedom}: {}", student_t(freedom));
        }
    }

    #[test]
    fn intervals_of_known_values() {
        let interval = Interval::of(&[1.0, 2.0, 3.0]).map(|interval| (interval.mean, interval.half_width));
        // The standard deviation is 1, so the standard error is 1 / sqrt(3).
        let half_width = 4.3027 / 3.0_f64.sqrt();
        assert!(
            interval
                .is_some_and(|(mean, half)| mean == 2.0 && half.is_some_and(|half| (half - half_width).abs() < 1e-9))
        );
        assert_eq!(Interval::of(&[5.0]), Some(Interval { mean: 5.0, half_width: None }));
        assert_eq!(Interval::of(&[]), None);
        assert_eq!(Interval::of(&[7.0, 7.0]).map(|interval| interval.relative()), Some(0.0));
    }

    /// The interval holds the true mean 95 times in 100.
    #[test]
    fn intervals_cover_the_mean_as_often_as_they_say() {
        let mut state = 1_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        // A sum of 12 uniform numbers is normal enough, with mean 6.
        let mut times = |count: usize| -> Vec<f64> { (0..count).map(|_| (0..12).map(|_| uniform()).sum()).collect() };
        let trials = 4000;
        let covered = (0..trials)
            .filter_map(|_| Interval::of(&times(5)))
            .filter(|interval| interval.half_width.is_some_and(|half| (interval.mean - 6.0).abs() <= half));
        let part = covered.count() as f64 / f64::from(trials);
        assert!((part - 0.95).abs() < 0.015, "{part}");
    }

    #[test]
    fn repetitions_end_when_the_interval_is_small_enough() {
        let rule = Repeat { at_least: 3, at_most: 6, within: 0.02 };
        assert!(rule.wants_more(&[]) && rule.wants_more(&[1.0, 1.0]), "too few for a verdict");
        assert!(!rule.wants_more(&[1.0, 1.001, 0.999]), "precise enough");
        let wide = [1.0, 1.5, 0.7, 1.2, 0.9, 1.1];
        assert!(rule.wants_more(&wide[..3]) && rule.wants_more(&wide[..5]), "not precise");
        assert!(!rule.wants_more(&wide), "often enough in any case");
        assert!(Repeat::times(2).wants_more(&[1.0]) && !Repeat::times(2).wants_more(&[1.0, 9.0]));
    }

    #[derive(Debug, Deserialize)]
    struct File {
        repeat: Repeat,
    }

    #[test]
    fn a_number_or_a_table() {
        let read = |text: &str| toml::from_str::<File>(text).map(|file| file.repeat).map_err(|error| error.to_string());
        assert_eq!(read("repeat = 3"), Ok(Repeat::times(3)));
        let bounds = Repeat { at_least: 3, at_most: 20, within: 0.02 };
        assert_eq!(read("repeat = { at_least = 3, at_most = 20, within = 0.02 }"), Ok(bounds));
        for (text, word) in [
            ("repeat = 0", "at least 1"),
            ("repeat = \"often\"", "a number of repetitions"),
            ("repeat = { at_least = 1, at_most = 2, within = 0.1 }", "at least 2 repetitions"),
            ("repeat = { at_least = 3, at_most = 2, within = 0.1 }", "less than `at_least = 3`"),
            ("repeat = { at_least = 3, at_most = 5, within = 2.0 }", "less than 1"),
            ("repeat = { at_least = 3, at_most = 5, withn = 0.1 }", "unknown field `withn`"),
        ] {
            assert!(read(text).is_err_and(|error| error.contains(word)), "{text}");
        }
    }
}
