//! The light of a pupil at given direction cosines, by the rays that have them.
//!
//! Where the aberrations are so large that polynomials in the cosines are not exact enough, they still tell
//! where to begin: a polynomial gives the pupil point of two cosines nearly, and Newton steps with the
//! derivatives of traced rays give it to rounding. Path difference and amplitude are then those of a ray.

use super::polynomial::{FitSample, PolynomialBasis, WavePolynomial};
use super::pupil_samples::PupilSamples;
use crate::analysis::AnalysisError;
use crate::analysis::reference_sphere::{ReferenceSphere, SphereRay};
use crate::math::Dual;
use crate::pupil::{Dual2, Region};

/// The order of quadrature whose nodes the first guess is fitted to, and its largest number of terms.
const START_ORDER: usize = 5;
const START_TERMS: usize = 150;
/// The samples of the fit for each term.
const TERM_SAMPLES: usize = 4;
/// The largest number of Newton steps.
const STEPS: usize = 8;
/// The error of cosines that counts for nothing, over the size of the pupil in cosines.
const CLOSE: f64 = 1e-14;

/// A pupil whose light is found by tracing.
#[derive(Debug)]
pub(super) struct RayPupil<'a> {
    region: &'a Region<'a>,
    sphere: &'a ReferenceSphere,
    /// The pupil point of two cosines, its first coordinate over the first cosine in a mirrored pupil.
    start: WavePolynomial,
    mirrored: bool,
    /// The size of the pupil in cosines.
    size: f64,
}

impl<'a> RayPupil<'a> {
    /// The pupil of a region on a sphere.
    ///
    /// # Errors
    /// The pupil folds, or no ray arrives.
    pub(super) fn new(
        region: &'a Region<'a>,
        sphere: &'a ReferenceSphere,
    ) -> Result<Self, AnalysisError> {
        let order = START_ORDER.min(region.orders().saturating_sub(1));
        let light = PupilSamples::of_nodes(region, sphere, &region.nodes(order))?;
        let mirrored = light.mirrored;
        let sample = |i: usize| {
            let (cosines, [x, y]) = (light.cosines[i], light.points[i]);
            // An odd function over the odd cosine is even, as the polynomials are.
            let first = if mirrored { x / cosines[0] } else { x };
            FitSample { cosines, values: [first, y], weight: light.energies[i] }
        };
        let usable = |i: &usize| !mirrored || light.cosines[*i][0] != 0.0;
        let samples: Vec<_> = (0..light.cosines.len()).filter(usable).map(sample).collect();
        let points = || samples.iter().map(|sample| sample.cosines);
        let terms = (samples.len() / TERM_SAMPLES).min(START_TERMS);
        let basis = PolynomialBasis::new(points(), terms, mirrored);
        let (start, _) = basis.fit(&samples, [0.0; 2]).ok_or(AnalysisError::IrregularPupil)?;
        let size = points().map(|[a, b]| a.hypot(b)).fold(0.0, f64::max);
        Ok(Self { region, sphere, start, mirrored, size })
    }

    /// The path difference in waves and the amplitude at two cosines; `None` if no ray has them.
    pub(super) fn light(&self, cosines: [f64; 2]) -> Option<[f64; 2]> {
        let [first, y] = self.start.at(cosines);
        let mut p = [if self.mirrored { first * cosines[0] } else { first }, y];
        let mut found = self.on_sphere(p)?;
        for _ in 0..STEPS {
            let [a, b] = found.cosines;
            let off = [cosines[0] - a.value, cosines[1] - b.value];
            if off[0].hypot(off[1]) <= CLOSE * self.size {
                break;
            }
            let determinant = a.slope[0] * b.slope[1] - a.slope[1] * b.slope[0];
            let dx = (off[0] * b.slope[1] - off[1] * a.slope[1]) / determinant;
            let dy = (off[1] * a.slope[0] - off[0] * b.slope[0]) / determinant;
            p = [p[0] + dx, p[1] + dy];
            found = self.on_sphere(p)?;
        }
        let [a, b] = found.cosines;
        let off = [cosines[0] - a.value, cosines[1] - b.value];
        // What rounding leaves of the cosines, along the slopes of the path difference.
        let determinant = a.slope[0] * b.slope[1] - a.slope[1] * b.slope[0];
        let dx = (off[0] * b.slope[1] - off[1] * a.slope[1]) / determinant;
        let dy = (off[1] * a.slope[0] - off[0] * b.slope[0]) / determinant;
        let waves = found.waves.value + found.waves.slope[0] * dx + found.waves.slope[1] * dy;
        let area = (determinant / self.region.launch.beam_share(p)).abs();
        let is_close = off[0].hypot(off[1]) <= 1e3 * CLOSE * self.size;
        (is_close && area > 0.0 && waves.is_finite()).then(|| [waves, area.sqrt().recip()])
    }

    fn on_sphere(&self, p: [f64; 2]) -> Option<SphereRay<Dual2>> {
        let launch = &self.region.launch;
        let (start, end) = (launch.ray(p)?, launch.unclipped_landing(p)?);
        let path = Dual::constant(launch.optical_path_to(start)) + end.opl;
        self.sphere.project(end.ray, path)
    }
}
