//! The flux of the star in a band: a sum over the visible pixels, `sum_p area mu LD(mu) B`, over that of the bare
//! photosphere.

use super::{LimbDarkening, Response, Sampling, StarSettings, StarState, SurfaceGrid};

/// Properties of the star that differ in a band.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Band {
    /// Brightness of a fully spotted pixel over that of the photosphere; that of the star if `None`.
    pub contrast: Option<f64>,
    /// Limb darkening; that of the star if `None`.
    pub limb_darkening: Option<LimbDarkening>,
}

impl Band {
    /// Brightness of a spot over that of the photosphere, at one state of the star.
    pub fn contrast(&self, star: &StarSettings, state: &StarState) -> f64 {
        self.contrast.unwrap_or_else(|| star.with(&state.surface).contrast)
    }

    /// Dimming of the flux of the bare photosphere by a spot on each pixel, over the dimming of the spot, averaged over
    /// these times (d). For spots of equal contrast at the limb these are the pixels' shares of the flux, and sum to 1.
    pub fn shares(&self, grid: &SurfaceGrid, star: &StarSettings, state: &StarState, times_d: &[f64]) -> Vec<f64> {
        let (mut star, mut state) = (star.clone(), *state);
        if let Some(limb_darkening) = self.limb_darkening {
            star.limb_darkening = limb_darkening;
            state.surface.limb_darkening = None;
        }
        // profiles without bins: only their continuum is used
        let profiles = times_d.iter().map(|time_d| (*time_d, 0.0, 0)).collect();
        let sampling = Sampling { step_kms: star.with(&state.surface).line.sigma_kms, profiles };
        let (mut shares, mut fluxes) = (vec![0.0; grid.len()], vec![0.0; times_d.len()]);
        let response = Response::new(grid, &star, &state, &sampling);
        response.apply_transpose(&[], &vec![1.0; times_d.len()], &mut shares);
        response.apply(&vec![1.0; grid.len()], &mut [], &mut fluxes);
        let total: f64 = fluxes.iter().sum();
        shares.iter_mut().for_each(|share| *share /= total);
        shares
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::star::{LocalLine, Orbit, Quadrature, Regions, Rotation, Surface};

    /// Shares of single pixels by the formula, on a grid so fine that a pixel is a point; and the band's limb darkening
    /// overrides a free parameter of the star.
    #[test]
    fn shares_are_area_times_mu_times_limb_darkening() {
        let grid = SurfaceGrid::equal_area(20_000, Quadrature::Gauss2x2);
        let limb = LimbDarkening::Quadratic(0.3, 0.2);
        let star = StarSettings {
            rotation_period_d: 3.0,
            epoch_d: 1.0,
            limb_darkening: LimbDarkening::Linear(0.9),
            contrast: 0.4,
            line: LocalLine::gaussian(3.0, 5.0),
            regions: Regions::PLAIN,
        };
        let inclination: f64 = 1.1;
        let state = StarState {
            rotation: Rotation { omega_eq_rad_d: 2.1, domega_rad_d: 0.05 },
            inclination,
            vsini_kms: 30.0,
            vsys_kms: 5.0,
            motion: Orbit { k_kms: 0.3, porb_over_prot: 1.7, phi: 0.2 }.into(),
            surface: Surface { limb_darkening: Some(0.1), contrast: Some(0.3), ..Surface::default() },
        };
        let band = Band { contrast: None, limb_darkening: Some(limb) };
        assert_eq!(band.contrast(&star, &state), 0.3);
        assert_eq!(Band { contrast: Some(0.6), ..band }.contrast(&star, &state), 0.6);
        let time_d = 2.3;
        let shares = band.shares(&grid, &star, &state, &[time_d]);
        let wanted = |p: usize| {
            let (sin, cos) = grid.latitude[p].sin_cos();
            let psi = grid.longitude[p] + (2.1 - 0.05 * sin * sin) * (time_d - 1.0);
            let mu = sin * inclination.cos() + cos * inclination.sin() * psi.cos();
            if mu > 0.0 { grid.area[p] * mu * limb.at(mu) } else { 0.0 }
        };
        let all: Vec<f64> = (0..grid.len()).map(wanted).collect();
        let total: f64 = all.iter().sum();
        let largest = all.iter().copied().fold(0.0, f64::max) / total;
        // pixels at the limb are partly visible
        let worst = shares.iter().zip(&all).map(|(a, b)| (a - b / total).abs()).fold(0.0, f64::max);
        assert!(worst < 0.01 * largest, "{worst} of {largest}");
        // a mean over times
        let both = band.shares(&grid, &star, &state, &[time_d, 3.1]);
        let other = band.shares(&grid, &star, &state, &[3.1]);
        assert!((0..grid.len()).all(|p| (both[p] - 0.5 * (shares[p] + other[p])).abs() < 1e-6 * largest));
    }
}
