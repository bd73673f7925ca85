//! Classes of care in making, as tolerances to begin with.
//!
//! The numbers are those of the charts of optical shops: commercial and precision quality, the limit
//! of a good shop (Optimax, "Manufacturing Tolerance Chart"), and moulded plastic elements of phone
//! cameras. Fringes are half wavelengths at 632.8 nm.

use super::NominalLens;
use crate::lens::{
    ErrorDistribution, Lens, Perturbation, PerturbationKind, Quantity, Shape, System,
    TEST_WAVELENGTH, Tolerance, ToleranceGrade, ToleranceSheet, conic_of_sag, curvature_of_fringes,
    fourth_of_sag,
};
use serde::Serialize;
use std::collections::BTreeMap;

/// The half ranges of a class.
#[derive(Debug, Clone, Copy, PartialEq)]
struct GradeNumbers {
    /// Power, in fringes over the semi-diameter.
    fringes: f64,
    /// Irregularity, in fringes.
    irregularity: f64,
    /// Thicknesses of glass and air, in mm.
    thickness: f64,
    /// Index.
    index: f64,
    /// Relative error of the Abbe number.
    abbe: f64,
    /// Tilt of a surface, in minutes of arc.
    surface_tilt: f64,
    /// Decentre of an element, in mm.
    decenter: f64,
    /// Tilt of an element, in minutes of arc.
    tilt: f64,
    /// The change of the sag of an aspheric surface at its rim, in mm.
    sag: f64,
    /// Slope error of an aspheric surface, in minutes of arc.
    slope: f64,
    /// Decentre of an aspheric surface, in mm; of every surface of a moulded element.
    surface_decenter: f64,
}

/// The half ranges of a class.
fn grade_numbers(grade: ToleranceGrade) -> GradeNumbers {
    let of =
        |[fringes, irregularity, thickness, index, abbe, surface_tilt, decenter, tilt]: [f64;
             8],
         [sag, slope, surface_decenter]: [f64; 3]| GradeNumbers {
            fringes,
            irregularity,
            thickness,
            index,
            abbe,
            surface_tilt,
            decenter,
            tilt,
            sag,
            slope,
            surface_decenter,
        };
    match grade {
        ToleranceGrade::Commercial => {
            of([5.0, 1.0, 0.1, 1e-3, 0.008, 3.0, 0.1, 3.0], [1e-3, 3.0, 0.05])
        }
        ToleranceGrade::Precision => {
            of([3.0, 0.5, 0.05, 5e-4, 0.005, 1.0, 0.02, 1.0], [3e-4, 1.0, 0.01])
        }
        ToleranceGrade::ShopLimit => {
            of([1.0, 0.05, 0.02, 2e-4, 0.002, 0.25, 0.01, 0.25], [5e-5, 0.3, 0.002])
        }
        ToleranceGrade::MouldedPlastic => {
            of([2.0, 1.0, 0.005, 5e-4, 0.005, 1.0, 0.003, 2.0], [3e-4, 1.0, 0.003])
        }
    }
}

/// The tolerances of a class for every surface, gap and element of a lens, for the form and the axis of
/// aspheric surfaces, and for the groups of several elements that move in a zoom lens.
pub fn graded_sheet(lens: &Lens, nominal: &NominalLens, grade: ToleranceGrade) -> ToleranceSheet {
    let numbers = grade_numbers(grade);
    let is_moulded = grade == ToleranceGrade::MouldedPlastic;
    let mut sheet = GradedSheet { nominal, numbers, is_moulded, errors: Vec::new() };
    for surface in 0..lens.surfaces.len() {
        sheet.add_surface(surface);
    }
    let mut first = 0;
    while first < lens.surfaces.len() {
        match lens.element_around(first) {
            Some((from, to)) if from == first => {
                sheet.add_element(from, to);
                first = to + 1;
            }
            _ => first += 1,
        }
    }
    for (first, last) in moving_groups(lens) {
        sheet.add_body(first, last);
    }
    ToleranceSheet::of_errors(sheet.errors)
}

/// The first and the last surface of every group of several elements that moves as one between gaps that
/// differ from one zoom position to another.
fn moving_groups(lens: &Lens) -> Vec<(usize, usize)> {
    let inner = lens.surfaces.len().saturating_sub(1);
    let differs = |gap: &usize| {
        lens.zoom.iter().any(|position| position.number(*gap, Quantity::Thickness).is_some())
    };
    let moving: Vec<usize> = (0..inner).filter(differs).collect();
    if moving.is_empty() {
        return Vec::new();
    }
    let mut groups = Vec::new();
    let mut start = 0;
    for end in moving.into_iter().chain([inner]) {
        let elements: Vec<(usize, usize)> = (start..=end)
            .filter_map(|surface| lens.element_around(surface))
            .filter(|(first, last)| *first >= start && *last <= end)
            .collect();
        if let (Some(first), Some(last)) = (elements.first(), elements.last())
            && first != last
        {
            groups.push((first.0, last.1));
        }
        start = end + 1;
    }
    groups
}

/// The price of a tolerance: the loosest class of care that keeps it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PriceClass {
    /// Every shop keeps it.
    Commercial,
    /// A good shop keeps it without a surcharge.
    Precision,
    /// It is the limit of a good shop.
    ShopLimit,
    /// It is tighter than that.
    Beyond,
}

impl PriceClass {
    /// Its name in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Commercial => "commercial",
            Self::Precision => "precision",
            Self::ShopLimit => "shop limit",
            Self::Beyond => "beyond",
        }
    }
}

/// The price of each tolerance, and the half range of its class: its own beyond all classes. `None`
/// for an error that classes say nothing about.
pub fn price_classes(
    lens: &Lens,
    nominal: &NominalLens,
    tolerances: &[Tolerance],
) -> Vec<Option<(PriceClass, f64)>> {
    let classes = [
        (ToleranceGrade::Commercial, PriceClass::Commercial),
        (ToleranceGrade::Precision, PriceClass::Precision),
        (ToleranceGrade::ShopLimit, PriceClass::ShopLimit),
    ];
    let half_ranges = classes.map(|(grade, class)| {
        let sheet = graded_sheet(lens, nominal, grade);
        let of: BTreeMap<_, _> = sheet.errors.iter().map(|t| (t.error, t.half_range)).collect();
        (class, of)
    });
    let price = |t: &Tolerance| {
        half_ranges[0].1.get(&t.error)?;
        let kept = half_ranges.iter().find_map(|(class, of)| {
            let range = of.get(&t.error).filter(|range| **range <= t.half_range);
            range.map(|range| (*class, *range))
        });
        Some(kept.unwrap_or((PriceClass::Beyond, t.half_range)))
    };
    tolerances.iter().map(price).collect()
}

/// A tolerance is never wider than the commercial class, or than it was, by more than this factor.
const WIDEST: f64 = 10.0;

/// The same tolerances, none wider than ten times the commercial class, or than ten times its half
/// range in `proposed` where classes say nothing; and the number of those that are held so.
///
/// An error that does little by the quadratic form would else have any width at all, far beyond the
/// errors for which the form holds.
pub fn bounded_tolerances(
    lens: &Lens,
    nominal: &NominalLens,
    (proposed, loosest): (&[Tolerance], &[Tolerance]),
) -> (Vec<Tolerance>, usize) {
    let sheet = graded_sheet(lens, nominal, ToleranceGrade::Commercial);
    let class: BTreeMap<_, _> = sheet.errors.iter().map(|t| (t.error, t.half_range)).collect();
    let mut held = 0;
    let bounded = |(own, loosest): (&Tolerance, &Tolerance)| {
        let range = class.get(&loosest.error).copied().unwrap_or(own.half_range);
        // A tolerance that was wider at the start may stay so.
        let widest = WIDEST * range.max(own.half_range);
        held += usize::from(loosest.half_range > widest);
        Tolerance { half_range: loosest.half_range.min(widest), ..*loosest }
    };
    let bounded = proposed.iter().zip(loosest).map(bounded).collect();
    (bounded, held)
}

/// True for a surface of which one side is a GRIN medium: errors that break the symmetry about its axis are not
/// computed.
pub fn is_beside_grin(system: &System<f64>, surface: usize) -> bool {
    let gap = |i: usize| system.surfaces.get(i).is_some_and(|own| own.grin.is_some());
    gap(surface) || surface > 0 && gap(surface - 1)
}

/// Tolerances that are being collected.
struct GradedSheet<'a> {
    nominal: &'a NominalLens,
    numbers: GradeNumbers,
    /// True if a mould shapes each surface by itself.
    is_moulded: bool,
    errors: Vec<Tolerance>,
}

impl GradedSheet<'_> {
    fn add(&mut self, kind: PerturbationKind, (first, last): (usize, usize), half_range: f64) {
        let error = Perturbation { kind, first, last };
        let distribution = ErrorDistribution::default();
        self.errors.push(Tolerance { error, half_range, distribution });
    }

    /// The tolerances of a surface and of the gap behind it.
    fn add_surface(&mut self, i: usize) {
        let system = &self.nominal.systems[self.nominal.primary];
        let (numbers, own) = (self.numbers, &system.surfaces[i]);
        let before = system.index_before(i);
        let touches_grin = is_beside_grin(system, i);
        let refracts = own.mirror || own.index != before;
        let radius = self.nominal.semi_diameters[i];
        let (alone, glass) = ((i, i), own.index != 1.0 && !own.mirror);
        let last = i + 2 >= system.surfaces.len();
        if refracts && radius > 0.0 {
            let curvature = curvature_of_fringes(numbers.fringes, radius);
            self.add(PerturbationKind::Curvature, alone, curvature);
            if !touches_grin {
                let depth = numbers.irregularity * 0.5 * TEST_WAVELENGTH;
                self.add(PerturbationKind::Irregularity, alone, depth);
                let angle = (numbers.surface_tilt / 60.0).to_radians();
                self.add(PerturbationKind::SurfaceTiltX, alone, angle);
                self.add(PerturbationKind::SurfaceTiltY, alone, angle);
                self.add_asphere(i, radius);
            }
        }
        if !last {
            self.add(PerturbationKind::Thickness, alone, numbers.thickness);
        }
        if glass {
            self.add(PerturbationKind::Index, alone, numbers.index);
            self.add(PerturbationKind::Abbe, alone, numbers.abbe);
        }
    }

    /// The tolerances of an aspheric surface: of its form, and of its own axis. The axes of moulded surfaces
    /// are apart whatever their forms.
    fn add_asphere(&mut self, i: usize, radius: f64) {
        let system = &self.nominal.systems[self.nominal.primary];
        let (numbers, shape, alone) = (self.numbers, &system.surfaces[i].shape, (i, i));
        let form = match shape {
            Shape::Plane | Shape::Sphere { .. } => None,
            Shape::Conic { curvature, .. } => conic_of_sag(numbers.sag, *curvature, radius)
                .map(|conic| (PerturbationKind::Conic, conic)),
            Shape::Asphere { .. } => {
                Some((PerturbationKind::Asphere, fourth_of_sag(numbers.sag, radius)))
            }
        };
        if let Some((kind, half_range)) = form {
            self.add(kind, alone, half_range);
        }
        if matches!(shape, Shape::Asphere { .. }) {
            let slope = (numbers.slope / 60.0).to_radians();
            self.add(PerturbationKind::AsphereSlope, alone, slope);
        }
        if form.is_some() || self.is_moulded {
            self.add(PerturbationKind::SurfaceDecenterX, alone, numbers.surface_decenter);
            self.add(PerturbationKind::SurfaceDecenterY, alone, numbers.surface_decenter);
        }
    }

    fn add_element(&mut self, first: usize, last: usize) {
        self.add_body(first, last);
    }

    /// The tolerances of the place of an element or a group.
    fn add_body(&mut self, first: usize, last: usize) {
        let system = &self.nominal.systems[self.nominal.primary];
        let mut gaps = first.saturating_sub(1)..=last;
        if gaps.any(|gap| system.surfaces[gap].grin.is_some()) {
            return;
        }
        let (numbers, body) = (self.numbers, (first, last));
        let angle = (numbers.tilt / 60.0).to_radians();
        self.add(PerturbationKind::ElementDecenterX, body, numbers.decenter);
        self.add(PerturbationKind::ElementDecenterY, body, numbers.decenter);
        self.add(PerturbationKind::ElementTiltX, body, angle);
        self.add(PerturbationKind::ElementTiltY, body, angle);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tolerance::ToleranceScene;

    use crate::files::{bundled_lenses, json};

    fn sheet(name: &str) -> ToleranceSheet {
        let found = bundled_lenses().iter().find(|bundled| bundled.name == name).unwrap();
        let lens = json::read(found.text, name).unwrap();
        let scene = ToleranceScene::new(&lens, 0, 1e-2).unwrap();
        graded_sheet(&lens, &scene.lens, ToleranceGrade::Precision)
    }

    fn places(sheet: &ToleranceSheet, kind: PerturbationKind) -> Vec<(usize, usize)> {
        let errors = sheet.errors.iter().map(|tolerance| tolerance.error);
        errors.filter(|e| e.kind == kind).map(|e| (e.first, e.last)).collect()
    }

    /// A triplet has six surfaces, five gaps in front of the image and three elements.
    #[test]
    fn every_surface_gap_and_element_has_its_tolerances_once() {
        let sheet = sheet("cooke_triplet_100_f27");
        let elements = places(&sheet, PerturbationKind::ElementTiltX);
        let glasses = places(&sheet, PerturbationKind::Index);
        assert_eq!(elements.len(), 3);
        assert_eq!(glasses.len(), 3);
        for ((first, last), (glass, _)) in elements.iter().zip(&glasses) {
            assert_eq!((first, last), (glass, &(glass + 1)));
        }
        assert!(elements.windows(2).all(|pair| pair[0].1 < pair[1].0));
        for kind in [PerturbationKind::ElementDecenterX, PerturbationKind::ElementDecenterY] {
            assert_eq!(places(&sheet, kind), elements);
        }
        let refracting: Vec<(usize, usize)> =
            elements.iter().flat_map(|(a, b)| [(*a, *a), (*b, *b)]).collect();
        for kind in [PerturbationKind::Curvature, PerturbationKind::SurfaceTiltX] {
            assert_eq!(places(&sheet, kind), refracting);
        }
    }

    #[test]
    fn a_gradient_has_no_tolerance_of_its_surfaces_shape_but_of_their_power() {
        let sheet = sheet("grin_rod_melles_griot");
        assert!(!places(&sheet, PerturbationKind::Curvature).is_empty());
        assert_eq!(places(&sheet, PerturbationKind::Irregularity), []);
        assert_eq!(places(&sheet, PerturbationKind::ElementTiltX), []);
    }
}
