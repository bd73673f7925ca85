//! A round pupil that is given by its f-number, its shadow and its aberrations by name, as books have it.

use super::outline::PupilCurve;
use super::pupil_function::PupilFunction;
use crate::analysis::{AnalysisError, ZernikeIndex, ZernikeOrder};

/// A round pupil: its direction cosines reach `1/(2F)`.
#[derive(Debug, Clone, Default)]
pub struct RoundPupil {
    um: f64,
    f_number: f64,
    /// The diameter of a round shadow in its middle over its own; 0 for none.
    obscuration: f64,
    /// The coefficients of [`RoundPupil::SEIDEL`], in wavelengths.
    seidel: [f64; 5],
    noll: Vec<(ZernikeIndex, f64)>,
}

impl RoundPupil {
    /// The names of the aberrations `W020 ρ²`, `W040 ρ⁴`, `W111 y`, `W131 ρ² y` and `W222 y²`.
    pub const SEIDEL: [&str; 5] = ["W020", "W040", "W111", "W131", "W222"];
    /// The number of Zernike polynomials in Noll's order.
    pub const NOLL: usize = 45;

    /// A pupil without aberrations, by its wavelength in micrometres, its f-number and the share of its shadow.
    pub fn new(um: f64, f_number: f64, obscuration: f64) -> Self {
        Self { um, f_number, obscuration, ..Self::default() }
    }

    /// Adds an aberration by its name, in wavelengths; `None` for an unknown name.
    pub fn add_seidel(&mut self, name: &str, waves: f64) -> Option<()> {
        let known = Self::SEIDEL.iter().position(|known| *known == name)?;
        self.seidel[known] += waves;
        Some(())
    }

    /// Adds a Zernike polynomial by Noll's number, from 1 on, in wavelengths; `None` for another number.
    pub fn add_noll(&mut self, number: usize, waves: f64) -> Option<()> {
        let index = *ZernikeOrder::Noll.indices(Self::NOLL).get(number.checked_sub(1)?)?;
        self.noll.push((index, waves));
        Some(())
    }

    /// The unit of lengths in its image, λF, in mm.
    pub fn unit(&self) -> f64 {
        1e-3 * self.um * self.f_number
    }

    /// True if its aberrations are round.
    pub fn has_round_aberrations(&self) -> bool {
        let seidel = self.seidel[2..].iter().all(|waves| *waves == 0.0);
        seidel && self.noll.iter().all(|(index, _)| index.frequency == 0)
    }

    /// The path difference at a point of the unit disc, in wavelengths.
    fn waves(&self, [x, y]: [f64; 2]) -> f64 {
        let square = x * x + y * y;
        let forms = [square, square * square, y, square * y, y * y];
        let seidel: f64 = self.seidel.iter().zip(forms).map(|(w, form)| w * form).sum();
        seidel + self.noll.iter().map(|(index, w)| w * index.value([x, y])).sum::<f64>()
    }

    /// The pupil in direction cosines.
    ///
    /// # Errors
    /// A pupil without area.
    pub fn function(&self) -> Result<PupilFunction, AnalysisError> {
        let radius = 0.5 / self.f_number;
        // The image is real: a ray through +y goes down.
        let waves = |cosines: [f64; 2]| self.waves(cosines.map(|v| -v / radius));
        let circle = |share: f64| PupilCurve::circle([0.0; 2], share * radius);
        if self.obscuration > 0.0 {
            PupilFunction::ring(&[circle(1.0), circle(self.obscuration)], self.um, waves)
        } else {
            PupilFunction::uniform(vec![circle(1.0)], self.um, waves)
        }
    }

    /// The shares of the energy within circles of radii in mm about the centre of the image, each with the error
    /// that contrasts leave in it, for round aberrations.
    pub fn encircled(&self, pupil: &PupilFunction, radii: &[f64], fine: bool) -> Vec<[f64; 2]> {
        pupil.round_encircled(radii, self.unit().recip(), self.obscuration, fine)
    }
}
