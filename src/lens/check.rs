//! Checks of a lens as written, before anything is computed from it.

use super::{Aperture, FieldKind, Goal, Lens, Medium, MediumPlace, Object};
use super::{Parameter, Quantity, Row, SurfaceNumber, SystemError, Variable, ZoomNumber};
use crate::lens::glass;
use crate::math::{ShortNumber, format_short};
use std::fmt;

/// The expected value of a number that is not otherwise limited.
const FINITE: &str = "a finite number";

/// The maximum number of surfaces of a lens.
const MAX_SURFACES: usize = 1000;

/// A fault of a lens that makes it impossible to trace.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LensError {
    /// A number cannot be traced with.
    #[error(transparent)]
    System(#[from] SystemError),
    /// No surface is marked as the stop.
    #[error("no surface is the stop; expected exactly one with `\"stop\": true`")]
    NoStop,
    /// More than one surface is marked as the stop.
    #[error("surfaces {first} and {second} are both the stop; expected exactly one")]
    TwoStops {
        /// The first one.
        first: SurfaceNumber,
        /// The second one.
        second: SurfaceNumber,
    },
    /// A glass is not in the catalogue.
    #[error("unknown glass `{name}` {place}{}", suggestion(.similar))]
    UnknownGlass {
        /// The gap.
        place: MediumPlace,
        /// The name as written.
        name: String,
        /// Similar names of the catalogue.
        similar: Vec<String>,
    },
    /// The expansion of a medium, or the change of its index with temperature, is unknown.
    #[error(
        "the change of {name} {place} with temperature is unknown; expected a glass whose catalogue has it"
    )]
    NoThermalData {
        /// The gap.
        place: MediumPlace,
        /// The medium.
        name: String,
    },
    /// A wavelength lies outside the data of a glass.
    #[error(
        "{name} {place} has no index at {um} um; expected a wavelength from {low} to {high} um"
    )]
    WavelengthOutOfRange {
        /// The gap.
        place: MediumPlace,
        /// The glass.
        name: String,
        /// The wavelength, in micrometres.
        um: f64,
        /// The shortest wavelength of the data, in micrometres.
        low: f64,
        /// The longest wavelength of the data, in micrometres.
        high: f64,
    },
    /// A number is not valid for its quantity.
    #[error("{what} is {}; expected {expected}", format_short(*found))]
    InvalidNumber {
        /// The name of the number.
        what: String,
        /// The value.
        found: f64,
        /// The values that are valid.
        expected: &'static str,
    },
    /// A part of the lens is missing or contradicts another part.
    #[error("{0}")]
    Inconsistent(String),
}

fn suggestion(similar: &[String]) -> String {
    if similar.is_empty() {
        "; expected a catalogue name such as `SCHOTT N-BK7`, {\"nd\", \"vd\"} or {\"index\"}".into()
    } else {
        format!("; similar names: {}", similar.join(", "))
    }
}

pub(super) fn check_number(
    what: impl fmt::Display,
    found: f64,
    right: bool,
    expected: &'static str,
) -> Result<(), LensError> {
    if right && found.is_finite() {
        Ok(())
    } else {
        Err(LensError::InvalidNumber { what: what.to_string(), found, expected })
    }
}

/// The reason why a variable is not within its bounds, which it names. A curvature is told as a radius, too,
/// which is how the window shows it.
fn beyond_bounds(variable: &Variable, value: f64) -> String {
    let [value_text, low, high] = [Some(value), variable.min, variable.max]
        .map(|number| number.map(|number| ShortNumber(number).to_string()));
    let bounds = match (low, high) {
        (Some(low), Some(high)) => format!("{low} to {high}"),
        (Some(low), None) => format!("at least {low}"),
        (None, Some(high)) => format!("at most {high}"),
        (None, None) => "a finite number".to_owned(),
    };
    let is_curvature = variable.parameter.quantity == Quantity::Curvature && value != 0.0;
    let radius = if is_curvature {
        format!(", a radius of {} mm", ShortNumber(1.0 / value))
    } else {
        String::new()
    };
    let value = value_text.unwrap_or_default();
    format!("{} is {value}{radius}; expected {bounds}, its bounds", variable.parameter)
}

impl Lens {
    /// Checks that the lens can be traced.
    ///
    /// # Errors
    /// The first fault found.
    pub fn check(&self) -> Result<(), LensError> {
        if self.surfaces.is_empty() {
            return Err(SystemError::NoSurfaces.into());
        }
        if self.surfaces.len() > MAX_SURFACES {
            let text = format!("{} surfaces; expected at most {MAX_SURFACES}", self.surfaces.len());
            return Err(LensError::Inconsistent(text));
        }
        self.check_stop()?;
        self.environment.check()?;
        self.check_rows()?;
        self.check_object()?;
        self.check_wavelengths()?;
        self.check_fields()?;
        self.check_zoom()?;
        self.check_variables()?;
        self.check_pickups()?;
        let sheet = self.tolerances.as_ref();
        sheet.map_or(Ok(()), |sheet| sheet.check(self.surfaces.len()))?;
        self.merit.as_ref().map_or(Ok(()), Goal::check_numbers)
    }

    fn check_stop(&self) -> Result<(), LensError> {
        let mut stops = self.surfaces.iter().enumerate().filter(|(_, row)| row.stop);
        let Some((first, _)) = stops.next() else { return Err(LensError::NoStop) };
        match stops.next() {
            Some((second, _)) => {
                Err(LensError::TwoStops { first: first.into(), second: second.into() })
            }
            None => Ok(()),
        }
    }

    fn check_rows(&self) -> Result<(), LensError> {
        for (i, row) in self.surfaces.iter().enumerate() {
            row.check(i)?;
            check_medium(MediumPlace::behind(i), &row.medium)?;
            self.check_grin(i)?;
        }
        if let Medium::Grin(_) = self.object_medium {
            let text = "object space is a GRIN medium; expected air, a glass or an index";
            return Err(LensError::Inconsistent(text.into()));
        }
        check_medium(MediumPlace::Object, &self.object_medium)
    }

    /// Checks that a GRIN medium is followed by a surface that it may touch, whether its index varies
    /// or not.
    fn check_grin(&self, i: usize) -> Result<(), LensError> {
        let Medium::Grin(grin) = &self.surfaces[i].medium else { return Ok(()) };
        let why = grin.fault().or_else(|| match self.surfaces.get(i + 1) {
            None => Some("leads to the image; expected a surface behind it".to_owned()),
            Some(next) if next.medium == Medium::Mirror => {
                Some("ends at a mirror, which is not supported".to_owned())
            }
            Some(next) if next.hyperhemisphere || self.surfaces[i].hyperhemisphere => {
                Some("touches a hyperhemisphere, which is not supported".to_owned())
            }
            Some(_) => None,
        });
        why.map_or(Ok(()), |why| Err(SystemError::Grin { surface: i.into(), why }.into()))
    }

    fn check_object(&self) -> Result<(), LensError> {
        if let Object::Finite(distance) = self.object {
            check_number(
                "object distance",
                distance,
                distance != 0.0,
                "a finite number other than 0",
            )?;
        }
        check_aperture(self.aperture, self.object)
    }

    fn check_wavelengths(&self) -> Result<(), LensError> {
        if self.wavelengths.is_empty() {
            return Err(LensError::Inconsistent("no wavelengths; expected at least one".into()));
        }
        if self.wavelengths.iter().filter(|w| w.primary).count() > 1 {
            let text = "two wavelengths are primary; expected one";
            return Err(LensError::Inconsistent(text.into()));
        }
        for w in &self.wavelengths {
            check_number("wavelength", w.um, w.um > 0.0 && w.um < 1e3, "micrometres above 0")?;
            check_number("wavelength weight", w.weight, w.weight >= 0.0, "zero or more")?;
        }
        let sum: f64 = self.wavelengths.iter().map(|w| w.weight).sum();
        check_number("sum of the wavelength weights", sum, sum > 0.0, "more than 0")
    }

    fn check_fields(&self) -> Result<(), LensError> {
        for zoom in 0..self.zoom_positions() {
            let fields = self.fields_at(zoom);
            if fields.values.is_empty() {
                return Err(LensError::Inconsistent("no fields; expected at least one".into()));
            }
            if fields.kind == FieldKind::ObjectHeight && self.object == Object::Infinity {
                let text =
                    "fields are object heights, but the object is at infinity; expected angles";
                return Err(LensError::Inconsistent(text.into()));
            }
            for field in &fields.values {
                check_number("field x", field.x, true, FINITE)?;
                check_number("field y", field.y, true, FINITE)?;
                check_number("field weight", field.weight, field.weight >= 0.0, "zero or more")?;
                if fields.kind == FieldKind::Angle {
                    let angle = field.x.hypot(field.y);
                    check_number("field angle", angle, angle < 180.0, "less than 180 degrees")?;
                }
            }
        }
        Ok(())
    }

    fn check_zoom(&self) -> Result<(), LensError> {
        for (i, position) in self.zoom.iter().enumerate() {
            for (k, own) in position.numbers.iter().enumerate() {
                self.check_zoom_number(i, own)?;
                let same = |other: &ZoomNumber| {
                    (other.surface, other.quantity) == (own.surface, own.quantity)
                };
                if position.numbers[..k].iter().any(same) {
                    let twice = Parameter::at_zoom(own.surface, own.quantity, i);
                    let text = format!("two numbers for the {twice}; expected one");
                    return Err(LensError::Inconsistent(text));
                }
            }
            if let Some(aperture) = position.aperture {
                check_aperture(aperture, self.object)?;
            }
            if position.numbers.iter().any(|own| own.quantity != Quantity::Thickness) {
                let mut there = self.clone();
                there.take_numbers_of(i);
                there.check_rows()?;
            }
        }
        Ok(())
    }

    fn check_zoom_number(&self, zoom: usize, own: &ZoomNumber) -> Result<(), LensError> {
        let whose = format!("zoom position {zoom}");
        self.row_exists(own.surface, &whose)?;
        let parameter = Parameter::at_zoom(own.surface, own.quantity, zoom);
        check_number(parameter, own.value, true, FINITE)?;
        self.parameter_exists(parameter, &whose)?;
        let is_aperture = matches!(self.aperture_at(zoom), Aperture::StopSemiDiameter(_));
        let sets_stop = own.quantity == Quantity::SemiDiameter && self.surfaces[own.surface].stop;
        if sets_stop && is_aperture {
            let text = format!("the {parameter} differs; expected the aperture of the position");
            return Err(LensError::Inconsistent(text));
        }
        Ok(())
    }

    fn check_variables(&self) -> Result<(), LensError> {
        for variable in &self.variables {
            self.parameter_exists(variable.parameter, "a variable")?;
            let (min, max) = (variable.min, variable.max);
            let value = self.get(variable.parameter).unwrap_or(0.0);
            let name = variable.parameter;
            if let (Some(low), Some(high)) = (min, max) {
                let what = format_args!("lower bound of the {name}");
                check_number(what, low, low <= high, "at most the upper bound")?;
            }
            let inside = min.is_none_or(|low| value >= low) && max.is_none_or(|high| value <= high);
            if value.is_finite() && !inside {
                return Err(LensError::Inconsistent(beyond_bounds(variable, value)));
            }
            check_number(name, value, inside, "a value between its bounds")?;
        }
        Ok(())
    }

    fn check_pickups(&self) -> Result<(), LensError> {
        for (i, pickup) in self.pickups.iter().enumerate() {
            self.parameter_exists(pickup.parameter, "a pickup")?;
            self.parameter_exists(pickup.source, "a pickup")?;
            check_number("pickup scale", pickup.scale, true, FINITE)?;
            check_number("pickup offset", pickup.offset, true, FINITE)?;
            if self.pickups[..i].iter().any(|other| other.parameter == pickup.parameter) {
                let text = format!("two pickups set the {}; expected one", pickup.parameter);
                return Err(LensError::Inconsistent(text));
            }
            if self.variable(pickup.parameter).is_some() {
                let text = format!("the {} is both a variable and a pickup", pickup.parameter);
                return Err(LensError::Inconsistent(text));
            }
        }
        self.pickup_order().map(drop)
    }

    fn row_exists(&self, surface: usize, whose: &str) -> Result<(), LensError> {
        if surface < self.surfaces.len() {
            return Ok(());
        }
        let (surface, rows) = (SurfaceNumber::new(surface), self.surfaces.len());
        let text = format!("{whose} names surface {surface}; expected 1 to {rows}");
        Err(LensError::Inconsistent(text))
    }

    fn parameter_exists(&self, parameter: Parameter, whose: &str) -> Result<(), LensError> {
        self.row_exists(parameter.surface, whose)?;
        if self.get(parameter).is_some() {
            return Ok(());
        }
        let text = format!("{whose} names the {parameter}, which this lens does not have");
        Err(LensError::Inconsistent(text))
    }
}

impl Row {
    /// Checks the numbers of the row with index `i`, but for its medium.
    fn check(&self, i: usize) -> Result<(), LensError> {
        let surface = SurfaceNumber::new(i);
        let named = |quantity| Parameter::new(i, quantity);
        check_number(named(Quantity::Curvature), self.curvature, true, FINITE)?;
        check_number(named(Quantity::Conic), self.conic, true, FINITE)?;
        check_number(named(Quantity::Thickness), self.thickness, true, FINITE)?;
        let found = self.asphere.len();
        if found > super::ASPHERE_TERMS {
            return Err(SystemError::TooManyTerms { surface, found }.into());
        }
        for (term, a) in self.asphere.iter().enumerate() {
            check_number(named(Quantity::Asphere(term)), *a, true, FINITE)?;
        }
        self.check_freeform(surface)?;
        if let Some(sd) = self.semi_diameter {
            check_number(named(Quantity::SemiDiameter), sd, sd >= 0.0, "zero or more, in mm")?;
        }
        for (what, values, limit) in
            [("decenter", self.decenter, f64::INFINITY), ("tilt", self.tilt, 90.0)]
        {
            for found in values {
                let what = format_args!("{what} of surface {surface}");
                check_number(what, found, found.abs() < limit, "mm, or less than 90 degrees")?;
            }
        }
        for axis in [self.break_before, self.break_after].into_iter().flatten() {
            let place = format_args!("break of the axis at surface {surface}").to_string();
            axis.decenter.iter().try_for_each(|v| check_number(&place, *v, true, FINITE))?;
            let turn = |v: &f64| check_number(&place, *v, v.abs() <= 360.0, "at most 360 degrees");
            axis.tilt.iter().try_for_each(turn)?;
        }
        super::surface_aperture::check_apertures(&self.apertures, surface)?;
        let Some(inner) = self.obstruction else { return Ok(()) };
        let transmits = self.semi_diameter.is_none_or(|sd| inner == 0.0 || inner < sd);
        let expected = "zero or more and less than the semi-diameter, in mm";
        let what = format_args!("obstruction of surface {surface}");
        check_number(what, inner, inner >= 0.0 && transmits, expected)
    }

    fn check_freeform(&self, surface: SurfaceNumber) -> Result<(), LensError> {
        if self.locked.is_some() && (self.freeform.is_some() || self.ideal.is_some()) {
            let why = "is locked and has a freeform or a rule beside; expected one of them, since \
                       nobody knows what a locked surface is";
            return Err(LensError::Inconsistent(format!("surface {surface} {why}")));
        }
        if let Some(why) = self.ideal.and_then(|ideal| ideal.fault(self)) {
            return Err(LensError::Inconsistent(format!("surface {surface}: {why}")));
        }
        let Some(form) = &self.freeform else { return Ok(()) };
        let far = "a freeform has no far half, but the surface is a hyperhemisphere".to_owned();
        let why = form.fault().or(self.hyperhemisphere.then_some(far));
        why.map_or(Ok(()), |why| Err(LensError::Inconsistent(format!("surface {surface}: {why}"))))
    }
}

fn check_medium(place: MediumPlace, medium: &Medium) -> Result<(), LensError> {
    match medium {
        Medium::Air | Medium::Mirror => Ok(()),
        Medium::Glass(name) if glass::find(name).is_some() => Ok(()),
        Medium::Glass(name) => {
            let similar = glass::similar_names(name);
            Err(LensError::UnknownGlass { place, name: name.clone(), similar })
        }
        Medium::Model { nd, vd } => {
            let expected = "a positive index below 10";
            check_number(format_args!("nd {place}"), *nd, *nd > 0.0 && *nd < 10.0, expected)?;
            let expected = "0 (no dispersion) or more than 1";
            check_number(format_args!("vd {place}"), *vd, *vd == 0.0 || *vd > 1.0, expected)
        }
        Medium::Index(n) => {
            check_number(format_args!("index {place}"), *n, *n > 0.0, "a positive number")
        }
        Medium::Grin(grin) => check_medium(place, &grin.base),
    }
}

fn check_aperture(aperture: Aperture, object: Object) -> Result<(), LensError> {
    let positive = "more than 0";
    match aperture {
        Aperture::EntrancePupilDiameter(v) => {
            check_number("entrance pupil diameter", v, v > 0.0, positive)
        }
        Aperture::FNumber(v) => check_number("f-number", v, v > 0.0, positive),
        Aperture::StopSemiDiameter(v) => {
            check_number("semi-diameter of the stop", v, v >= 0.0, "zero or more, in mm")
        }
        Aperture::ObjectNa(v) => {
            if object == Object::Infinity {
                let text = "the aperture is an object NA, but the object is at infinity";
                return Err(LensError::Inconsistent(text.into()));
            }
            check_number("object NA", v, v > 0.0, positive)
        }
    }
}
