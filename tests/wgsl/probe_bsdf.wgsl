//! Probes of the scattering functions. The film is a table: every case has POLAR_BINS x AZIMUTH_BINS pixels, the cells of a grid on
//! the sphere about the case's axis.

import package::real::{real, vec2r, vec3r};
import package::outcome::DONE;
import package::film::splat;
import package::pass::{path_pixel, path_sample};
import package::random::{DIMENSION_CHOICE, DIMENSION_SCATTER, WALK_EYE, random4};
import package::math::constants::{INVERSE_TWO_PI, PI, TWO_PI};
import package::math::elementary::{arc_tangent2, cosine, power, sine};
import package::math::frame::{Frame, frame_of, to_local, to_world};
import package::sample::sphere::{sample_cone, sample_sphere};
import package::surface::surface::Surface;
import package::bsdf::dielectric::dielectric_half_vector;
import package::bsdf::bsdf::{Bsdf, BsdfSample, IMPORTANCE, RADIANCE, bsdf_at, eval_bsdf, reverse_pdf_bsdf, sample_bsdf};
import package::probe::bsdf_cases::{BsdfCase, bsdf_case};

const POLAR_BINS: u32 = 32u;
const AZIMUTH_BINS: u32 = 16u;
const BINS: u32 = 512u;
/// Cells of a bin along each side, one for each sample.
const CELLS: u32 = 32u;

/// What a path probes.
struct Probe {
    /// First pixel of the case.
    first: u32,
    given: BsdfCase,
    surface: Surface,
    bsdf: Bsdf,
    /// Unit, world.
    outgoing: vec3r,
    axis: Frame,
}

/// The surface of a case: a shading normal that is tilted from the geometric one.
fn probed_surface(tilt: real) -> Surface {
    var surface: Surface;
    surface.geometric_normal = vec3r(0.36, 0.48, 0.8);
    let frame = frame_of(surface.geometric_normal);
    surface.shading_normal = normalize(surface.geometric_normal + tilt * frame.bitangent);
    return surface;
}

fn probe_here() -> Probe {
    var probe: Probe;
    let index = path_pixel() / BINS;
    probe.first = index * BINS;
    probe.given = bsdf_case(index);
    probe.surface = probed_surface(probe.given.tilt);
    let frame = frame_of(probe.given.side * probe.surface.shading_normal);
    let height = probe.given.cosine;
    probe.outgoing = to_world(frame, vec3r(sqrt(1.0 - height * height), 0.0, height));
    probe.bsdf = bsdf_at(probe.surface, probe.given.material, probe.outgoing);
    probe.axis = frame_of(to_world(frame, probe.given.axis));
    return probe;
}

/// The bin of a direction is on the axis' side of the surface.
fn is_counted(probe: Probe, direction: vec3r) -> bool {
    return dot(direction, probe.bsdf.frame.normal) * probe.given.axis.z > 0.0;
}

/// Pixel of the bin that holds a direction.
fn bin_of(probe: Probe, direction: vec3r) -> u32 {
    let span = direction - probe.axis.normal;
    let polar = power(min(0.25 * dot(span, span), 1.0), 1.0 / probe.given.exponent);
    let local = to_local(probe.axis, direction);
    let azimuth = arc_tangent2(local.y, local.x) * INVERSE_TWO_PI + 0.5;
    let column = min(u32(polar * real(POLAR_BINS)), POLAR_BINS - 1u);
    let row = min(u32(azimuth * real(AZIMUTH_BINS)), AZIMUTH_BINS - 1u);
    return probe.first + row * POLAR_BINS + column;
}

/// Counts a sampled direction in its bin: 1, weight for radiance, weight for importance.
fn count_samples() -> u32 {
    let probe = probe_here();
    let random = random4(WALK_EYE, 1u, DIMENSION_SCATTER).xyz;
    let sample = sample_bsdf(probe.bsdf, probe.outgoing, random, RADIANCE);
    if sample.pdf > 0.0 && !sample.delta && is_counted(probe, sample.direction) {
        let importance = sample_bsdf(probe.bsdf, probe.outgoing, random, IMPORTANCE);
        splat(bin_of(probe, sample.direction), vec3r(1.0, sample.weight.y, importance.weight.y));
    }
    return DONE;
}

/// Counts a sample of a delta lobe like `count_samples`, in the case's first pixel if it leaves along the case's axis, in the second if it
/// leaves along the mirrored direction, else in the third.
fn count_deltas() -> u32 {
    let probe = probe_here();
    let random = random4(WALK_EYE, 1u, DIMENSION_SCATTER).xyz;
    let sample = sample_bsdf(probe.bsdf, probe.outgoing, random, RADIANCE);
    let importance = sample_bsdf(probe.bsdf, probe.outgoing, random, IMPORTANCE);
    let mirrored = 2.0 * dot(probe.outgoing, probe.bsdf.frame.normal) * probe.bsdf.frame.normal - probe.outgoing;
    var place = 2u;
    if sample.delta && length(sample.direction - probe.axis.normal) < 1e-5 {
        place = 0u;
    } else if sample.delta && length(sample.direction - mirrored) < 1e-5 {
        place = 1u;
    }
    splat(probe.first + place, vec3r(1.0, sample.weight.y, importance.weight.y));
    return DONE;
}

/// Integrates over the path's own bin: density, f |cos| for radiance, f |cos| for importance.
fn integrate_density() -> u32 {
    let probe = probe_here();
    let bin = path_pixel() - probe.first;
    let cell = path_sample() % (CELLS * CELLS);
    let jitter = random4(WALK_EYE, 1u, DIMENSION_SCATTER).xy;
    let place = (vec2r(vec2u(cell % CELLS, cell / CELLS)) + jitter) / real(CELLS);
    let polar = (real(bin % POLAR_BINS) + place.x) / real(POLAR_BINS);
    let azimuth = TWO_PI * ((real(bin / POLAR_BINS) + place.y) / real(AZIMUTH_BINS) - 0.5);
    let height = power(polar, probe.given.exponent);
    let radius = 2.0 * sqrt(max(height * (1.0 - height), 0.0));
    let direction = to_world(probe.axis, vec3r(radius * cosine(azimuth), radius * sine(azimuth), 1.0 - 2.0 * height));
    if is_counted(probe, direction) {
        let stretch = 4.0 * PI * probe.given.exponent * power(polar, probe.given.exponent - 1.0) / real(BINS);
        let radiance = eval_bsdf(probe.bsdf, probe.outgoing, direction, RADIANCE);
        let importance = eval_bsdf(probe.bsdf, probe.outgoing, direction, IMPORTANCE);
        splat(path_pixel(), stretch * vec3r(radiance.pdf, radiance.value.y, importance.value.y));
    }
    return DONE;
}

/// Counts the relative difference of two values that should be equal: column 0 below 1e-7, then a column a decade.
fn count_difference(first: u32, a: real, b: real) {
    let larger = max(abs(a), abs(b));
    if larger > 0.0 {
        let decade = floor(log2(f32(max(abs(a - b) / larger, 1e-12))) * 0.30102999566) + 8.0;
        splat(first + u32(clamp(decade, 0.0, 8.0)), vec3r(1.0));
    }
}

/// Rounded unit vectors fix f well: no grazing directions, no grazed or nearly totally reflecting microfacet.
fn is_well_conditioned(bsdf: Bsdf, a: vec3r, b: vec3r) -> bool {
    let local_a = to_local(bsdf.frame, a);
    let local_b = to_local(bsdf.frame, b);
    let cosine_a = dot(local_a, dielectric_half_vector(local_a, local_b, bsdf.eta));
    let cosine_b = dot(local_b, dielectric_half_vector(local_a, local_b, bsdf.eta));
    let critical = 1.0 - (1.0 - cosine_a * cosine_a) / (bsdf.eta * bsdf.eta);
    let least = min(min(abs(local_a.z), abs(local_b.z)), min(abs(cosine_a), abs(cosine_b)));
    return min(least, abs(critical)) > 0.2;
}

/// Compares scattering from a to b with scattering from b to a. Rows: f of reflection; f of transmission over the squared index of the
/// viewer's side; importance against radiance; the reverse density against the density.
fn compare_turned() -> u32 {
    let probe = probe_here();
    let random = random4(WALK_EYE, 1u, DIMENSION_SCATTER);
    let other = random4(WALK_EYE, 1u, DIMENSION_CHOICE);
    let a = to_world(frame_of(probe.given.side * probe.surface.shading_normal), sample_cone(random.xy, 0.0));
    let bsdf = bsdf_at(probe.surface, probe.given.material, a);
    var b = sample_sphere(other.xy);
    if random.z < 0.5 {
        let sample = sample_bsdf(bsdf, a, vec3r(other.xyz), RADIANCE);
        if !(sample.pdf > 0.0) || sample.delta {
            return DONE;
        }
        b = sample.direction;
    }
    if !is_well_conditioned(bsdf, a, b) {
        return DONE;
    }
    let turned = bsdf_at(probe.surface, probe.given.material, b);
    let ab = eval_bsdf(bsdf, a, b, RADIANCE);
    let ba = eval_bsdf(turned, b, a, RADIANCE);
    let normal = probe.surface.shading_normal;
    let same_side = dot(a, normal) * dot(b, normal) > 0.0;
    let f_ab = ab.value.y / abs(dot(b, normal));
    let f_ba = ba.value.y / abs(dot(a, normal));
    if same_side {
        count_difference(probe.first, f_ab, f_ba);
    } else if probe.given.material.solid {
        // f(a, b) n_b^2 = f(b, a) n_a^2, eta = n_b / n_a
        count_difference(probe.first + POLAR_BINS, f_ab * bsdf.eta * bsdf.eta, f_ba);
    } else {
        count_difference(probe.first + POLAR_BINS, f_ab, f_ba);
    }
    let importance = eval_bsdf(bsdf, a, b, IMPORTANCE);
    let geometric = probe.surface.geometric_normal;
    count_difference(probe.first + 2u * POLAR_BINS, importance.value.y * abs(dot(a, geometric)), ba.value.y * abs(dot(b, geometric)));
    count_difference(probe.first + 3u * POLAR_BINS, reverse_pdf_bsdf(bsdf, a, b), ba.pdf);
    return DONE;
}
