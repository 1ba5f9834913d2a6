//! Multiple importance sampling of one vertex's two strategies: sampling a light and hitting it (Veach 1997, chapter 9).
//! The densities are per sr. Forms without division by a squared distance, so that no distance is too short.

import package::real::real;
import package::params::{heuristic, heuristic_power};
import package::features::{HAS_DIRECTIONAL_LIGHT, HAS_POINT_LIGHT, HAS_SPOT_LIGHT};
import package::light::light_sample::LightSample;

/// Weight / density of a light sample when nothing else finds lights, sr.
fn inverse_light_pdf(light: LightSample) -> real {
    if light.cosine <= 0.0 {
        return 0.0;
    }
    return light.cosine / light.density;
}

/// Weight / density of a light sample, sr, against scattering with density `scatter_pdf` in the same direction:
/// 1/(p_l + p_s) or p_l/(p_l^2 + p_s^2). Lights without extent are never hit and keep the full weight.
fn weighted_inverse_light_pdf(light: LightSample, scatter_pdf: real) -> real {
    if HAS_POINT_LIGHT || HAS_SPOT_LIGHT || HAS_DIRECTIONAL_LIGHT {
        if light.delta {
            return inverse_light_pdf(light);
        }
    }
    if light.cosine <= 0.0 {
        return 0.0;
    }
    let rival = scatter_pdf * light.cosine;
    if heuristic == heuristic_power {
        let greatest = max(light.density, rival);
        let own = light.density / greatest;
        let other = rival / greatest;
        return light.cosine / greatest * (own / (own * own + other * other));
    }
    return light.cosine / (light.density + rival);
}

/// Weight of light that a scattered ray of density `scatter_pdf` > 0 has met, against sampling it with `light_pdf`.
fn hit_weight(scatter_pdf: real, light_pdf: real) -> real {
    let ratio = light_pdf / scatter_pdf;
    if heuristic == heuristic_power {
        return 1.0 / (1.0 + ratio * ratio);
    }
    return 1.0 / (1.0 + ratio);
}
