//! Everything that emits, with the probability of being picked: in proportion to its power.

use super::alias;
use super::emission::Emission;
use super::node::Placed;
use super::sky::{Sky, luminance};
use super::triangle::Triangle;
use crate::error::{Error, Result};
use glam::DVec3;
use gltf::khr_lights_punctual::{Kind, Light as PunctualLight};
use std::f64::consts::PI;

/// What a light is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// An emissive triangle.
    Triangle {
        /// Its index in document order.
        triangle: u32,
        /// m2.
        area: f64,
    },
    /// Radiates from a point.
    Point {
        /// World.
        position: DVec3,
    },
    /// Radiates from a point into a cone.
    Spot {
        /// World.
        position: DVec3,
        /// Axis of the cone, unit.
        direction: DVec3,
        /// Cosine of the half angle inside which the intensity is full.
        cos_inner: f64,
        /// Cosine of the half angle outside which it is zero.
        cos_outer: f64,
    },
    /// Shines from infinitely far away.
    Directional {
        /// Where the light travels to, unit.
        direction: DVec3,
    },
    /// The sky.
    Sky,
}

/// A light.
#[derive(Clone, Debug)]
pub struct Light {
    /// What it is.
    pub shape: Shape,
    /// W/sr (point, spot), W/m2 (directional), linear RGB; zero for the others, whose emission lies elsewhere.
    pub intensity: [f32; 3],
    /// Luminous measure that the pick probability is in proportion to, W.
    pub power: f64,
    /// Name in the file; empty for triangles.
    pub name: String,
}

/// The lights of a scene with their distribution.
#[derive(Default)]
pub struct Lights {
    /// Triangles in document order, punctual lights in document order, the sky last.
    pub list: Vec<Light>,
    /// Adds up to one.
    pub probabilities: Vec<f64>,
}

/// Collects all lights that give any light into a scene with the given bounding radius.
///
/// # Errors
/// Punctual lights whose numbers are not finite or whose cone angles are out of order.
pub fn collect(
    triangles: &[Triangle],
    emission: &Emission<'_>,
    punctual: &[Placed<PunctualLight<'_>>],
    moved_by: DVec3,
    sky: Option<&Sky>,
    radius: f64,
    warnings: &mut Vec<String>,
) -> Result<Lights> {
    let mut list: Vec<Light> =
        triangles.iter().enumerate().filter_map(|(index, triangle)| area_light(index, triangle, emission)).collect();
    for light in punctual {
        let placed = punctual_light(light, moved_by, radius, warnings)
            .map_err(|error| error.at(format!("light `{}`", light.name)))?;
        list.extend(placed);
    }
    let disc = PI * radius * radius;
    list.extend(sky.map(|sky| Light {
        shape: Shape::Sky,
        intensity: [0.0; 3],
        power: sky.integral * disc,
        name: "sky".into(),
    }));
    list.retain(|light| light.power > 0.0);
    let probabilities = alias::probabilities(&list.iter().map(|light| light.power).collect::<Vec<_>>());
    Ok(Lights { list, probabilities })
}

fn area_light(index: usize, triangle: &Triangle, emission: &Emission<'_>) -> Option<Light> {
    let power = emission.power(triangle);
    let shape = Shape::Triangle { triangle: index as u32, area: triangle.area() };
    (power > 0.0).then(|| Light { shape, intensity: [0.0; 3], power, name: String::new() })
}

fn punctual_light(
    light: &Placed<PunctualLight<'_>>,
    moved_by: DVec3,
    radius: f64,
    warnings: &mut Vec<String>,
) -> Result<Option<Light>> {
    let intensity = light.item.color().map(|c| c * light.item.intensity());
    if !intensity.iter().all(|c| c.is_finite() && *c >= 0.0) {
        return Err(Error::input(format!("color x intensity is {intensity:?}")).help("finite and not negative"));
    }
    let position = light.matrix.w_axis.truncate() - moved_by;
    let direction = (-light.matrix.z_axis.truncate()).try_normalize();
    if direction.is_none() && !matches!(light.item.kind(), Kind::Point) {
        warnings
            .push(format!("light `{}` has no direction (its node is scaled to nothing) and is left out", light.name));
        return Ok(None);
    }
    let direction = direction.unwrap_or(DVec3::NEG_Z);
    let luminance = luminance(intensity);
    let (shape, power) = match light.item.kind() {
        Kind::Point => (Shape::Point { position }, 4.0 * PI * luminance),
        Kind::Directional => (Shape::Directional { direction }, PI * radius * radius * luminance),
        Kind::Spot { inner_cone_angle, outer_cone_angle } => {
            let (cos_inner, cos_outer) = cone(inner_cone_angle, outer_cone_angle)?;
            // The falloff of the extension, squared and linear in the cosine, integrates to a third of the rim.
            let solid_angle = 2.0 * PI * ((1.0 - cos_inner) + (cos_inner - cos_outer) / 3.0);
            (Shape::Spot { position, direction, cos_inner, cos_outer }, solid_angle * luminance)
        }
    };
    Ok(Some(Light { shape, intensity, power, name: light.name.clone() }))
}

/// Cosines of the inner and outer half angle, apart by what the kernels can divide by.
fn cone(inner: f32, outer: f32) -> Result<(f64, f64)> {
    const LEAST_RIM: f64 = 1e-5;
    let (inner, outer) = (f64::from(inner), f64::from(outer));
    let ordered = (0.0..=outer).contains(&inner) && outer > 0.0 && outer <= PI / 2.0 + 1e-6;
    if !ordered {
        let message = format!("innerConeAngle is {inner}, outerConeAngle {outer}");
        return Err(Error::input(message).help("0 <= inner <= outer <= pi/2, outer > 0"));
    }
    let cos_outer = outer.cos().clamp(0.0, 1.0 - LEAST_RIM);
    Ok((inner.cos().max(cos_outer + LEAST_RIM), cos_outer))
}

impl Lights {
    /// Index of the sky among the lights.
    pub fn sky_index(&self) -> Option<usize> {
        self.list.iter().position(|light| light.shape == Shape::Sky)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cones_are_checked_and_never_empty() {
        assert!(cone(0.5, 0.4).is_err());
        assert!(cone(0.0, 2.0).is_err());
        assert!(cone(f32::NAN, 1.0).is_err());
        let (inner, outer) = cone(0.5, 0.5).unwrap();
        assert!(inner > outer);
        assert!(cone(0.0, std::f32::consts::FRAC_PI_2).is_ok());
    }
}
