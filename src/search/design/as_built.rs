//! The refinement of a designed lens as it is made: the last step of a design.
//!
//! A lens that is as sharp as possible on paper stands in a valley whose walls errors of making climb.
//! A little beside its floor the walls are often lower: the expected spot falls with the first power of
//! the step, that of the lens as designed rises with the second. The descent keeps every limit; of the
//! lenses on its way the judgement by real rays chooses.

use super::draft::LimitCost;
use super::finish::{DesignedLens, rank};
use super::judge::{JUDGEMENT_TOLERANCE, LensJudgement, judge_lens};
use super::{DesignMerit, LensRequirements, LensWish};
use crate::lens::{
    Lens, Medium, OperandKind, Parameter, ParameterKind, Quantity, TermScope, ToleranceGrade,
    add_variables,
};
use crate::merit::{Goal, LimitTreatment, PupilEdge, Term, WeightedTerm};
use crate::optimize::{DescentMethod, LimitPrice, Optimizer, start};
use crate::tolerance::{
    FocusTreatment, ToleranceError, ToleranceRequest, ToleranceScene, analyze, graded_sheet,
};
use serde::Serialize;
use std::sync::atomic::{AtomicBool, Ordering};

/// The spots of lenses that are made as a design says, each refocused, by the quadratic form of their
/// errors: RMS radii over the fields, in mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DesignedAsBuilt {
    /// The class of care in making.
    pub grade: ToleranceGrade,
    /// The radius of the lens as designed.
    pub nominal: f64,
    /// The mean radius of the lenses that are made.
    pub mean: f64,
    /// The radius that 90 % of the lenses do not exceed.
    pub within_90_percent: f64,
}

/// The steps of a refinement, and those between two judgements.
const STEPS: usize = 40;
const CHUNK: usize = 5;
/// The relative error of spots on the way.
const TOLERANCE: f64 = 2e-3;
/// The growth of the spot as designed that a refined lens may have.
const NOMINAL_GROWTH: f64 = 1.02;
/// The contrast that a refined lens may lose where it is wished for.
const CONTRAST_LOSS: f64 = 0.01;
/// The share of the mean radius that a robust lens gains at least to be one of its own.
const ROBUST_GAIN: f64 = 0.97;
/// The excess of light over what is asked for, against the error of its area on the way.
const MORE_LIGHT: f64 = 1.0005;
/// The factors of semi-diameters on the way.
const RIMS: [f64; 2] = [0.85, 1.15];
/// The longest gap, in mm.
const LONGEST: f64 = 1e6;
/// The seed of the errors of the quadratic form.
const SEED: u64 = 1;

impl DesignedAsBuilt {
    /// The spots of a lens as it is made with the tolerances of a class, with its own fields and
    /// wavelengths.
    ///
    /// # Errors
    /// A lens whose rays do not arrive.
    pub fn new(lens: &Lens, grade: ToleranceGrade) -> Result<Self, ToleranceError> {
        let scene = ToleranceScene::new(lens, 0, JUDGEMENT_TOLERANCE)?;
        let sheet = graded_sheet(lens, &scene.lens, grade);
        let request = ToleranceRequest { seed: SEED, samples: 0, limit: None };
        let analysis = analyze(&scene, &sheet, request)?;
        let refocused = |focus| focus == FocusTreatment::Refocused;
        let found = analysis.spots.iter().find(|spot| refocused(spot.focus));
        let spot = found.unwrap_or(&analysis.spots[1]);
        let most = spot.quantiles.iter().find(|quantile| quantile.share == 0.9);
        Ok(Self {
            grade,
            nominal: spot.nominal_rms,
            mean: spot.form_mean_rms,
            within_90_percent: most.map_or(f64::NAN, |quantile| quantile.form),
        })
    }
}

/// The result of a refinement.
#[derive(Debug, Clone, Default)]
pub(super) struct RefinedLens {
    /// The lens in place of the one before, whose spot as designed is hardly larger.
    pub(super) same: Option<DesignedLens>,
    /// The lens with the smallest spot as built, however much larger it is as designed.
    pub(super) robust: Option<DesignedLens>,
}

/// Refines a lens as it is made, if the requirements say how and it keeps every limit. Once `stop` is
/// true, no further step is taken.
pub(super) fn refined(
    found: &DesignedLens,
    asked: &LensRequirements,
    stop: &AtomicBool,
) -> RefinedLens {
    let mut result = RefinedLens::default();
    let (Some(grade), Some(before)) = (asked.as_built, found.as_built) else { return result };
    if !found.judgement.is_valid() {
        return result;
    }
    let start_lens = with_variables(&found.lens, asked);
    let term = Term::AsBuilt { grade: Some(grade) };
    let goal = goal(&found.lens, asked, &found.judgement, term);
    let method = DescentMethod::TrustRegion;
    let Ok(mut optimizer) = start(method, &start_lens, &goal, TOLERANCE) else { return result };
    for _ in 0..STEPS / CHUNK {
        let ended = take_steps(optimizer.as_mut(), stop);
        if let Some(next) = judged(found, optimizer.as_ref(), asked, Some(grade))
            && let Some(made) = next.as_built
        {
            let best = |so_far: &Option<DesignedLens>| {
                so_far.as_ref().and_then(|lens| lens.as_built).map_or(before.mean, |made| made.mean)
            };
            let is_near = next.judgement.rms <= NOMINAL_GROWTH * found.judgement.rms
                && next.judgement.contrast >= found.judgement.contrast.map(|c| c - CONTRAST_LOSS);
            if is_near && made.mean < best(&result.same) {
                result.same = Some(next.clone());
            }
            if made.mean < best(&result.robust) {
                result.robust = Some(next);
            }
        }
        if ended || stop.load(Ordering::Relaxed) {
            break;
        }
    }
    result
}

/// The lens refined for the contrast that is wished, if any is and if that gains some; the lens itself
/// otherwise.
pub(super) fn with_contrast(
    found: &DesignedLens,
    asked: &LensRequirements,
    stop: &AtomicBool,
) -> DesignedLens {
    let mut best = found.clone();
    let LensWish::Mtf(frequency) = asked.wish else { return best };
    if !found.judgement.is_valid() || stop.load(Ordering::Relaxed) {
        return best;
    }
    let start_lens = with_variables(&found.lens, asked);
    let term = Term::GeometricMtf { frequency, min: 1.0 };
    let goal = goal(&found.lens, asked, &found.judgement, term);
    let method = DescentMethod::TrustRegion;
    let Ok(mut optimizer) = start(method, &start_lens, &goal, TOLERANCE) else { return best };
    for _ in 0..STEPS / CHUNK {
        let ended = take_steps(optimizer.as_mut(), stop);
        let next = judged(found, optimizer.as_ref(), asked, asked.as_built);
        if let Some(next) = next.filter(|next| rank(&next.judgement) < rank(&best.judgement)) {
            best = next;
        }
        if ended || stop.load(Ordering::Relaxed) {
            break;
        }
    }
    best
}

/// The most robust of some refined lenses; `None` unless it is better as built than the best of those
/// that are listed.
pub(super) fn most_robust(refined: Vec<RefinedLens>, best: &DesignedLens) -> Option<DesignedLens> {
    let mean = |lens: &DesignedLens| lens.as_built.map_or(f64::INFINITY, |made| made.mean);
    let all = refined.into_iter().filter_map(|lens| lens.robust);
    let robust = all.min_by(|a, b| mean(a).total_cmp(&mean(b)))?;
    (mean(&robust) < ROBUST_GAIN * mean(best))
        .then_some(DesignedLens { merit: DesignMerit::Robust, ..robust })
}

/// Takes steps and verifies the best lens; true if the descent has ended.
fn take_steps(optimizer: &mut dyn Optimizer, stop: &AtomicBool) -> bool {
    let mut ended = false;
    for _ in 0..CHUNK {
        if stop.load(Ordering::Relaxed) || ended {
            break;
        }
        ended = optimizer.step().finished;
    }
    optimizer.verify_best();
    ended
}

/// The best lens of a descent with its judgement; `None` if it does not keep every limit.
fn judged(
    before: &DesignedLens,
    optimizer: &dyn Optimizer,
    asked: &LensRequirements,
    grade: Option<ToleranceGrade>,
) -> Option<DesignedLens> {
    let mut lens = optimizer.best().clone();
    lens.variables.clear();
    let judgement = judge_lens(&lens, asked, JUDGEMENT_TOLERANCE).ok()?;
    if !judgement.is_valid() {
        return None;
    }
    if let Some(last) = lens.surfaces.last_mut() {
        last.thickness += judgement.refocus;
    }
    let as_built = match grade {
        Some(grade) => Some(DesignedAsBuilt::new(&lens, grade).ok()?),
        None => None,
    };
    let (merit, origin) = (before.merit, before.origin.clone());
    // The prices are those of the objective: of spots as built if lenses are refined for them.
    let costs = match as_built {
        Some(made) if judgement.contrast.is_none() => {
            costs(optimizer.binding_limits(), made.mean, &judgement)
        }
        _ => before.costs.clone(),
    };
    Some(DesignedLens { merit, origin, judgement, as_built, costs, lens })
}

/// The lens with curvatures, gaps, aspheres and rims as variables.
fn with_variables(lens: &Lens, asked: &LensRequirements) -> Lens {
    let mut lens = Lens { merit: None, variables: Vec::new(), ..lens.clone() };
    let kinds = [
        ParameterKind::Curvatures,
        ParameterKind::Thicknesses,
        ParameterKind::Conics,
        ParameterKind::Aspheres,
        ParameterKind::SemiDiameters,
    ];
    add_variables(&mut lens, &kinds);
    let stop = lens.stop();
    let touches = |row: usize| stop.is_some_and(|stop| row == stop || row + 1 == stop);
    let rows = lens.surfaces.clone();
    for variable in &mut lens.variables {
        let Parameter { surface, quantity, .. } = variable.parameter;
        match (quantity, rows[surface].semi_diameter) {
            (Quantity::SemiDiameter, Some(rim)) => {
                variable.min = Some(RIMS[0] * rim);
                variable.max = Some((RIMS[1] * rim).min(asked.semi_diameter.max(rim)));
            }
            (Quantity::Thickness, _) if touches(surface) && surface + 1 < rows.len() => {
                variable.min = Some(rows[surface].thickness.min(asked.air_center));
            }
            _ => {}
        }
    }
    lens
}

/// The objective, and the limits of the requirements that a lens of this judgement keeps.
fn goal(lens: &Lens, asked: &LensRequirements, found: &LensJudgement, objective: Term) -> Goal {
    let mut terms = vec![
        WeightedTerm::new(objective, 1.0),
        WeightedTerm::new(Term::FocalLength(found.focal_length), 1.0),
        WeightedTerm::new(Term::BackFocus(asked.back_focus), 1.0),
        WeightedTerm::new(Term::TotalTrack(asked.track), 1.0),
        WeightedTerm::new(Term::GlassCenter { min: asked.glass_center, max: LONGEST }, 1.0),
        WeightedTerm::new(Term::GlassEdge(asked.glass_edge), 1.0),
    ];
    terms.extend(air_terms(lens, asked));
    for field in 0..found.fields.len() {
        terms.extend(field_terms(lens, asked, found, field));
    }
    let limits = LimitTreatment::Constraints;
    Goal { terms, pupil: PupilEdge::Moving, zoom_ratios: Vec::new(), limits }
}

/// The limits of gaps of air between two refracting surfaces; a diaphragm between them is none, and the
/// judgement alone measures past it.
fn air_terms(lens: &Lens, asked: &LensRequirements) -> Vec<WeightedTerm> {
    let refracts = |row: usize| {
        let before = row.checked_sub(1).map_or(&lens.object_medium, |i| &lens.surfaces[i].medium);
        *before != Medium::Air || lens.surfaces[row].medium != Medium::Air
    };
    let is_air = |row: usize| lens.surfaces[row].medium == Medium::Air;
    let inner = 0..lens.surfaces.len().saturating_sub(1);
    let between = inner.filter(|row| is_air(*row) && refracts(*row) && refracts(row + 1));
    let limited = |row: usize| {
        let scope = TermScope { surfaces: Some([row; 2]), ..TermScope::ALL };
        [Term::AirCenter { min: asked.air_center, max: LONGEST }, Term::AirEdge(0.0)]
            .map(|term| WeightedTerm { term, weight: 1.0, scope })
    };
    between.flat_map(limited).collect()
}

/// The limits of the light and the distortion of a field.
fn field_terms(
    lens: &Lens,
    asked: &LensRequirements,
    found: &LensJudgement,
    field: usize,
) -> Vec<WeightedTerm> {
    let now = &found.fields[field];
    let primary = lens.primary();
    let fields = Some([field; 2]);
    let light = TermScope { fields, wavelengths: Some([primary; 2]), ..TermScope::ALL };
    let area = asked.clear_area[field] / now.clear_area;
    let relative = asked.relative_illumination[field] / now.relative_illumination;
    // On the axis the illumination is 1 by definition.
    let share = if field == 0 { area } else { area.max(relative) };
    let term = Term::Light((MORE_LIGHT * share).min(1.0));
    let mut terms = vec![WeightedTerm { term, weight: 1.0, scope: light }];
    let scale = match (asked.object, found.magnification) {
        (Some(object), Some(magnification)) => -magnification * object.distance,
        _ => found.focal_length,
    };
    let ideal = scale * now.degrees.to_radians().tan();
    if ideal > 0.0 {
        let [min, max] = [-1.0, 1.0].map(|sign| Some(ideal * (1.0 + sign * asked.distortion)));
        let term = Term::Operand { kind: OperandKind::ChiefRayHeight, min, max };
        let scope = TermScope { fields, ..TermScope::ALL };
        terms.push(WeightedTerm { term, weight: 1.0, scope });
    }
    terms
}

/// The costs of the limits that hold a refined lens: of the expected spot, whose mean radius is given.
fn costs(prices: &[LimitPrice], mean: f64, found: &LensJudgement) -> Vec<LimitCost> {
    let is_length = |price: &&LimitPrice| price.limit.term != "light";
    let um = |price: f64| 1e3 * price.abs() / (2.0 * mean);
    let cost = |price: &LimitPrice| {
        let term = match price.limit.term {
            "chief_ray_height" => "distortion",
            term => term,
        };
        LimitCost::of_length(term, price.limit.surface, um(price.price))
    };
    let mut costs: Vec<LimitCost> = prices.iter().filter(is_length).map(cost).collect();
    // The focal length is held wherever it is; it costs only at an end of its range.
    let is_free = |margin: &super::RequirementMargin| {
        margin.limit.term == "focal_length" && margin.limit.slack() > 1e-6 * found.focal_length
    };
    if found.limits.iter().any(is_free) {
        costs.retain(|cost| cost.term != "focal_length");
    }
    costs.sort_by(|a, b| b.size().total_cmp(&a.size()));
    // A percent less light at every field at which it holds the lens.
    let of_light = prices.iter().filter(|price| !is_length(price));
    let light: f64 = of_light.map(|price| um(0.01 * price.bound * price.price)).sum();
    costs.extend((light > 0.0).then(|| LimitCost::of_light(light)));
    costs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::design::{DesignRun, DesignSettings, LensSpecification};

    fn requirements(as_built: &str) -> LensRequirements {
        let spec = format!(
            r#"{{"focal_length_mm": 60.0, "f_number": 5.0, "half_field_deg": 3.0, "max_elements": 2{as_built}}}"#
        );
        let spec: LensSpecification = serde_json::from_str(&spec).unwrap();
        LensRequirements::complete(&spec).unwrap().0
    }

    fn designed(asked: &LensRequirements, refine: bool) -> Vec<DesignedLens> {
        let settings = DesignSettings { starts: [0, 0], ..DesignSettings::with_seed(2) };
        let mut run = DesignRun::new(asked, &settings);
        let go_on = AtomicBool::new(false);
        while run.gradients() == 0 && run.advance(0.0, &go_on) {}
        run.finish(&AtomicBool::new(!refine))
    }

    #[test]
    fn a_specification_states_the_care_in_making_or_none() {
        let grade = |text: &str| requirements(text).as_built;
        assert_eq!(grade(""), Some(ToleranceGrade::Precision));
        assert_eq!(grade(r#", "as_built": "commercial""#), Some(ToleranceGrade::Commercial));
        assert_eq!(grade(r#", "as_built": "none""#), None);
        let plastics =
            r#", "glasses": "any glass of the catalogue or model plastics nd 1.53-1.67, vd 20-56""#;
        assert_eq!(grade(plastics), Some(ToleranceGrade::MouldedPlastic));
        let spec: LensSpecification = serde_json::from_str(
            r#"{"focal_length_mm": 60, "f_number": 5, "half_field_deg": 3, "as_built": "best"}"#,
        )
        .unwrap();
        let why = LensRequirements::complete(&spec).unwrap_err().to_string();
        assert!(why.contains("as_built") && why.contains("shop_limit"), "{why}");
    }

    /// The expected spot falls, that of the lens as designed grows by at most 2 %, and limits are kept.
    #[test]
    fn a_design_ends_with_lenses_that_are_refined_as_they_are_made() {
        let asked = requirements(r#", "as_built": "commercial""#);
        let (before, after) = (designed(&asked, false), designed(&asked, true));
        assert!(before[0].judgement.is_valid(), "{:?}", before[0].judgement.failures());
        let start = refined(&after[0], &asked, &AtomicBool::new(true));
        assert!(start.same.is_none_or(|lens| lens.judgement.is_valid()));
        let made = |lens: &DesignedLens| lens.as_built.unwrap();
        let best = &after[0];
        assert!(best.judgement.is_valid() && best.lens.variables.is_empty());
        assert!(
            made(best).mean < made(&before[0]).mean,
            "{:?} {:?}",
            before[0].as_built,
            best.as_built
        );
        assert!(made(best).mean > made(best).nominal);
        assert!(made(best).within_90_percent > made(best).mean);
        for robust in after.iter().filter(|lens| lens.merit == DesignMerit::Robust) {
            assert!(
                robust.judgement.is_valid() && made(robust).mean < ROBUST_GAIN * made(best).mean
            );
        }
        let alone = designed(&requirements(r#", "as_built": "none""#), true);
        assert!(alone.iter().all(|lens| lens.as_built.is_none()));
        let sharper = best.judgement.rms / alone[0].judgement.rms;
        assert!(sharper <= NOMINAL_GROWTH, "{sharper}");
    }
}
