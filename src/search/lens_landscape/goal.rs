//! The default goal of a search: (4.6) with the limits of manufacturing.

use super::LandscapeError;
use crate::lens::Lens;
use crate::merit::{Goal, PupilEdge, Term, WeightedTerm};
use crate::paraxial::{Beam, first_order};
use crate::search::SearchRules;

/// The spot radius, relative to the focal length, that the loss of all light is worth.
const LIGHT_IN_SPOT: f64 = 0.02;
/// The factor by which a lens may grow if the rules do not limit its track.
const GROWTH: f64 = 1.2;
/// The part of the back focal distance that is required if the rules do not limit it.
const ROOM: f64 = 0.8;

/// Sharp spots at a focal length in mm, at least `light` times the light of the start at every
/// field, and the limits of the rules as penalties. The focal length applies to the first zoom
/// position; the others keep their ratios to it.
///
/// # Errors
/// The lens has no first-order data.
pub fn goal(
    lens: &Lens,
    rules: &SearchRules,
    focal_length: Option<f64>,
    light: f64,
) -> Result<Goal, LandscapeError> {
    let sensible = Goal::default_for(lens)?;
    let own = sensible.terms.iter().find_map(|w| match w.term {
        Term::FocalLength(focal) => Some(focal),
        _ => None,
    });
    let track = lens.total_track();
    let focal = focal_length.or(own);
    let size = focal.map_or(track, f64::abs);
    let mut terms = vec![WeightedTerm { term: Term::Spot, weight: 1.0 }];
    terms.extend(focal.map(|f| WeightedTerm { term: Term::FocalLength(f), weight: 1e-2 }));
    terms.push(WeightedTerm { term: Term::Light(light), weight: (LIGHT_IN_SPOT * size).powi(2) });
    let rear = lens.surfaces.last().map_or(0.0, |row| row.thickness);
    let [min, max] = rules.glass_center;
    terms.push(one(Term::GlassCenter { min, max }));
    terms.push(one(Term::GlassEdge(rules.glass_edge)));
    let [min, max] = rules.air_center;
    terms.push(one(Term::AirCenter { min, max }));
    terms.push(one(Term::AirEdge(rules.air_edge)));
    terms.push(one(Term::TotalTrack(rules.track.unwrap_or(GROWTH * track))));
    terms.push(one(Term::BackFocus(rules.back_focus.unwrap_or(ROOM * rear))));
    // As if the violation were a tenth of a focal length.
    let steep = Term::Steepness(rules.steepness);
    terms.push(WeightedTerm { term: steep, weight: (0.1 * size).powi(2) });
    terms.extend(rules.semi_diameter.map(|max| one(Term::SemiDiameter { min: 0.0, max })));
    Ok(Goal { terms, pupil: PupilEdge::Moving, zoom_ratios: sensible.zoom_ratios })
}

fn one(term: Term) -> WeightedTerm {
    WeightedTerm { term, weight: 1.0 }
}

/// The focal length of a lens at its first zoom position, in mm; `None` for an afocal one.
pub(super) fn focal_length_of(lens: &Lens) -> Option<f64> {
    let system = lens.resolve(0, lens.wavelengths[lens.primary()].um).ok()?;
    let efl = first_order(&system, &Beam::for_lens(lens, 0)).ok()?.efl?;
    efl.is_finite().then_some(efl)
}

/// The reference length of a lens: its focal length, or its track if it is afocal.
pub(super) fn reference_length(lens: &Lens) -> f64 {
    focal_length_of(lens).map_or_else(|| lens.total_track(), f64::abs).max(f64::MIN_POSITIVE)
}
