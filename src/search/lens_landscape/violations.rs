//! Constraint violations of a lens, and constraints that no lens can satisfy.

use super::{LandscapeError, LensLandscape};
use crate::lens::{Lens, Medium, Object, glass};
use crate::math::format_short;
use crate::merit::{ConstraintMargin, Goal, MeritError, Term, TermValue, WeightedTerm};
use crate::search::{SearchRules, element};
use std::f64::consts::PI;

/// The relative shortfall of light within the sampling error, which does not count as a violation.
const LIGHT_TOLERANCE: f64 = 1e-3;

/// The largest violation of a limit that does not count, in its unit: penalties keep limits up to a
/// remainder that no measurement shows.
const LIMIT_TOLERANCE: f64 = 1e-6;

impl LensLandscape {
    /// The number of elements with its permitted range.
    pub(super) fn element_count_margin(&self, lens: &Lens) -> ConstraintMargin {
        let [min, max] = self.rules.elements.map(|count| Some(count as f64));
        let value = element::piece_count(lens) as f64;
        let (term, surface, field) = ("elements", None, None);
        ConstraintMargin { term, surface, field, zoom: 0, um: None, value, min, max }
    }

    /// All constraints that a lens violates, including the number of its elements and the light of
    /// its fields.
    ///
    /// # Errors
    /// The lens cannot be set up.
    pub fn violations(&self, lens: &Lens) -> Result<Vec<ConstraintMargin>, LandscapeError> {
        let dark =
            |light: &ConstraintMargin| -light.slack() > LIGHT_TOLERANCE * light.min.unwrap_or(0.0);
        let mut violated = self.limits(lens)?;
        violated.retain(|limit| limit.slack() < -LIMIT_TOLERANCE);
        violated.extend(self.light_margins(lens)?.into_iter().filter(dark));
        Ok(violated)
    }

    /// The values of the terms of the goal, by the same rays as in a search: the loss is the sum of
    /// weight times value.
    ///
    /// # Errors
    /// The lens has no merit.
    pub fn term_values(&self, lens: &Lens) -> Result<Vec<TermValue>, MeritError> {
        let merit = self.merit(lens, self.local.tolerance)?;
        merit.terms(&merit.values(lens))
    }

    /// Refuses constraints that no lens can satisfy.
    pub(super) fn check_feasible(&self) -> Result<(), LandscapeError> {
        self.check_rims()?;
        self.check_track()
    }

    /// A collimated beam is as wide at the first surface as in the first vertex plane.
    fn check_rims(&self) -> Result<(), LandscapeError> {
        let most = self.find_in_goal(|term| match term {
            Term::SemiDiameter { max, .. } => Some(max),
            _ => None,
        });
        let share = self.find_in_goal(|term| match term {
            Term::Light(share) => Some(share),
            _ => None,
        });
        let (Some(most), Some(share)) = (most, share) else { return Ok(()) };
        let light = share * self.light.iter().flatten().copied().fold(0.0, f64::max);
        let rim = (light / PI).sqrt();
        if self.start.object != Object::Infinity || most >= (1.0 - LIGHT_TOLERANCE) * rim {
            return Ok(());
        }
        let (most, light, rim) = (format_short(most), format_limit(light), format_limit(rim));
        Err(LandscapeError::Impossible(format!(
            "semi-diameters of at most {most} mm; the required light of {light} mm^2 needs {rim} mm at \
             the first surface"
        )))
    }

    /// The minimum number of elements of minimum thickness and the minimum back focal distance must
    /// fit into the track.
    fn check_track(&self) -> Result<(), LandscapeError> {
        let most = self.find_in_goal(|term| match term {
            Term::TotalTrack(max) => Some(max),
            _ => None,
        });
        let back_focus = self.find_in_goal(|term| match term {
            Term::BackFocus(min) => Some(min.max(0.0)),
            _ => None,
        });
        let thin = self.find_in_goal(|term| match term {
            Term::GlassCenter { min, .. } => Some(min),
            _ => None,
        });
        let folded = self.start.surfaces.iter().any(|row| row.medium == Medium::Mirror);
        let Some(most) = most.filter(|_| !folded) else { return Ok(()) };
        let (back_focus, thin, pieces) =
            (back_focus.unwrap_or(0.0), thin.unwrap_or(0.0), self.rules.elements[0]);
        let least = pieces as f64 * thin + back_focus;
        if most >= least {
            return Ok(());
        }
        let [most, least, back_focus, thin] = [most, least, back_focus, thin].map(format_limit);
        Err(LandscapeError::Impossible(format!(
            "a track of at most {most} mm; {pieces} pieces of glass of {thin} mm and a back focus \
             of {back_focus} mm need {least} mm"
        )))
    }

    /// The parameter of the first term of the goal that `number` recognizes.
    fn find_in_goal(&self, number: impl Fn(Term) -> Option<f64>) -> Option<f64> {
        self.goal.terms.iter().find_map(|weighted| number(weighted.term))
    }
}

/// True for a term that a search over structures can have: surfaces have no fixed numbers in it, and the
/// light of a part of the fields is not tested in a finished lens.
pub(super) fn is_of_whole_lens(weighted: &WeightedTerm) -> bool {
    let about_light = weighted.term.concerns_light() && !weighted.scope.is_all();
    weighted.scope.surfaces.is_none() && !about_light
}

/// Refuses terms about some surfaces, whose numbers change with the structure, and terms about the
/// light of a part of the fields, which a finished lens is not tested for.
pub(super) fn check_scopes(goal: &Goal) -> Result<(), LandscapeError> {
    let is_of_file = |weighted: &&WeightedTerm| weighted.term == Term::AsBuilt { grade: None };
    if goal.terms.iter().any(|weighted| is_of_file(&weighted)) {
        return Err(LandscapeError::Setting {
            what: "the term `as_built` of the merit function",
            found: "the tolerances of the lens file".to_owned(),
            expected: "those of a class (--as-built commercial) in a search over structures, whose \
                       surfaces have no fixed numbers",
        });
    }
    let refused = goal.terms.iter().find(|weighted| !is_of_whole_lens(weighted));
    refused.map_or(Ok(()), |weighted| {
        Err(LandscapeError::Setting {
            what: "the scope of a term of the merit function",
            found: format!("a part of the lens for `{}`", weighted.term.name()),
            expected: "the whole lens in a search over structures, whose surfaces have no fixed \
                       numbers",
        })
    })
}

/// The message for a violated constraint.
pub fn describe_violation(limit: &ConstraintMargin) -> String {
    let place = limit.place().map_or(String::new(), |place| format!(", {place}"));
    let zoom = if limit.zoom == 0 { String::new() } else { format!(", zoom {}", limit.zoom) };
    let (name, value) = (limit.term.replace('_', " "), format_limit(limit.value));
    let bound = match (limit.min, limit.max) {
        (Some(min), _) if limit.value < min => format!("at least {}", format_limit(min)),
        (_, Some(max)) => format!("at most {}", format_limit(max)),
        _ => "a number".to_owned(),
    };
    format!("{name}{place}{zoom}: {value} instead of {bound}")
}

/// Refuses a list of glasses none of which has an index at every wavelength of the lens.
pub(super) fn check_glasses(lens: &Lens, rules: &SearchRules) -> Result<(), LandscapeError> {
    let reaches =
        |glass: &glass::Glass| lens.wavelengths.iter().all(|w| glass.index(w.um).is_some());
    let mut listed = rules.glasses.iter().filter_map(|name| glass::find(name));
    if rules.glasses.is_empty() || listed.any(reaches) {
        return Ok(());
    }
    Err(LandscapeError::Setting {
        what: "the list of glasses",
        found: rules.glasses.join(", "),
        expected: "one with data at every wavelength of the lens",
    })
}

/// Formats a number with four decimals, without any if it is whole, or with an exponent if it is
/// very small or large.
fn format_limit(value: f64) -> String {
    let size = value.abs();
    if size < 1e9 && value.fract() == 0.0 {
        format!("{value:.0}")
    } else if (1e-3..1e9).contains(&size) {
        format!("{value:.4}")
    } else {
        format!("{value:.4e}")
    }
}
