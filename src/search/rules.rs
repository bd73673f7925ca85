//! The constraints of a search: permitted changes, and the limits of manufacturing.

use super::MutationKind;
use crate::lens::glass;
use crate::math::format_short;
use crate::merit::{ConstraintMargin, GoalLimits, MAX_STEEPNESS};
use serde::{Deserialize, Serialize};

/// Permitted changes of a lens and the limits of manufacturing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SearchRules {
    /// The minimum and maximum number of glass elements. A search that starts outside this range
    /// moves towards it: of two lenses the one nearer to the range is better.
    pub elements: [usize; 2],
    /// The glasses of new elements and of a finalized lens, by manufacturer and name, or by name
    /// alone where it is unique. An empty list permits the whole catalogue.
    pub glasses: Vec<String>,
    /// The number of surfaces at the front and at the rear that mutations leave unchanged. They are
    /// counted from the ends, so that they stay the same while elements are added and removed
    /// between them.
    #[serde(rename = "kept")]
    pub fixed_ends: [usize; 2],
    /// Relative frequencies of the kinds of mutation; a kind that is not listed has weight 1, and
    /// weight 0 excludes it.
    pub weights: Vec<(MutationKind, f64)>,
    /// True to make each mutated lens paraxially equivalent to the original (section 4.5).
    pub projection: bool,
    /// The minimum and maximum centre thickness of glass, in mm.
    pub glass_center: [f64; 2],
    /// The minimum edge thickness of glass, in mm.
    pub glass_edge: f64,
    /// The minimum and maximum air space on the axis, in mm.
    pub air_center: [f64; 2],
    /// The minimum air space at the edge, in mm.
    pub air_edge: f64,
    /// The maximum `|curvature| × semi-diameter`; 1 is a hemisphere.
    pub steepness: f64,
    /// The maximum semi-diameter, in mm; `None` permits whatever the neighbouring surfaces leave
    /// room for.
    pub semi_diameter: Option<f64>,
    /// The maximum total track, from the first vertex to the image, in mm.
    pub track: Option<f64>,
    /// The minimum back focal distance, in mm.
    pub back_focus: Option<f64>,
    /// The largest number of aspheric surfaces; 0 for a search that adds none. One counts as half an
    /// element.
    #[serde(skip_serializing_if = "is_zero")]
    pub aspheres: usize,
    /// True to add elements at saddle points of the merit.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub saddles: bool,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "the form that serde asks for")]
fn is_zero(count: &usize) -> bool {
    *count == 0
}

impl Default for SearchRules {
    fn default() -> Self {
        Self {
            elements: [2, 8],
            glasses: Vec::new(),
            fixed_ends: [0, 0],
            weights: Vec::new(),
            projection: true,
            glass_center: [1.0, 30.0],
            glass_edge: 0.8,
            air_center: [0.1, 100.0],
            air_edge: 0.05,
            steepness: MAX_STEEPNESS,
            semi_diameter: None,
            track: None,
            back_focus: None,
            aspheres: 0,
            saddles: false,
        }
    }
}

impl SearchRules {
    /// The limits of the default goal.
    pub fn goal_limits(&self) -> GoalLimits {
        GoalLimits {
            glass_center: self.glass_center,
            glass_edge: self.glass_edge,
            air_center: self.air_center,
            air_edge: self.air_edge,
            steepness: self.steepness,
            semi_diameter: self.semi_diameter,
            track: self.track,
            back_focus: self.back_focus,
        }
    }

    /// The number of these rules that a lens breaks with a constrained quantity; `None` if no rule is about
    /// it.
    pub fn broken_rule(&mut self, limit: &ConstraintMargin) -> Option<&mut f64> {
        let is_small = limit.min.is_some_and(|min| limit.value < min);
        match (limit.term, is_small) {
            ("glass_center", true) => Some(&mut self.glass_center[0]),
            ("glass_center", false) => Some(&mut self.glass_center[1]),
            ("glass_edge", true) => Some(&mut self.glass_edge),
            ("air_center", true) => Some(&mut self.air_center[0]),
            ("air_center", false) => Some(&mut self.air_center[1]),
            ("air_edge", true) => Some(&mut self.air_edge),
            ("steepness", false) => Some(&mut self.steepness),
            ("semi_diameter", false) => self.semi_diameter.as_mut(),
            ("total_track", false) => self.track.as_mut(),
            ("back_focus", true) => self.back_focus.as_mut(),
            _ => None,
        }
    }

    /// Loosens the rule that a lens breaks until it does not, by thousandths of a millimetre; surfaces that
    /// cross are never allowed.
    pub fn admit(&mut self, limit: &ConstraintMargin) {
        let is_small = limit.min.is_some_and(|min| limit.value < min);
        if let Some(bound) = self.broken_rule(limit) {
            let thousandths = 1e3 * limit.value;
            let whole = if is_small { thousandths.floor() } else { thousandths.ceil() };
            let admitted = (whole / 1e3).max(0.0);
            *bound = if is_small { bound.min(admitted) } else { bound.max(admitted) };
        }
    }

    /// The relative frequency of a kind of mutation; 0 for those about aspheric surfaces where none is
    /// permitted.
    pub fn weight(&self, kind: MutationKind) -> f64 {
        if kind.is_about_aspheres() && self.aspheres == 0 {
            return 0.0;
        }
        let listed = self.weights.iter().find(|(listed, _)| *listed == kind);
        listed.map_or(1.0, |(_, weight)| *weight)
    }

    /// Gives a kind of mutation the weight 0.
    pub fn exclude(&mut self, kind: MutationKind) {
        self.weights.retain(|(listed, _)| *listed != kind);
        self.weights.push((kind, 0.0));
    }

    /// The same rules restricted to mutations of the surfaces `first` to `last` of a lens with
    /// `rows` surfaces.
    #[must_use]
    pub fn restricted_to(mut self, first: usize, last: usize, rows: usize) -> Self {
        self.fixed_ends = [first, rows.saturating_sub(last + 1)];
        self
    }

    /// True if mutations may change a surface of a lens with `rows` surfaces.
    pub fn may_change(&self, surface: usize, rows: usize) -> bool {
        surface >= self.fixed_ends[0] && surface + self.fixed_ends[1] < rows
    }

    /// The same rules with the default range of elements widened to include `pieces` and the price of the
    /// permitted aspheric surfaces; a range that was set explicitly is kept.
    #[must_use]
    pub fn admit_element_count(mut self, pieces: usize) -> Self {
        if self.elements == Self::default().elements {
            let [min, max] = self.elements;
            self.elements = [min.min(pieces), max.max(pieces + self.aspheres.div_ceil(2))];
        }
        self
    }

    /// True if a glass of the catalogue, given by its full name, is permitted.
    pub fn allows_glass(&self, glass: &str) -> bool {
        self.glasses.is_empty() || self.glasses.iter().any(|listed| listed == glass)
    }

    /// Checks the rules and replaces every glass by its full name, without duplicates.
    ///
    /// # Errors
    /// The first invalid rule.
    pub fn normalize(&self) -> Result<Self, RuleError> {
        self.check_elements()?;
        self.check_weights()?;
        self.check_sizes()?;
        let mut glasses: Vec<String> = Vec::new();
        for (i, name) in self.glasses.iter().enumerate() {
            let full = full_name(i, name)?;
            if !glasses.contains(&full) {
                glasses.push(full);
            }
        }
        Ok(Self { glasses, ..self.clone() })
    }

    /// Checks that a lens with `rows` surfaces has as many as stay fixed at its ends.
    ///
    /// # Errors
    /// More surfaces are named than there are.
    pub fn check_fixed_ends(&self, rows: usize) -> Result<(), RuleError> {
        let [front, rear] = self.fixed_ends;
        if front <= rows && rear <= rows - front {
            return Ok(());
        }
        let expected = format!("no more surfaces than the {rows} of the lens, both ends together");
        Err(RuleError::new("kept", format!("[{front}, {rear}]"), expected))
    }

    fn check_elements(&self) -> Result<(), RuleError> {
        let [min, max] = self.elements;
        if min <= max && max > 0 {
            return Ok(());
        }
        let expected = "two numbers, the smaller one first and the larger one above 0";
        Err(RuleError::new("elements", format!("[{min}, {max}]"), expected))
    }

    fn check_weights(&self) -> Result<(), RuleError> {
        for (i, (kind, weight)) in self.weights.iter().enumerate() {
            let name = format!("the weight of {}", kind.name());
            if !(*weight >= 0.0 && weight.is_finite()) {
                return Err(RuleError::new(name, format_short(*weight), "0 or more"));
            }
            if *kind == MutationKind::Global && *weight != 0.0 {
                let expected = "0, which forbids it; gamma says how often it is tried";
                return Err(RuleError::new(name, format_short(*weight), expected));
            }
            if self.weights[..i].iter().any(|(before, _)| before == kind) {
                return Err(RuleError::new(name, "listed twice", "one weight for each kind"));
            }
        }
        Ok(())
    }

    fn check_sizes(&self) -> Result<(), RuleError> {
        for (name, [min, max]) in
            [("glass_center", self.glass_center), ("air_center", self.air_center)]
        {
            if !(0.0 <= min && min <= max && max.is_finite()) {
                let found = format!("[{}, {}]", format_short(min), format_short(max));
                let expected = "two lengths of 0 or more in mm, the smaller one first";
                return Err(RuleError::new(name, found, expected));
            }
        }
        let least = [("glass_edge", Some(self.glass_edge)), ("air_edge", Some(self.air_edge))];
        for (name, value) in least.into_iter().chain([("back_focus", self.back_focus)]) {
            if let Some(value) = value.filter(|v| !(*v >= 0.0 && v.is_finite())) {
                return Err(RuleError::new(
                    name,
                    format_short(value),
                    "a length of 0 or more in mm",
                ));
            }
        }
        let most = [("semi_diameter", self.semi_diameter), ("track", self.track)];
        for (name, value) in most.into_iter().chain([("steepness", Some(self.steepness))]) {
            if let Some(value) = value.filter(|v| !(*v > 0.0 && v.is_finite())) {
                return Err(RuleError::new(name, format_short(value), "a number above 0"));
            }
        }
        Ok(())
    }
}

/// The full name of the glass at index `i` of the list.
fn full_name(i: usize, name: &str) -> Result<String, RuleError> {
    if let Some(found) = glass::find(name) {
        return Ok(found.full_name());
    }
    let similar = glass::similar_names(name);
    let expected = if similar.is_empty() {
        "maker and name of a glass of the catalogue, like SCHOTT N-BK7".to_owned()
    } else {
        format!("maker and name of one glass of the catalogue, perhaps {}", similar.join(" or "))
    };
    Err(RuleError::new(format!("glasses[{i}]"), format!("`{name}`"), expected))
}

/// An invalid rule.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("rules: {name} is {found}; expected {expected}")]
pub struct RuleError {
    /// The rule.
    pub name: String,
    /// Its value.
    pub found: String,
    /// The valid values.
    pub expected: String,
}

impl RuleError {
    fn new(name: impl Into<String>, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { name: name.into(), found: found.into(), expected: expected.into() }
    }
}
