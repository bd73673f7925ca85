//! What a search asks of a lens where the person does not say: (4.6), and what a factory can make.

use super::LandscapeError;
use crate::lens::Lens;
use crate::merit::{Goal, PupilEdge, Term, WeightedTerm};
use crate::paraxial::{Beam, first_order};
use crate::search::SearchRules;

/// The radius of a spot, relative to the focal length, that is given away for all of the light.
const LIGHT_IN_SPOT: f64 = 0.02;
/// Where the rules do not say how long a lens may be, it may grow by this factor.
const GROWTH: f64 = 1.2;
/// Where the rules do not say how much room there is behind it, this part of it stays.
const ROOM: f64 = 0.8;

/// Sharp spots at a focal length in mm, at every field at least `light` times the light of the lens
/// at the start, and the limits of the rules as penalties. The focal length of the first zoom
/// position is asked for; the others keep their ratios to it.
///
/// # Errors
/// A lens without first-order data.
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
    let track: f64 = lens.surfaces.iter().map(|row| row.thickness.abs()).sum();
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
    // A rim that stands for a tenth of a focal length.
    let steep = Term::Steepness(rules.steepness);
    terms.push(WeightedTerm { term: steep, weight: (0.1 * size).powi(2) });
    terms.extend(rules.semi_diameter.map(|max| one(Term::SemiDiameter { min: 0.0, max })));
    Ok(Goal { terms, pupil: PupilEdge::Moving, zoom_ratios: sensible.zoom_ratios })
}

fn one(term: Term) -> WeightedTerm {
    WeightedTerm { term, weight: 1.0 }
}

/// The focal length of a lens at its first zoom position, in mm; none for an afocal one.
pub(super) fn focal_length_of(lens: &Lens) -> Option<f64> {
    let system = lens.resolve(0, lens.wavelengths[lens.primary()].um).ok()?;
    let efl = first_order(&system, &Beam::for_lens(lens, 0)).ok()?.efl?;
    efl.is_finite().then_some(efl)
}

/// What lengths of a lens are compared with: its focal length, or the length of an afocal one.
pub(super) fn reference_length(lens: &Lens) -> f64 {
    let track = || lens.surfaces.iter().map(|row| row.thickness.abs()).sum::<f64>();
    focal_length_of(lens).map_or_else(track, f64::abs).max(f64::MIN_POSITIVE)
}
