//! Tolerances against exact answers: lenses with errors of making that an independent program traced in more
//! digits than a double number has.
//!
//! The file holds lenses with given rays and indices; nothing clips them. Compared are points of rays, merits,
//! first and second derivatives by every error, and what is expected of lenses that are made.

use crate::lens::{
    ASPHERE_TERMS, ErrorDistribution, Perturbation, PerturbationKind, Shape, Surface, System,
    Tolerance, ToleranceSheet,
};
use crate::math::Vec3;
use crate::math::quadrature::gauss_legendre;
use crate::tolerance::{
    AsBuiltSpot, Beam, ColourRays, Derivatives, ErrorModel, FieldBeam, MeritOptions, NominalLens,
    PupilTreatment, SecondDerivatives, Sensitivity, ToleranceError, ToleranceRequest,
    ToleranceScene, analyze, merits, perturb, sensitivities,
};
use crate::trace::{Ray, Tracer};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::atomic::{AtomicBool, Ordering};

/// The lenses of a file.
#[derive(Debug, Clone, Deserialize)]
pub struct ToleranceReference {
    /// The lenses.
    pub lenses: Vec<ReferenceLens>,
}

/// A lens with its exact answers.
#[derive(Debug, Clone, Deserialize)]
pub struct ReferenceLens {
    /// Its name.
    pub id: String,
    surfaces: Vec<ReferenceSurface>,
    entrance_pupil_diameter: f64,
    z_ep: f64,
    z_xp: f64,
    fields_deg: Vec<[f64; 2]>,
    wavelengths_um: Vec<f64>,
    wavelength_weights: Vec<f64>,
    primary: usize,
    integral_error: f64,
    derivatives: Vec<ErrorAnswer>,
    cases: Vec<PerturbedAnswer>,
    exact: Vec<ExpectedAnswer>,
    as_built: AsBuiltAnswer,
}

#[derive(Debug, Clone, Deserialize)]
struct ReferenceSurface {
    radius: Option<f64>,
    conic: f64,
    asphere: Vec<f64>,
    thickness: f64,
    n: Vec<f64>,
    semi_diameter: f64,
}

#[derive(Debug, Clone, Copy, Deserialize)]
struct NamedError {
    kind: PerturbationKind,
    first: usize,
    last: usize,
}

impl From<NamedError> for Perturbation {
    fn from(NamedError { kind, first, last }: NamedError) -> Self {
        Self { kind, first, last }
    }
}

/// The first and the second derivatives by an error.
#[derive(Debug, Clone, Deserialize)]
struct ErrorAnswer {
    #[serde(flatten)]
    error: NamedError,
    mean: [f64; 2],
    mean_focused: [f64; 2],
    mean_square: Vec<[f64; 2]>,
    wavefront_variance_chief: Vec<[f64; 2]>,
    wavefront_variance_tilt_removed: Vec<[f64; 2]>,
}

/// A lens with some errors.
#[derive(Debug, Clone, Deserialize)]
struct PerturbedAnswer {
    perturbations: Vec<ValuedError>,
    rays: Vec<RayAnswer>,
    merits: MeritAnswer,
}

#[derive(Debug, Clone, Copy, Deserialize)]
struct ValuedError {
    #[serde(flatten)]
    error: NamedError,
    value: f64,
}

#[derive(Debug, Clone, Deserialize)]
struct RayAnswer {
    field: usize,
    pupil: [f64; 2],
    wavelength: usize,
    hits: Vec<[LongNumber; 3]>,
}

/// A number, as a text where it has more digits than a double number.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged)]
enum LongNumber {
    Number(f64),
    Text(String),
}

impl LongNumber {
    /// Its value; NaN for a text that is none.
    fn value(&self) -> f64 {
        match self {
            Self::Number(value) => *value,
            Self::Text(text) => text.parse().unwrap_or(f64::NAN),
        }
    }
}

#[derive(Debug, Clone, Deserialize)]
struct MeritAnswer {
    ms: Vec<LongNumber>,
    msc: Vec<LongNumber>,
    vchief: Vec<LongNumber>,
    vtilt: Vec<LongNumber>,
}

/// The expectations over two errors.
#[derive(Debug, Clone, Deserialize)]
struct ExpectedAnswer {
    perturbations: Vec<DrawnError>,
    rms: FixedAndFocused<f64>,
    quadrature_change: f64,
}

#[derive(Debug, Clone, Copy, Deserialize)]
struct DrawnError {
    #[serde(flatten)]
    error: NamedError,
    half_range: f64,
    #[serde(default)]
    distribution: Option<ErrorDistribution>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
struct FixedAndFocused<T> {
    fixed_focus: T,
    focused: T,
}

/// The lenses that are made with all tolerances, by Monte Carlo.
#[derive(Debug, Clone, Deserialize)]
struct AsBuiltAnswer {
    tolerances: Vec<DrawnError>,
    normal: MadeAnswer,
    uniform: MadeAnswer,
}

#[derive(Debug, Clone, Deserialize)]
struct MadeAnswer {
    #[serde(flatten)]
    planes: FixedAndFocused<SpotAnswer>,
}

/// Values with their standard errors.
#[derive(Debug, Clone, Deserialize)]
struct SpotAnswer {
    rms: [f64; 2],
    rms_quantiles: BTreeMap<String, [f64; 2]>,
}

/// The agreement of a lens with its exact answers.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReferenceAgreement {
    /// The name of the lens.
    pub id: String,
    /// One for each kind of answer.
    pub rows: Vec<AgreementRow>,
}

/// The agreement with some answers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AgreementRow {
    /// The kind of the answers.
    pub what: &'static str,
    /// The number of answers.
    pub answers: usize,
    /// The largest difference, in the unit that `what` names or relative.
    pub largest: f64,
    /// The difference up to which they agree.
    pub bound: f64,
}

impl AgreementRow {
    fn new(what: &'static str, bound: f64) -> Self {
        Self { what, answers: 0, largest: 0.0, bound }
    }

    /// True if all answers agree; one that is no number does not.
    pub fn agrees(&self) -> bool {
        self.largest <= self.bound
    }

    fn note(&mut self, difference: f64) {
        self.answers += 1;
        // No number is a difference without end.
        let difference = if difference.is_nan() { f64::INFINITY } else { difference.abs() };
        self.largest = self.largest.max(difference);
    }
}

/// The entry that a lens of such a file lacks.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{lens}: {what}")]
pub struct ToleranceReferenceError {
    lens: String,
    what: String,
}

impl ToleranceReference {
    /// Checks that lists have an entry for every field and wavelength.
    ///
    /// # Errors
    /// The first list that is shorter or longer, and a number that counts none of them.
    pub fn check(&self) -> Result<(), ToleranceReferenceError> {
        let with_name = |lens: &ReferenceLens| {
            let named = |what| ToleranceReferenceError { lens: lens.id.clone(), what };
            lens.check().map_err(named)
        };
        self.lenses.iter().try_for_each(with_name)
    }
}

/// Refuses a list of another length.
fn check_length(what: &str, found: usize, expected: usize) -> Result<(), String> {
    let text = || format!("{what}: found {found} entries; expected {expected}");
    (found == expected).then_some(()).ok_or_else(text)
}

/// Refuses a number that counts none of so many.
fn check_place(what: &str, found: usize, count: usize) -> Result<(), String> {
    (found < count).then_some(()).ok_or_else(|| format!("{what}: found {found} of {count}"))
}

impl ReferenceLens {
    fn check(&self) -> Result<(), String> {
        let (fields, colours) = (self.fields_deg.len(), self.wavelengths_um.len());
        check_length("wavelength_weights", self.wavelength_weights.len(), colours)?;
        check_place("primary", self.primary, colours)?;
        check_place("fields_deg", 0, fields)?;
        for surface in &self.surfaces {
            check_length("n", surface.n.len(), colours)?;
        }
        for answer in &self.derivatives {
            check_length("mean_square", answer.mean_square.len(), fields)?;
            for list in [&answer.wavefront_variance_chief, &answer.wavefront_variance_tilt_removed]
            {
                check_length("wavefront variances", list.len(), fields)?;
            }
        }
        for case in &self.cases {
            let MeritAnswer { ms, msc, vchief, vtilt } = &case.merits;
            for list in [ms, msc, vchief, vtilt] {
                check_length("merits", list.len(), fields)?;
            }
            for ray in &case.rays {
                check_place("wavelength of a ray", ray.wavelength, colours)?;
                check_place("field of a ray", ray.field, fields)?;
            }
        }
        Ok(())
    }

    /// The lens without errors.
    pub fn nominal(&self) -> NominalLens {
        NominalLens {
            systems: (0..self.wavelengths_um.len()).map(|w| self.system(w)).collect(),
            wavelengths: self.wavelengths_um.clone(),
            primary: self.primary,
            semi_diameters: self.surfaces.iter().map(|surface| surface.semi_diameter).collect(),
            rims: Vec::new(),
        }
    }

    fn system(&self, wavelength: usize) -> System<f64> {
        let surface = |own: &ReferenceSurface| {
            let curvature = own.radius.map_or(0.0, |radius| 1.0 / radius);
            let mut terms = [0.0; ASPHERE_TERMS];
            terms.iter_mut().zip(&own.asphere).for_each(|(to, from)| *to = *from);
            let shape = Shape::simplest(curvature, own.conic, terms);
            Surface { shape, ..Surface::plane(own.thickness, own.n[wavelength]) }
        };
        let mut surfaces: Vec<_> = self.surfaces.iter().map(surface).collect();
        surfaces.push(Surface::plane(0.0, 1.0));
        System { index_before: 1.0, surfaces, stop: None }
    }

    /// The quantities of its answers.
    pub fn options(&self) -> MeritOptions {
        let um = self.wavelengths_um.get(self.primary).copied().unwrap_or(1.0);
        MeritOptions { primary: self.primary, wavefront: Some((self.z_xp, um * 1e-3)) }
    }

    /// A ray of a field through a point of the unit pupil, and its optical path up to its start in mm.
    pub fn ray(&self, field: usize, [px, py]: [f64; 2]) -> (Ray<f64>, f64) {
        let angles = self.fields_deg.get(field).copied().unwrap_or_default();
        let [x, y] = angles.map(|angle| angle.to_radians().tan());
        let length = (x * x + y * y + 1.0).sqrt();
        let direction = Vec3::new(x / length, y / length, 1.0 / length);
        let half = 0.5 * self.entrance_pupil_diameter;
        let point = Vec3::new(px * half, py * half, self.z_ep);
        // Started in front of the lens: a pupil may be inside.
        let back = (point.z + 5.0) / direction.z;
        let start = point + direction * -back;
        (Ray { point: start, direction }, start.dot(direction))
    }

    /// Rays through the pupil: rings of Gauss and Legendre in r², times azimuths at half steps.
    pub fn beam(&self, (rings, azimuths): (usize, usize)) -> Beam {
        let total: f64 = self.wavelength_weights.iter().sum();
        let fields = self.fields_deg.len();
        let field = |field: usize| {
            let weights = self.wavelength_weights.iter().enumerate();
            let colours = weights
                .map(|(w, weight)| self.colour((field, w), weight / total, (rings, azimuths)));
            FieldBeam {
                weight: 1.0 / fields as f64,
                colours: colours.collect(),
                chief: self.ray(field, [0.0, 0.0]),
            }
        };
        Beam { fields: (0..fields).map(field).collect() }
    }

    fn colour(
        &self,
        (field, wavelength): (usize, usize),
        share: f64,
        (rings, azimuths): (usize, usize),
    ) -> ColourRays {
        let mut colour = ColourRays::new(wavelength);
        for (square, weight) in gauss_legendre(rings, 0.0, 1.0) {
            for j in 0..azimuths {
                let angle = 2.0 * PI * (j as f64 + 0.5) / azimuths as f64;
                let pupil = [square.sqrt() * angle.cos(), square.sqrt() * angle.sin()];
                let (ray, path) = self.ray(field, pupil);
                colour.push(ray, share * weight / azimuths as f64, pupil, path);
            }
        }
        colour
    }

    /// The lens with rays for its tolerances; nothing clips them.
    pub fn scene(&self, rule: (usize, usize)) -> ToleranceScene {
        ToleranceScene {
            lens: self.nominal(),
            beam: self.beam(rule),
            options: MeritOptions { wavefront: None, ..self.options() },
            sampling_error: 0.0,
            pupils: PupilTreatment::Held("the rays are given"),
        }
    }

    /// The agreement with the answers, by this many real lenses for expectations. `None` once `stop` is true.
    ///
    /// # Errors
    /// A lens that cannot be traced.
    pub fn agreement(
        &self,
        samples: usize,
        stop: &AtomicBool,
    ) -> Result<Option<ReferenceAgreement>, ToleranceError> {
        let mut rows = vec![self.points()?, self.merits()?];
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        rows.extend(self.derivatives()?);
        rows.push(self.swept()?);
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        rows.push(self.expectations(samples)?);
        Ok(Some(ReferenceAgreement { id: self.id.clone(), rows }))
    }

    /// The rings and azimuths at which integrals over the pupil are as exact as those of the file.
    fn rule(&self) -> (usize, usize) {
        if self.integral_error > 1e-10 { (18, 36) } else { (12, 28) }
    }

    /// The larger of a bound and what the integrals of the file are good for.
    fn bound(&self, bound: f64) -> f64 {
        bound.max(100.0 * self.integral_error)
    }

    /// The points in which rays meet surfaces that are moved, turned and bent.
    fn points(&self) -> Result<AgreementRow, ToleranceError> {
        let mut row = AgreementRow::new("points of rays, mm", 1e-9);
        for case in &self.cases {
            let systems = perturb(&self.nominal(), &case.errors())?;
            for ray in &case.rays {
                let system = &systems[ray.wavelength];
                let path = Tracer::new(system)?.polyline(self.ray(ray.field, ray.pupil).0);
                // A ray that is lost gives no answer where it does not get.
                (path.points.len() - 1..ray.hits.len()).for_each(|_| row.note(f64::INFINITY));
                for (found, hit) in path.points[1..].iter().zip(&ray.hits) {
                    let [x, y, z] = hit.each_ref().map(LongNumber::value);
                    let apart = *found - Vec3::new(x, y, z);
                    row.note(apart.dot(apart).sqrt());
                }
            }
        }
        Ok(row)
    }

    /// Spots and wavefronts of lenses with errors.
    fn merits(&self) -> Result<AgreementRow, ToleranceError> {
        let mut row = AgreementRow::new("spots and wavefronts with errors", self.bound(1e-10));
        let beam = self.beam(self.rule());
        for case in &self.cases {
            let systems = perturb(&self.nominal(), &case.errors())?;
            let found = merits(&systems, &beam, self.options())?;
            let MeritAnswer { ms, msc, vchief, vtilt } = &case.merits;
            for (i, (spot, waves)) in found.spots.iter().zip(&found.wavefronts).enumerate() {
                let pairs = [
                    (spot.a, &ms[i]),
                    (spot.at(found.focus), &msc[i]),
                    (waves.chief, &vchief[i]),
                    (waves.tilt_removed, &vtilt[i]),
                ];
                pairs.iter().for_each(|(found, exact)| row.note(found / exact.value() - 1.0));
            }
        }
        Ok(row)
    }

    /// First and second derivatives of spots, refocused spots and wavefronts by every error.
    fn derivatives(&self) -> Result<[AgreementRow; 2], ToleranceError> {
        let errors: Vec<Perturbation> =
            self.derivatives.iter().map(|answer| answer.error.into()).collect();
        let beam = self.beam(self.rule());
        let found = sensitivities(&self.nominal(), &beam, self.options(), &errors)?;
        let mut rows = [
            AgreementRow::new("first derivatives", self.bound(1e-9)),
            AgreementRow::new("second derivatives", self.bound(1e-7)),
        ];
        for (found, answer) in found.iter().zip(&self.derivatives) {
            for answer in answer.pairs(found) {
                answer.note(&mut rows);
            }
        }
        Ok(rows)
    }

    /// First derivatives of the spot by one sweep of the rays back.
    fn swept(&self) -> Result<AgreementRow, ToleranceError> {
        let tolerance = |answer: &ErrorAnswer| Tolerance {
            error: answer.error.into(),
            half_range: 1e-3,
            distribution: ErrorDistribution::Normal,
        };
        let sheet = ToleranceSheet::of_errors(self.derivatives.iter().map(tolerance).collect());
        let scene = self.scene(self.rule());
        let model = ErrorModel::new(&scene, &sheet, SecondDerivatives::Neglected, &|| false)?;
        let what = "first derivatives by the sweep back";
        let mut rows = [AgreementRow::new(what, self.bound(1e-9)), AgreementRow::new("", 0.0)];
        let form = &model.forms[0];
        for (i, answer) in self.derivatives.iter().enumerate() {
            // The second ones leave out those of rays by two errors.
            let second = answer.mean[1];
            let found = Derivatives { value: form.nominal, first: form.first[i], second };
            FoundDerivatives::of_spot(found, answer.mean).note(&mut rows);
        }
        Ok(rows[0])
    }

    /// Means and quantiles of lenses that are made, in standard errors of both.
    fn expectations(&self, samples: usize) -> Result<AgreementRow, ToleranceError> {
        let mut row = AgreementRow::new("means and quantiles as built, standard errors", 4.0);
        // The rays of the Monte Carlo of the file, and such as its expectations need.
        let (few, many) = (self.scene((5, 12)), self.scene((8, 18)));
        let request = ToleranceRequest { seed: 1, samples, limit: None };
        let AsBuiltAnswer { tolerances, normal, uniform } = &self.as_built;
        for (distribution, answer) in
            [(ErrorDistribution::Normal, normal), (ErrorDistribution::Uniform, uniform)]
        {
            let sheet = sheet(tolerances, Some(distribution));
            let found = analyze(&few, &sheet, request)?;
            let planes = [&answer.planes.fixed_focus, &answer.planes.focused];
            for (spot, answer) in found.spots.iter().zip(planes) {
                answer.compare(spot, &mut row);
            }
        }
        for answer in &self.exact {
            let found = analyze(&many, &sheet(&answer.perturbations, None), request)?;
            for (spot, exact) in
                found.spots.iter().zip([answer.rms.fixed_focus, answer.rms.focused])
            {
                let [mean, error] = spot.mean_rms;
                row.note((mean - exact) / error.hypot(answer.quadrature_change * exact));
            }
        }
        Ok(row)
    }
}

fn sheet(errors: &[DrawnError], distribution: Option<ErrorDistribution>) -> ToleranceSheet {
    let tolerance = |own: &DrawnError| Tolerance {
        error: own.error.into(),
        half_range: own.half_range,
        distribution: distribution.or(own.distribution).unwrap_or(ErrorDistribution::Normal),
    };
    ToleranceSheet::of_errors(errors.iter().map(tolerance).collect())
}

/// The rounding of a sum, as a share of its terms.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// The derivatives of a merit with their exact values.
struct FoundDerivatives {
    found: Derivatives,
    /// One of the terms of which the merit is the difference.
    part: Derivatives,
    exact: [f64; 2],
    /// The first derivative by a millimetre or a radian, as a share of the merit, up to which one is judged as one
    /// of that size: of one that symmetry makes 0 rounding is left.
    vanishing: f64,
}

/// The same share of second derivatives.
const VANISHING: f64 = 1e-3;

impl FoundDerivatives {
    fn of_spot(found: Derivatives, exact: [f64; 2]) -> Self {
        Self { found, part: found, exact, vanishing: VANISHING }
    }

    /// Those of a wavefront, whose optical paths of many wavelengths leave more rounding.
    fn of_wavefront(found: Derivatives, exact: [f64; 2]) -> Self {
        Self { vanishing: 10.0 * VANISHING, ..Self::of_spot(found, exact) }
    }

    /// Notes the first derivative relative to the larger of itself and `√|value × second|`, and the second one.
    fn note(&self, rows: &mut [AgreementRow; 2]) {
        let (found, [first, second]) = (self.found, self.exact);
        let scale = first.abs().max((found.value * second).abs().sqrt());
        let beyond = |apart: f64, part: f64| (apart.abs() - ROUNDING * part.abs()).max(0.0);
        let apart = beyond(found.first - first, self.part.first);
        rows[0].note(apart / scale.max(self.vanishing * found.value));
        let apart = beyond(found.second - second, self.part.second);
        rows[1].note(apart / second.abs().max(VANISHING * found.value));
    }
}

impl PerturbedAnswer {
    fn errors(&self) -> Vec<(Perturbation, f64)> {
        self.perturbations.iter().map(|own| (own.error.into(), own.value)).collect()
    }
}

impl ErrorAnswer {
    /// The derivatives of a lens with their exact values.
    fn pairs(&self, found: &Sensitivity) -> Vec<FoundDerivatives> {
        let (merits, fixed) = (&found.merits, found.mean_square());
        let focused = found.mean_square_focused();
        // What refocusing leaves is a difference.
        let focused = FoundDerivatives::of_spot(focused, self.mean_focused);
        let mut pairs = vec![
            FoundDerivatives::of_spot(fixed, self.mean),
            FoundDerivatives { part: fixed, ..focused },
        ];
        for (i, (spot, waves)) in merits.spots.iter().zip(&merits.wavefronts).enumerate() {
            pairs.push(FoundDerivatives::of_spot(spot.a.into(), self.mean_square[i]));
            for (found, exact) in [
                (waves.chief, self.wavefront_variance_chief[i]),
                (waves.tilt_removed, self.wavefront_variance_tilt_removed[i]),
            ] {
                pairs.push(FoundDerivatives::of_wavefront(found.into(), exact));
            }
        }
        pairs
    }
}

impl SpotAnswer {
    fn compare(&self, spot: &AsBuiltSpot, row: &mut AgreementRow) {
        let [mean, error] = spot.mean_rms;
        row.note((mean - self.rms[0]) / error.hypot(self.rms[1]));
        for quantile in &spot.quantiles {
            if let Some([exact, error]) = self.rms_quantiles.get(&quantile.share.to_string()) {
                row.note((quantile.corrected - exact) / quantile.error.hypot(*error));
            }
        }
    }
}
