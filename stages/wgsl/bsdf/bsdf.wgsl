//! The scattering function of a surface: a sum of a diffuse lobe, one opaque reflection lobe (dielectric coat and metal
//! share it) and one glass lobe (reflection and transmission). Delta lobes are sampled, never evaluated.

import package::real::{real, vec3r};
import package::features::{HAS_DELTA, HAS_DELTA_SPECULAR, HAS_DELTA_TRANSMISSION, HAS_DIFFUSE, HAS_METAL, HAS_NORMAL_MAP, HAS_ROUGH_SPECULAR, HAS_ROUGH_TRANSMISSION, HAS_SHADING_NORMALS, HAS_SOLID_GLASS, HAS_SPECULAR, HAS_THIN_GLASS, HAS_TRANSMISSION};
import package::params::{refraction_adjoint, shading_normal_adjoint};
import package::stored::{stored_importance_direction, stored_radiance_direction};
import package::math::frame::{Frame, frame_of, to_local, to_world};
import package::math::vector::max_component;
import package::sample::hemisphere::{pdf_cosine_hemisphere, sample_cosine_hemisphere};
import package::surface::surface::Surface;
import package::surface::material::Material;
import package::bsdf::fresnel::{fresnel_dielectric, fresnel_schlick};
import package::bsdf::ggx::{ggx_reflection, pdf_ggx_reflection, sample_visible_normal};
import package::bsdf::lambert::{coat_transmittance, coated_diffuse, lambert};
import package::bsdf::dielectric::{GlassLobe, refract_smooth, rough_dielectric, sample_rough_dielectric};
import package::bsdf::thin::{rough_thin, sample_rough_thin, thin_reflectance};

/// What is transported against the direction of the walk: radiance by eye walks, importance by light walks.
const RADIANCE: u32 = 0u;
const IMPORTANCE: u32 = 1u;

/// GGX alpha below which a lobe is a delta.
const SMOOTH_ALPHA: real = 1e-4;
/// Relative index below which refraction bends nothing and rough glass degenerates to a delta.
const SMOOTH_IOR: real = 1.001;
/// Cosines below it do not scatter, on eye and light walks alike.
const GRAZING_COSINE: real = 1e-6;
/// Smallest selection probability of a lobe that can contribute, before normalisation.
const LOBE_FLOOR: real = 0.05;

/// Scattering at a surface, seen from the outgoing direction it was made for (towards where the walk came from).
struct Bsdf {
    /// Shading frame; its normal lies on the outgoing side of the surface.
    frame: Frame,
    /// Geometric normal, unit, on the outgoing side.
    facing_normal: vec3r,
    /// Albedo of the diffuse lobe below its coat.
    diffuse: vec3r,
    /// Schlick reflectance of the dielectric coat above the diffuse lobe: greatest channel at normal incidence, and grazing.
    coat_f0: real,
    coat_f90: real,
    /// Schlick reflectance of the opaque reflection lobe, lobe weight included.
    specular_f0: vec3r,
    specular_f90: real,
    /// GGX roughness of all lobes but the diffuse.
    alpha: real,
    /// Share of the glass lobe in [0,1], and its colour per crossing.
    glass: real,
    tint: vec3r,
    /// Index of the glass, and index of the far side over that of the outgoing side.
    ior: real,
    eta: real,
    /// A closed volume, else a thin sheet.
    solid: bool,
}

/// A sampled direction. `pdf` = 0: nothing scatters, the walk ends.
struct BsdfSample {
    /// Unit, world, away from the surface.
    direction: vec3r,
    /// f |cos| / pdf, dimensionless; `scattering_cosine` tells which cosine.
    weight: vec3r,
    /// Per sr with all lobes and their selection probabilities; of a delta lobe the selection probability.
    pdf: real,
    delta: bool,
    /// Through the surface.
    transmitted: bool,
    /// Drawn by the diffuse lobe.
    diffuse: bool,
}

/// Non-delta scattering between two directions.
struct BsdfValue {
    /// f |cos|, per sr.
    value: vec3r,
    /// Density with which `sample_bsdf` draws the incoming direction by its non-delta lobes, per sr.
    pdf: real,
}

/// Value f and density of the non-delta lobes in local directions, per sr.
struct LobeSum {
    f: vec3r,
    pdf: real,
}

/// Probabilities of selecting the lobes, sum 1 (0 if nothing scatters).
struct LobeProbability {
    diffuse: real,
    specular: real,
    glass: real,
}

/// The scattering of `material` at `surface` for a walk that came from `outgoing` (unit). glTF 2.0 appendix B with
/// KHR_materials_ior, _specular, _transmission, _volume:
/// metallic * metal + (1 - metallic) * ((1 - transmission) * coated diffuse + transmission * glass).
fn bsdf_at(surface: Surface, material: Material, outgoing: vec3r) -> Bsdf {
    let side = select(real(-1.0), real(1.0), dot(outgoing, surface.geometric_normal) >= 0.0);
    var bsdf: Bsdf;
    bsdf.frame = frame_of(side * surface.shading_normal);
    if HAS_SHADING_NORMALS || HAS_NORMAL_MAP {
        bsdf.facing_normal = side * surface.geometric_normal;
    }
    bsdf.diffuse = material.base_color;
    if HAS_SPECULAR || HAS_TRANSMISSION {
        bsdf.alpha = material.roughness * material.roughness;
        add_opaque_lobes(&bsdf, material);
    }
    if HAS_TRANSMISSION {
        add_glass_lobe(&bsdf, material, side);
    }
    return bsdf;
}

/// Sets the diffuse and the opaque reflection lobe. A coat's F0 is ((ior-1)/(ior+1))^2 * colour * factor, its F90 the
/// factor (KHR_materials_specular); a metal's F0 is the base colour, its F90 one.
fn add_opaque_lobes(bsdf: ptr<function, Bsdf>, material: Material) {
    var share = real(1.0);
    if HAS_METAL {
        share *= 1.0 - material.metallic;
    }
    if HAS_TRANSMISSION {
        share *= 1.0 - material.transmission;
    }
    bsdf.diffuse = share * material.base_color;
    if HAS_SPECULAR {
        let ratio = (material.ior - 1.0) / (material.ior + 1.0);
        let coat_f0 = min(ratio * ratio * material.specular_color, vec3r(1.0)) * material.specular;
        bsdf.coat_f0 = max_component(coat_f0);
        bsdf.coat_f90 = material.specular;
        bsdf.specular_f0 = share * coat_f0;
        bsdf.specular_f90 = share * material.specular;
        if HAS_METAL {
            bsdf.specular_f0 += material.metallic * material.base_color;
            bsdf.specular_f90 += material.metallic;
        }
    }
}

/// Sets the glass lobe; `side` is 1 when the outgoing direction is on the front of the surface, else -1.
fn add_glass_lobe(bsdf: ptr<function, Bsdf>, material: Material, side: real) {
    bsdf.glass = material.transmission;
    if HAS_METAL {
        bsdf.glass *= 1.0 - material.metallic;
    }
    bsdf.tint = material.base_color;
    bsdf.ior = max(material.ior, 1.0);
    bsdf.eta = select(1.0 / bsdf.ior, bsdf.ior, side > 0.0);
    bsdf.solid = material.solid;
}

/// The opaque reflection lobe is a delta.
fn specular_is_delta(bsdf: Bsdf) -> bool {
    return bsdf.alpha < SMOOTH_ALPHA;
}

/// The glass lobe is a delta: smooth, or a solid that does not refract.
fn glass_is_delta(bsdf: Bsdf) -> bool {
    return bsdf.alpha < SMOOTH_ALPHA || (bsdf.solid && bsdf.ior < SMOOTH_IOR);
}

/// Some lobe is not a delta, so that connections to the vertex can contribute.
fn is_connectable(bsdf: Bsdf) -> bool {
    var connectable = false;
    if HAS_DIFFUSE {
        connectable = max_component(bsdf.diffuse) > 0.0;
    }
    if HAS_ROUGH_SPECULAR {
        connectable = connectable || (bsdf.specular_f90 > 0.0 && !specular_is_delta(bsdf));
    }
    if HAS_ROUGH_TRANSMISSION {
        connectable = connectable || (bsdf.glass > 0.0 && !glass_is_delta(bsdf));
    }
    return connectable;
}

/// Non-delta scattering of light between `outgoing`, the direction the Bsdf was made for, and `incoming` (both unit,
/// away from the surface). Zero where the hemispheres of the shading and the geometric normal disagree.
fn eval_bsdf(bsdf: Bsdf, outgoing: vec3r, incoming: vec3r, mode: u32) -> BsdfValue {
    var result: BsdfValue;
    if !hemispheres_agree(bsdf, outgoing, incoming) {
        return result;
    }
    let local_outgoing = to_local(bsdf.frame, outgoing);
    let local_incoming = to_local(bsdf.frame, incoming);
    let lobes = sum_lobes(bsdf, local_outgoing, local_incoming);
    result.value = lobes.f * scattering_cosine(bsdf, outgoing, incoming, mode);
    if HAS_ROUGH_TRANSMISSION && HAS_SOLID_GLASS && refraction_adjoint && mode == IMPORTANCE && local_incoming.z < 0.0 && bsdf.solid {
        // f*(o,i) = f(i,o): Walter et al. 2007, eq. 21 has the index of the viewer's side in its numerator.
        result.value *= bsdf.eta * bsdf.eta;
    }
    result.pdf = lobes.pdf;
    return result;
}

/// Density, per sr, with which the non-delta lobes would draw `outgoing` if the walk came from `incoming`.
fn reverse_pdf_bsdf(bsdf: Bsdf, outgoing: vec3r, incoming: vec3r) -> real {
    if !hemispheres_agree(bsdf, outgoing, incoming) {
        return 0.0;
    }
    var turned = bsdf;
    var local_outgoing = to_local(bsdf.frame, outgoing);
    var local_incoming = to_local(bsdf.frame, incoming);
    if HAS_TRANSMISSION && local_incoming.z < 0.0 {
        // Seen from the other side the frame points the other way.
        turned.eta = 1.0 / bsdf.eta;
        local_outgoing.z = -local_outgoing.z;
        local_incoming.z = -local_incoming.z;
    }
    return sum_lobes(turned, local_incoming, local_outgoing).pdf;
}

/// The density of a sampled event in reverse: from `sample.direction` to `outgoing`, per sr; of a delta lobe the selection probability.
fn reverse_pdf_of_sample(bsdf: Bsdf, outgoing: vec3r, sample: BsdfSample) -> real {
    if HAS_DELTA {
        if sample.delta {
            return reverse_delta_pdf(bsdf, outgoing, sample);
        }
    }
    return reverse_pdf_bsdf(bsdf, outgoing, sample.direction);
}

/// Probability of selecting the delta lobe that drew `sample` when the walk comes the other way. A mirror and a thin sheet have
/// equal cosines on both ways; of an interface the reflectance is the same from both sides, but other lobes weigh differently.
fn reverse_delta_pdf(bsdf: Bsdf, outgoing: vec3r, sample: BsdfSample) -> real {
    if HAS_SOLID_GLASS && sample.transmitted {
        let cosine = dot(outgoing, bsdf.frame.normal);
        let far_cosine = abs(dot(sample.direction, bsdf.frame.normal));
        return sample.pdf * lobe_probability(bsdf, far_cosine).glass / lobe_probability(bsdf, cosine).glass;
    }
    return sample.pdf;
}

/// Draws the direction in which the walk goes on. `random`: xy direction, z lobe, each in [0,1).
fn sample_bsdf(bsdf: Bsdf, outgoing: vec3r, random: vec3r, mode: u32) -> BsdfSample {
    if HAS_SPECULAR || HAS_TRANSMISSION {
        return sample_lobe(bsdf, outgoing, random, mode);
    }
    return direction_sample(bsdf, outgoing, sample_cosine_hemisphere(random.xy), true, mode);
}

/// `sample_bsdf` where there is more than a diffuse lobe: selects a lobe by its probability, then a direction by the lobe.
fn sample_lobe(bsdf: Bsdf, outgoing: vec3r, random: vec3r, mode: u32) -> BsdfSample {
    let local_outgoing = to_local(bsdf.frame, outgoing);
    if local_outgoing.z < GRAZING_COSINE {
        var absorbed: BsdfSample;
        return absorbed;
    }
    let probability = lobe_probability(bsdf, local_outgoing.z);
    var local_incoming = vec3r(0.0);
    var diffuse = false;
    if HAS_SPECULAR && random.z < probability.specular {
        if HAS_DELTA_SPECULAR && specular_is_delta(bsdf) {
            return sample_mirror(bsdf, outgoing, probability.specular, mode);
        }
        if HAS_ROUGH_SPECULAR {
            local_incoming = sample_rough_specular(bsdf, local_outgoing, random);
        }
    } else if HAS_TRANSMISSION && random.z >= 1.0 - probability.glass {
        let choice = (random.z - (1.0 - probability.glass)) / probability.glass;
        if HAS_DELTA_TRANSMISSION && glass_is_delta(bsdf) {
            return sample_delta_glass(bsdf, outgoing, choice, probability.glass, mode);
        }
        if HAS_ROUGH_TRANSMISSION {
            local_incoming = sample_rough_glass(bsdf, local_outgoing, random, choice);
        }
    } else {
        local_incoming = sample_cosine_hemisphere(random.xy);
        diffuse = true;
    }
    return direction_sample(bsdf, outgoing, local_incoming, diffuse, mode);
}

/// Completes a non-delta sample: the weight counts all lobes, whichever drew the direction. Zero: absorbed.
fn direction_sample(bsdf: Bsdf, outgoing: vec3r, local_incoming: vec3r, diffuse: bool, mode: u32) -> BsdfSample {
    var sample: BsdfSample;
    sample.diffuse = diffuse;
    sample.direction = stored_direction(to_world(bsdf.frame, local_incoming), mode);
    let scattered = eval_bsdf(bsdf, outgoing, sample.direction, mode);
    if scattered.pdf > 0.0 {
        sample.weight = scattered.value / scattered.pdf;
        sample.pdf = scattered.pdf;
        if HAS_TRANSMISSION {
            sample.transmitted = dot(sample.direction, bsdf.frame.normal) < 0.0;
        }
    }
    return sample;
}

/// Selection probabilities of the lobes for a walk whose outgoing direction has this shading cosine.
fn lobe_probability(bsdf: Bsdf, cosine: real) -> LobeProbability {
    var weight: LobeProbability;
    var total = real(0.0);
    if HAS_DIFFUSE {
        weight.diffuse = max_component(bsdf.diffuse);
        if HAS_SPECULAR {
            weight.diffuse *= coat_transmittance(bsdf.coat_f0, bsdf.coat_f90, cosine);
        }
        total += weight.diffuse;
    }
    if HAS_SPECULAR {
        weight.specular = max_component(fresnel_schlick(bsdf.specular_f0, bsdf.specular_f90, cosine));
        total += weight.specular;
    }
    if HAS_TRANSMISSION {
        weight.glass = bsdf.glass;
        total += weight.glass;
    }
    let least = LOBE_FLOOR * total;
    var raised = real(0.0);
    if HAS_DIFFUSE {
        weight.diffuse = select(real(0.0), max(weight.diffuse, least), max_component(bsdf.diffuse) > 0.0);
        raised += weight.diffuse;
    }
    if HAS_SPECULAR {
        weight.specular = select(real(0.0), max(weight.specular, least), bsdf.specular_f90 > 0.0);
        raised += weight.specular;
    }
    if HAS_TRANSMISSION {
        weight.glass = select(real(0.0), max(weight.glass, least), bsdf.glass > 0.0);
        raised += weight.glass;
    }
    let scale = 1.0 / max(raised, 1e-20);
    if HAS_DIFFUSE {
        weight.diffuse *= scale;
    }
    if HAS_SPECULAR {
        weight.specular *= scale;
    }
    if HAS_TRANSMISSION {
        weight.glass *= scale;
    }
    return weight;
}

/// All non-delta lobes at two local directions, `outgoing` above the surface.
fn sum_lobes(bsdf: Bsdf, outgoing: vec3r, incoming: vec3r) -> LobeSum {
    if HAS_SPECULAR || HAS_TRANSMISSION {
        return sum_mixed_lobes(bsdf, outgoing, incoming);
    }
    var sum: LobeSum;
    if HAS_DIFFUSE && incoming.z > 0.0 {
        sum.f = lambert(bsdf.diffuse);
        sum.pdf = pdf_cosine_hemisphere(incoming.z);
    }
    return sum;
}

/// `sum_lobes` where there is more than a diffuse lobe: densities weighted by the lobes' probabilities.
fn sum_mixed_lobes(bsdf: Bsdf, outgoing: vec3r, incoming: vec3r) -> LobeSum {
    var sum: LobeSum;
    let probability = lobe_probability(bsdf, outgoing.z);
    if HAS_DIFFUSE && incoming.z > 0.0 {
        sum.f = lambert(bsdf.diffuse);
        if HAS_SPECULAR {
            sum.f = coated_diffuse(bsdf.diffuse, bsdf.coat_f0, bsdf.coat_f90, outgoing.z, incoming.z);
        }
        sum.pdf = probability.diffuse * pdf_cosine_hemisphere(incoming.z);
    }
    if HAS_ROUGH_SPECULAR && incoming.z > 0.0 && !specular_is_delta(bsdf) {
        let half_vector = normalize(outgoing + incoming);
        let fresnel = fresnel_schlick(bsdf.specular_f0, bsdf.specular_f90, dot(outgoing, half_vector));
        sum.f += fresnel * ggx_reflection(outgoing, incoming, half_vector, bsdf.alpha);
        sum.pdf += probability.specular * pdf_ggx_reflection(outgoing, half_vector, bsdf.alpha);
    }
    if HAS_ROUGH_TRANSMISSION && bsdf.glass > 0.0 && !glass_is_delta(bsdf) {
        let lobe = rough_glass(bsdf, outgoing, incoming);
        let colour = select(vec3r(1.0), bsdf.tint, incoming.z < 0.0);
        sum.f += bsdf.glass * lobe.f * colour;
        sum.pdf += probability.glass * lobe.pdf;
    }
    return sum;
}

/// The rough glass lobe of a solid or a thin sheet at two local directions, without colour and share.
fn rough_glass(bsdf: Bsdf, outgoing: vec3r, incoming: vec3r) -> GlassLobe {
    if HAS_SOLID_GLASS && bsdf.solid {
        return rough_dielectric(outgoing, incoming, bsdf.alpha, bsdf.eta);
    }
    if HAS_THIN_GLASS {
        return rough_thin(outgoing, incoming, bsdf.alpha, bsdf.ior);
    }
    return GlassLobe(0.0, 0.0);
}

/// Local direction of the rough opaque reflection lobe, zero when the microfacet sends it below the surface.
fn sample_rough_specular(bsdf: Bsdf, outgoing: vec3r, random: vec3r) -> vec3r {
    let half_vector = sample_visible_normal(outgoing, bsdf.alpha, random.xy);
    let incoming = 2.0 * dot(outgoing, half_vector) * half_vector - outgoing;
    return select(vec3r(0.0), incoming, incoming.z > 0.0);
}

/// Local direction of the rough glass lobe, zero where it fails. `choice` in [0,1) decides reflection or transmission.
fn sample_rough_glass(bsdf: Bsdf, outgoing: vec3r, random: vec3r, choice: real) -> vec3r {
    if HAS_SOLID_GLASS && bsdf.solid {
        return sample_rough_dielectric(outgoing, bsdf.alpha, bsdf.eta, random.xy, choice);
    }
    if HAS_THIN_GLASS {
        return sample_rough_thin(outgoing, bsdf.alpha, bsdf.ior, random.xy, choice);
    }
    return vec3r(0.0);
}

/// The smooth opaque reflection lobe, selected with `probability`: a mirror about the shading normal.
fn sample_mirror(bsdf: Bsdf, outgoing: vec3r, probability: real, mode: u32) -> BsdfSample {
    let local = to_local(bsdf.frame, outgoing);
    let weight = fresnel_schlick(bsdf.specular_f0, bsdf.specular_f90, local.z) / probability;
    return delta_sample(bsdf, outgoing, vec3r(-local.xy, local.z), weight, probability, mode);
}

/// The smooth glass lobe, selected with `probability`: reflection with probability F (of the sheet: 2F/(1+F)), else
/// transmission. Radiance that enters a solid of relative index eta is scaled by 1/eta^2, importance is not.
fn sample_delta_glass(bsdf: Bsdf, outgoing: vec3r, choice: real, probability: real, mode: u32) -> BsdfSample {
    let local = to_local(bsdf.frame, outgoing);
    let share = bsdf.glass / probability;
    var reflectance = real(0.0);
    if HAS_SOLID_GLASS && bsdf.solid {
        reflectance = fresnel_dielectric(local.z, bsdf.eta);
    } else if HAS_THIN_GLASS {
        reflectance = thin_reflectance(local.z, bsdf.ior);
    }
    if choice < reflectance {
        return delta_sample(bsdf, outgoing, vec3r(-local.xy, local.z), vec3r(share), probability * reflectance, mode);
    }
    var incoming = -local;
    var weight = share * bsdf.tint;
    if HAS_SOLID_GLASS && bsdf.solid {
        incoming = refract_smooth(local, bsdf.eta);
        if mode == RADIANCE || !refraction_adjoint {
            weight /= bsdf.eta * bsdf.eta;
        }
    }
    return delta_sample(bsdf, outgoing, incoming, weight, probability * (1.0 - reflectance), mode);
}

/// A sampled direction as the walk will find it in its state: what is evaluated must be what is traced.
fn stored_direction(direction: vec3r, mode: u32) -> vec3r {
    if mode == IMPORTANCE {
        return stored_importance_direction(direction);
    }
    return stored_radiance_direction(direction);
}

/// Completes a delta sample: rejects directions on which the two normals disagree, corrects importance for the
/// shading normal. `weight` is that of radiance without index factor.
fn delta_sample(bsdf: Bsdf, outgoing: vec3r, local_incoming: vec3r, weight: vec3r, pdf: real, mode: u32) -> BsdfSample {
    var sample: BsdfSample;
    sample.direction = stored_direction(to_world(bsdf.frame, local_incoming), mode);
    if !hemispheres_agree(bsdf, outgoing, sample.direction) {
        return sample;
    }
    sample.weight = weight;
    if (HAS_SHADING_NORMALS || HAS_NORMAL_MAP) && shading_normal_adjoint && mode == IMPORTANCE {
        sample.weight *= scattering_cosine(bsdf, outgoing, sample.direction, mode) / abs(local_incoming.z);
    }
    sample.pdf = pdf;
    if HAS_DELTA {
        sample.delta = true;
    }
    if HAS_TRANSMISSION {
        sample.transmitted = local_incoming.z < 0.0;
    }
    return sample;
}

/// Neither direction grazes, `outgoing` lies above both normals, `incoming` on one side of both.
fn hemispheres_agree(bsdf: Bsdf, outgoing: vec3r, incoming: vec3r) -> bool {
    let outgoing_cosine = dot(outgoing, bsdf.frame.normal);
    let incoming_cosine = dot(incoming, bsdf.frame.normal);
    if outgoing_cosine < GRAZING_COSINE || abs(incoming_cosine) < GRAZING_COSINE {
        return false;
    }
    if HAS_SHADING_NORMALS || HAS_NORMAL_MAP {
        let incoming_geometric = dot(incoming, bsdf.facing_normal);
        return dot(outgoing, bsdf.facing_normal) >= GRAZING_COSINE
            && abs(incoming_geometric) >= GRAZING_COSINE
            && incoming_geometric * incoming_cosine > 0.0;
    }
    return true;
}

/// The cosine that multiplies f: |i.Ns| for radiance; for importance, where `outgoing` points to the light,
/// |o.Ns| |i.Ng| / |o.Ng| (Veach 1997, section 5.3), which keeps the transport adjoint under shading normals.
fn scattering_cosine(bsdf: Bsdf, outgoing: vec3r, incoming: vec3r, mode: u32) -> real {
    if (HAS_SHADING_NORMALS || HAS_NORMAL_MAP) && shading_normal_adjoint && mode == IMPORTANCE {
        return abs(dot(incoming, bsdf.facing_normal))
            * dot(outgoing, bsdf.frame.normal) / dot(outgoing, bsdf.facing_normal);
    }
    return abs(dot(incoming, bsdf.frame.normal));
}
