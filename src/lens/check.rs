//! What a lens must be before anything is computed from it.

use super::{Aperture, FieldKind, Lens, Medium, Object, Parameter, Quantity, SystemError};
use crate::lens::glass;
use crate::math::format_short;

/// Why a lens cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LensError {
    /// The numbers themselves.
    #[error(transparent)]
    System(#[from] SystemError),
    /// No row is the stop.
    #[error("no surface is the stop; expected exactly one with `\"stop\": true`")]
    NoStop,
    /// More than one row is the stop.
    #[error("surfaces {first} and {second} are both the stop; expected exactly one")]
    TwoStops {
        /// The first one.
        first: usize,
        /// The second one.
        second: usize,
    },
    /// A glass that the catalogue does not have.
    #[error("surface {surface}: unknown glass `{name}`{}", suggestion(.similar))]
    UnknownGlass {
        /// The row.
        surface: usize,
        /// The name.
        name: String,
        /// Names that look like it.
        similar: Vec<String>,
    },
    /// A wavelength for which a glass has no formula.
    #[error(
        "surface {surface}: {name} has no index at {um} um; its data end at {low} and {high} um"
    )]
    WavelengthOutOfRange {
        /// The row.
        surface: usize,
        /// The glass.
        name: String,
        /// The wavelength.
        um: f64,
        /// Where its data begin.
        low: f64,
        /// Where they end.
        high: f64,
    },
    /// A number that makes no sense where it stands.
    #[error("{what} is {}; expected {expected}", format_short(*found))]
    InvalidNumber {
        /// What it is.
        what: String,
        /// The value.
        found: f64,
        /// What would be right.
        expected: &'static str,
    },
    /// Something is missing or contradicts something else.
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

fn check_number(
    what: impl Into<String>,
    found: f64,
    right: bool,
    expected: &'static str,
) -> Result<(), LensError> {
    if right && found.is_finite() {
        Ok(())
    } else {
        Err(LensError::InvalidNumber { what: what.into(), found, expected })
    }
}

impl Lens {
    /// Refuses a lens that cannot be traced, and says where and why.
    pub fn check(&self) -> Result<(), LensError> {
        if self.surfaces.is_empty() {
            return Err(SystemError::NoSurfaces.into());
        }
        self.check_stop()?;
        self.check_rows()?;
        self.check_object()?;
        self.check_wavelengths()?;
        self.check_fields()?;
        self.check_zoom()?;
        self.check_variables()?;
        self.check_pickups()
    }

    fn check_stop(&self) -> Result<(), LensError> {
        let mut stops = self.surfaces.iter().enumerate().filter(|(_, row)| row.stop);
        let Some((first, _)) = stops.next() else { return Err(LensError::NoStop) };
        match stops.next() {
            Some((second, _)) => Err(LensError::TwoStops { first, second }),
            None => Ok(()),
        }
    }

    fn check_rows(&self) -> Result<(), LensError> {
        for (i, row) in self.surfaces.iter().enumerate() {
            check_number(
                format!("curvature of surface {i}"),
                row.curvature,
                true,
                "a finite number",
            )?;
            check_number(
                format!("conic constant of surface {i}"),
                row.conic,
                true,
                "a finite number",
            )?;
            check_number(
                format!("thickness after surface {i}"),
                row.thickness,
                true,
                "a finite number",
            )?;
            if row.asphere.len() > super::ASPHERE_TERMS {
                return Err(
                    SystemError::TooManyTerms { surface: i, found: row.asphere.len() }.into()
                );
            }
            for a in &row.asphere {
                let what = format!("asphere coefficient of surface {i}");
                check_number(what, *a, true, "a finite number")?;
            }
            if let Some(sd) = row.semi_diameter {
                let what = format!("semi-diameter of surface {i}");
                check_number(what, sd, sd >= 0.0, "zero or more, in mm")?;
            }
            if let Some(inner) = row.obstruction {
                let what = format!("obstruction of surface {i}");
                let leaves_light = row.semi_diameter.is_none_or(|sd| inner == 0.0 || inner < sd);
                let expected = "zero or more and less than the semi-diameter, in mm";
                check_number(what, inner, inner >= 0.0 && leaves_light, expected)?;
            }
            check_medium(i, &row.medium)?;
            self.check_grin(i)?;
        }
        if let Medium::Grin(_) = self.object_medium {
            let text = "the space of the object is a gradient; expected air, a glass or an index";
            return Err(LensError::Inconsistent(text.into()));
        }
        check_medium(0, &self.object_medium)
    }

    /// A gradient needs a face at either end, whether it varies or not.
    fn check_grin(&self, i: usize) -> Result<(), LensError> {
        let Medium::Grin(gradient) = &self.surfaces[i].medium else { return Ok(()) };
        let why = gradient.fault().or_else(|| match self.surfaces.get(i + 1) {
            None => Some("leads to the image; expected a surface behind it".to_owned()),
            Some(next) if next.medium == Medium::Mirror => {
                Some("ends at a mirror, which is not supported".to_owned())
            }
            Some(next) if next.hyperhemisphere || self.surfaces[i].hyperhemisphere => {
                Some("touches a hyper-hemisphere, which is not supported".to_owned())
            }
            Some(_) => None,
        });
        why.map_or(Ok(()), |why| Err(SystemError::Grin { surface: i, why }.into()))
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
                check_number("field x", field.x, true, "a finite number")?;
                check_number("field y", field.y, true, "a finite number")?;
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
            for gap in &position.thicknesses {
                self.row_exists(gap.surface, &format!("zoom position {i}"))?;
                let what = format!("thickness after surface {} at zoom {i}", gap.surface);
                check_number(what, gap.thickness, true, "a finite number")?;
            }
            if let Some(aperture) = position.aperture {
                check_aperture(aperture, self.object)?;
            }
        }
        Ok(())
    }

    fn check_variables(&self) -> Result<(), LensError> {
        for variable in &self.variables {
            self.parameter_exists(variable.parameter, "a variable")?;
            let (min, max) = (variable.min, variable.max);
            let value = self.get(variable.parameter).unwrap_or(0.0);
            let name = variable.parameter.to_string();
            if let (Some(low), Some(high)) = (min, max) {
                check_number(
                    format!("lower bound of the {name}"),
                    low,
                    low <= high,
                    "at most the upper",
                )?;
            }
            let inside = min.is_none_or(|low| value >= low) && max.is_none_or(|high| value <= high);
            check_number(name, value, inside, "a value between its bounds")?;
        }
        Ok(())
    }

    fn check_pickups(&self) -> Result<(), LensError> {
        for (i, pickup) in self.pickups.iter().enumerate() {
            self.parameter_exists(pickup.parameter, "a pickup")?;
            self.parameter_exists(pickup.source, "a pickup")?;
            check_number("pickup scale", pickup.scale, true, "a finite number")?;
            check_number("pickup offset", pickup.offset, true, "a finite number")?;
            if self.pickups[..i].iter().any(|other| other.parameter == pickup.parameter) {
                let text = format!("two pickups set the {}; expected one", pickup.parameter);
                return Err(LensError::Inconsistent(text));
            }
            if self.variable(pickup.parameter).is_some() {
                let text = format!("the {} is both variable and a pickup", pickup.parameter);
                return Err(LensError::Inconsistent(text));
            }
        }
        self.pickup_order().map(drop)
    }

    fn row_exists(&self, surface: usize, whose: &str) -> Result<(), LensError> {
        if surface < self.surfaces.len() {
            return Ok(());
        }
        let rows = self.surfaces.len();
        let text = format!("{whose} names surface {surface}; expected 0 to {}", rows - 1);
        Err(LensError::Inconsistent(text))
    }

    fn parameter_exists(&self, parameter: Parameter, whose: &str) -> Result<(), LensError> {
        self.row_exists(parameter.surface, whose)?;
        let position = match parameter.quantity {
            Quantity::ZoomThickness(zoom) => zoom < self.zoom.len(),
            _ => true,
        };
        if position && self.get(parameter).is_some() {
            return Ok(());
        }
        let text = format!("{whose} names the {parameter}, which this lens does not have");
        Err(LensError::Inconsistent(text))
    }
}

fn check_medium(surface: usize, medium: &Medium) -> Result<(), LensError> {
    match medium {
        Medium::Air | Medium::Mirror => Ok(()),
        Medium::Glass(name) if glass::find(name).is_some() => Ok(()),
        Medium::Glass(name) => {
            let similar = glass::similar_names(name);
            Err(LensError::UnknownGlass { surface, name: name.clone(), similar })
        }
        Medium::Model { nd, vd } => {
            let expected = "a positive index below 10";
            check_number(
                format!("nd after surface {surface}"),
                *nd,
                *nd > 0.0 && *nd < 10.0,
                expected,
            )?;
            let expected = "0 (no dispersion) or more than 1";
            check_number(
                format!("vd after surface {surface}"),
                *vd,
                *vd == 0.0 || *vd > 1.0,
                expected,
            )
        }
        Medium::Index(n) => check_number(
            format!("index after surface {surface}"),
            *n,
            *n > 0.0,
            "a positive number",
        ),
        Medium::Grin(gradient) => check_medium(surface, &gradient.base),
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
