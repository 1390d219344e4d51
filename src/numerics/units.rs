//! Constants and conversions between the units at the program's boundaries (degrees, km/s, nm) and those inside
//! (radians).

/// Speed of light (km/s).
pub const SPEED_OF_LIGHT_KMS: f64 = 299_792.458;

/// FWHM of a Gaussian over its standard deviation, `2 sqrt(2 ln 2)`.
pub const FWHM_PER_SIGMA: f64 = 2.354_820_045_030_949_3;

/// Seconds in a day.
pub const SECONDS_PER_DAY: f64 = 86_400.0;

/// Gravity of the Sun, G M (km^3/s^2): the nominal solar mass parameter of IAU 2015 resolution B3.
pub const SOLAR_GM_KM3_S2: f64 = 1.327_124_4e11;

/// Gravity of Jupiter, G M (km^3/s^2), nominal (the same resolution).
const JOVIAN_GM_KM3_S2: f64 = 1.266_865_3e8;

/// Gravity of the Earth, G M (km^3/s^2), nominal (the same resolution).
const TERRESTRIAL_GM_KM3_S2: f64 = 3.986_004e5;

/// Mass of the Sun in masses of Jupiter.
pub const JUPITERS_PER_SUN: f64 = SOLAR_GM_KM3_S2 / JOVIAN_GM_KM3_S2;

/// Mass of Jupiter in masses of the Earth.
pub const EARTHS_PER_JUPITER: f64 = JOVIAN_GM_KM3_S2 / TERRESTRIAL_GM_KM3_S2;

/// Second radiation constant `h c / k` (m K), CODATA 2018.
const SECOND_RADIATION_M_K: f64 = 1.438_776_877e-2;

/// Standard deviation (km/s) of a Gaussian instrumental profile of the given resolving power, whose FWHM is c/R.
pub fn instrumental_sigma_kms(resolving_power: f64) -> f64 {
    SPEED_OF_LIGHT_KMS / resolving_power / FWHM_PER_SIGMA
}

/// Standard deviation of the Gaussian as wide at half depth as a Voigt profile of a Gaussian of standard deviation
/// `sigma` and a Lorentzian of half width `gamma` (Olivero & Longbothum 1977, JQSRT 17, 233: accurate to 0.02 %).
pub fn gaussian_as_wide_as_voigt(sigma: f64, gamma: f64) -> f64 {
    let (gauss, lorentz) = (sigma * FWHM_PER_SIGMA, 2.0 * gamma);
    (0.5346 * lorentz + (0.2166 * lorentz * lorentz + gauss * gauss).sqrt()) / FWHM_PER_SIGMA
}

/// Ratio of Planck functions `B(spot) / B(photosphere)` at one wavelength: the brightness of a fully spotted pixel.
pub fn planck_contrast(spot_k: f64, photosphere_k: f64, wavelength_nm: f64) -> f64 {
    let x = SECOND_RADIATION_M_K / (wavelength_nm * 1e-9);
    (x / photosphere_k).exp_m1() / (x / spot_k).exp_m1()
}
