//! The exact law of a sensor's numbers, and the photons of light: sums and integrals that the random
//! numbers of a picture follow.

use super::SensorModel;
use crate::math::erfc;
use crate::math::quadrature::gauss_legendre;
use std::f64::consts::SQRT_2;

/// The constants of Planck (J s), of Boltzmann (J/K) and the speed of light (m/s), exact in the SI.
const PLANCK: f64 = 6.626_070_15e-34;
const BOLTZMANN: f64 = 1.380_649e-23;
const LIGHT: f64 = 299_792_458.0;
/// Lumens per watt at 555 nm.
const LUMENS_PER_WATT: f64 = 683.0;

/// The photons of a wavelength in um that an illuminance in lux, at 683 lm/W, brings to a pixel of a side
/// in mm in a time in seconds.
pub fn photons_of_wavelength(lux: f64, side: f64, seconds: f64, um: f64) -> f64 {
    let per_joule = 1e-6 * um / (PLANCK * LIGHT);
    lux / LUMENS_PER_WATT * (1e-3 * side).powi(2) * seconds * per_joule
}

/// The nodes of the integral over wavelengths.
const SPECTRUM: usize = 60;

/// The photon radiance of a black body between two wavelengths in um, in photons/(s m² sr).
pub fn black_body_photons(kelvin: f64, [from, to]: [f64; 2]) -> f64 {
    let radiance = |um: f64| {
        let m = 1e-6 * um;
        2.0 * LIGHT / m.powi(4) / (PLANCK * LIGHT / (m * BOLTZMANN * kelvin)).exp_m1()
    };
    gauss_legendre(SPECTRUM, from, to).into_iter().map(|(um, w)| 1e-6 * w * radiance(um)).sum()
}

/// The width of the sums in standard deviations: the rest is below 1e-22.
const WIDE: f64 = 10.0;

impl SensorModel {
    /// The mean and the variance of a pixel's number by the linear model of EMVA 1288, without clipping.
    pub fn linear_moments(&self, photons: f64, dark: f64) -> [f64; 2] {
        let electrons = self.quantum_efficiency * photons + dark;
        let variance = self.gain.powi(2) * (self.read_noise.powi(2) + electrons) + 1.0 / 12.0;
        [self.gain * electrons + self.black_level, variance]
    }

    /// The mean and the variance of a pixel's number for a mean number of photons and of dark electrons:
    /// sums over its electrons and over the numbers that read noise makes of them.
    pub fn exact_moments(&self, photons: f64, dark: f64) -> [f64; 2] {
        let electrons = self.quantum_efficiency * photons + dark;
        let center = (self.gain * electrons.min(self.full_well) + self.black_level).round();
        let mut sums = [0.0; 3];
        for (count, share) in poisson(electrons) {
            let [first, second] = self.number_moments(count.min(self.full_well), center);
            sums = [sums[0] + share, sums[1] + share * first, sums[2] + share * second];
        }
        let mean = sums[1] / sums[0];
        [center + mean, sums[2] / sums[0] - mean * mean]
    }

    /// The mean and the mean square of the number of some electrons, from a number nearby.
    fn number_moments(&self, electrons: f64, center: f64) -> [f64; 2] {
        let (middle, sigma) =
            (self.gain * electrons + self.black_level, self.gain * self.read_noise);
        let clamp = |v: f64| v.clamp(0.0, self.largest());
        if sigma == 0.0 {
            let off = clamp((middle + 0.5).floor()) - center;
            return [off, off * off];
        }
        let low = clamp((middle - WIDE * sigma).floor());
        let high = clamp((middle + WIDE * sigma).ceil());
        // All above the lowest number: y² grows by 2y − 1 from one number to the next.
        let mut moments = [low - center, (low - center).powi(2)];
        let mut number = low + 1.0;
        while number <= high {
            let at_least = 0.5 * erfc((number - 0.5 - middle) / (SQRT_2 * sigma));
            moments[0] += at_least;
            moments[1] += (2.0 * (number - center) - 1.0) * at_least;
            number += 1.0;
        }
        moments
    }
}

/// The counts of a Poisson law with their probabilities, up to a common factor.
fn poisson(mean: f64) -> Vec<(f64, f64)> {
    let mode = mean.floor();
    let reach = WIDE * mean.sqrt() + 30.0;
    let (low, high) = ((mode - reach).max(0.0).floor(), (mode + reach).ceil());
    if !(mean > 0.0) {
        return vec![(0.0, 1.0)];
    }
    let mut law = vec![(mode, 1.0)];
    let (mut count, mut share) = (mode, 1.0);
    while count > low {
        share *= count / mean;
        count -= 1.0;
        law.push((count, share));
    }
    (count, share) = (mode, 1.0);
    while count < high {
        count += 1.0;
        share *= mean / count;
        law.push((count, share));
    }
    law
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_poisson_law_has_its_mean_as_its_variance() {
        for mean in [1e-3, 0.5, 30.0, 4e4] {
            let law = poisson(mean);
            let sum = |f: &dyn Fn(f64) -> f64| law.iter().map(|(n, p)| p * f(*n)).sum::<f64>();
            let total = sum(&|_| 1.0);
            assert!((sum(&|n| n) / total / mean - 1.0).abs() < 1e-12);
            let variance = sum(&|n| (n - mean).powi(2)) / total;
            assert!((variance / mean - 1.0).abs() < 1e-12, "{mean}: {variance}");
        }
    }
}
