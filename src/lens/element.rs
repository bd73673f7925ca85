//! Whole elements: a single lens or a cemented group, found in a lens or made for a focal length.

use super::resolve::index;
use super::{Lens, LensError, Medium, MediumPlace, Row, glass};
use serde::{Deserialize, Serialize};

/// The crown glass of new elements.
const CROWN: &str = "SCHOTT N-BK7";
/// The flint glass of new cemented doublets.
const FLINT: &str = "SCHOTT N-SF2";
/// The largest height at which a new surface is shaped, as a share of its radius.
const STEEPEST: f64 = 0.9;

/// The form of a new element.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ElementForm {
    /// One lens of N-BK7.
    Singlet,
    /// A crown of N-BK7 cemented to a flint of N-SF2, with the same focal length for blue and red.
    CementedDoublet,
}

/// An element to be made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NewElement {
    /// The form.
    pub form: ElementForm,
    /// The focal length in air in mm, negative for a diverging element.
    pub focal_length: f64,
    /// The height in mm up to which its edges are thick enough.
    pub semi_diameter: f64,
    /// The Coddington shape factor `(c₁ + c₂) / (c₁ − c₂)` of a singlet: 0 equiconvex, 1 with a
    /// plane back. A cemented doublet begins with an equiconvex crown.
    pub shape_factor: f64,
}

impl NewElement {
    /// The rows of the element at a wavelength in micrometres; its focal length there is exact. The
    /// last thickness is 0.
    ///
    /// # Errors
    /// A focal length that is no number or zero, a semi-diameter that is not positive, or a
    /// wavelength at which the glasses have no index.
    pub fn rows(&self, um: f64) -> Result<Vec<Row>, LensError> {
        let Self { focal_length: f, semi_diameter: h, .. } = *self;
        if !(f.is_finite() && f != 0.0) {
            return Err(invalid("focal length of the element", f, "a number other than 0, in mm"));
        }
        if !(h > 0.0 && h.is_finite()) {
            return Err(invalid("semi-diameter of the element", h, "more than 0, in mm"));
        }
        let mut rows = match self.form {
            ElementForm::Singlet => self.singlet(um)?,
            ElementForm::CementedDoublet => self.doublet(um)?,
        };
        let power = power(&rows, um, 1.0)?;
        scale(&mut rows, f * power);
        Ok(rows)
    }

    fn singlet(&self, um: f64) -> Result<Vec<Row>, LensError> {
        let n = glass_index(CROWN, um)?;
        let difference = 1.0 / (self.focal_length * (n - 1.0));
        let front = 0.5 * difference * (self.shape_factor + 1.0);
        let surfaces = [front, front - difference];
        Ok(self.glue(&surfaces, &[CROWN]))
    }

    /// A thin achromat: the powers of crown and flint are `φ V₁/(V₁−V₂)` and `−φ V₂/(V₁−V₂)`.
    fn doublet(&self, um: f64) -> Result<Vec<Row>, LensError> {
        let abbe = |name| glass::find(name).map_or(0.0, |glass| glass.vd);
        let (crown, flint) = (abbe(CROWN), abbe(FLINT));
        let share = crown / (crown - flint);
        let front = 0.5 * share / (self.focal_length * (glass_index(CROWN, um)? - 1.0));
        let flint_power = (1.0 - share) / self.focal_length;
        let back = -front - flint_power / (glass_index(FLINT, um)? - 1.0);
        Ok(self.glue(&[front, -front, back], &[CROWN, FLINT]))
    }

    /// Surfaces with glasses between them, thick enough in the middle and at the edge.
    fn glue(&self, curvatures: &[f64], glasses: &[&str]) -> Vec<Row> {
        let mut rows: Vec<Row> =
            curvatures.iter().map(|c| Row { curvature: *c, ..Row::default() }).collect();
        for (i, name) in glasses.iter().enumerate() {
            let sags =
                sag(curvatures[i], self.semi_diameter) - sag(curvatures[i + 1], self.semi_diameter);
            let edge = 0.12 * self.semi_diameter;
            rows[i].thickness = (sags + edge).max(0.24 * self.semi_diameter);
            rows[i].medium = Medium::Glass((*name).to_owned());
        }
        rows
    }
}

fn invalid(what: &str, found: f64, expected: &'static str) -> LensError {
    LensError::InvalidNumber { what: what.to_owned(), found, expected }
}

fn glass_index(name: &str, um: f64) -> Result<f64, LensError> {
    index(&Medium::Glass(name.to_owned()), MediumPlace::behind(0), um, 1.0)
}

/// The sag of a sphere at a height, or where it becomes too steep for an edge.
fn sag(curvature: f64, height: f64) -> f64 {
    let sine = (curvature * height).clamp(-STEEPEST, STEEPEST);
    if sine == 0.0 { 0.0 } else { sine * sine / curvature / (1.0 + (1.0 - sine * sine).sqrt()) }
}

fn scale(rows: &mut [Row], factor: f64) {
    for row in rows {
        row.curvature /= factor;
        row.thickness *= factor;
    }
}

/// The power in 1/mm of consecutive surfaces in a medium of index `n` in front, by the marginal ray
/// `n'u' = nu − y (n' − n) c` at height 1.
pub(super) fn power(rows: &[Row], um: f64, n: f64) -> Result<f64, LensError> {
    Ok(-trace(rows, um, n)?.0)
}

/// The slope `n'u'` of a ray that comes in at height 1 behind the rows, its height at the last one,
/// and the step of the index there.
pub(super) fn trace(rows: &[Row], um: f64, front: f64) -> Result<(f64, f64, f64), LensError> {
    let (mut y, mut nu, mut n, mut step) = (1.0, 0.0, front, 0.0);
    for (i, row) in rows.iter().enumerate() {
        let behind = index(&row.medium, MediumPlace::behind(i), um, n)?;
        step = behind - n;
        nu -= y * step * row.curvature;
        n = behind;
        if i + 1 < rows.len() {
            y += row.thickness * nu / n;
        }
    }
    Ok((nu, y, step))
}

impl Lens {
    /// The first and the last surface of the element to which a surface belongs, cemented ones
    /// together; `None` for a surface in air or at a mirror.
    pub fn element_around(&self, surface: usize) -> Option<(usize, usize)> {
        let filled = |gap: &usize| {
            self.surfaces
                .get(*gap)
                .is_some_and(|row| !matches!(row.medium, Medium::Air | Medium::Mirror))
        };
        let first = (0..surface).rev().take_while(filled).last().unwrap_or(surface);
        let last = (surface..self.surfaces.len()).take_while(filled).last();
        let last = last.map_or(surface, |gap| gap + 1);
        (first < last && last < self.surfaces.len()).then_some((first, last))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn element(form: ElementForm, focal_length: f64) -> NewElement {
        NewElement { form, focal_length, semi_diameter: 6.0, shape_factor: 0.0 }
    }

    #[test]
    fn a_new_element_has_its_focal_length_exactly() {
        for form in [ElementForm::Singlet, ElementForm::CementedDoublet] {
            for focal_length in [35.0, -80.0, 1000.0] {
                let rows = element(form, focal_length).rows(0.5876).unwrap();
                let found = 1.0 / power(&rows, 0.5876, 1.0).unwrap();
                assert!((found / focal_length - 1.0).abs() < 1e-12, "{form:?} {found}");
            }
        }
    }

    #[test]
    fn a_cemented_doublet_has_one_focal_length_for_blue_and_red() {
        let rows = element(ElementForm::CementedDoublet, 100.0).rows(glass::line::D).unwrap();
        let focal = |um| 1.0 / power(&rows, um, 1.0).unwrap();
        let apart = focal(glass::line::F) - focal(glass::line::C);
        assert!(apart.abs() < 0.1, "{apart}");
        let single = element(ElementForm::Singlet, 100.0).rows(glass::line::D).unwrap();
        let apart = 1.0 / power(&single, glass::line::F, 1.0).unwrap()
            - 1.0 / power(&single, glass::line::C, 1.0).unwrap();
        assert!(apart.abs() > 1.0, "{apart}");
    }

    #[test]
    fn the_edge_of_a_new_element_is_thick_enough() {
        for focal_length in [20.0, -20.0, 200.0] {
            let rows = element(ElementForm::Singlet, focal_length).rows(0.5876).unwrap();
            let edge =
                rows[0].thickness - sag(rows[0].curvature, 6.0) + sag(rows[1].curvature, 6.0);
            assert!(edge > 0.5 && rows[0].thickness > 1.0, "{focal_length}: {edge}");
        }
    }

    #[test]
    fn an_element_without_a_focal_length_is_refused() {
        for focal_length in [0.0, f64::NAN, f64::INFINITY] {
            let refused = element(ElementForm::Singlet, focal_length).rows(0.5876);
            assert!(refused.unwrap_err().to_string().contains("focal length"));
        }
    }
}
