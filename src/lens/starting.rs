//! A lens to begin with: the system that a designer asks for, with a stop and at most one element.

use super::element::{ElementForm, NewElement};
use super::{
    Aperture, FieldKind, FieldPoint, Fields, Lens, LensError, Object, Row, Wavelength, blank,
};
use crate::math::format_short;
use serde::{Deserialize, Serialize};

/// The content of a new lens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StartingForm {
    /// A stop and an image plane one focal length behind it, without any glass.
    Empty,
    /// A stop and an element behind it.
    Element(ElementForm),
}

/// The system that a new lens is for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StartingLens {
    /// Its content.
    pub form: StartingForm,
    /// The focal length, in mm.
    pub focal_length: f64,
    /// The system aperture.
    pub aperture: Aperture,
    /// The field points.
    pub fields: Fields,
    /// The wavelengths.
    pub wavelengths: Vec<Wavelength>,
    /// The position of the object.
    pub object: Object,
}

impl StartingLens {
    /// The lens: its focal length is exact at the primary wavelength, and its image plane follows the
    /// paraxial image.
    ///
    /// # Errors
    /// A number without meaning, such as a focal length of 0 or an object inside the focal length.
    pub fn lens(&self) -> Result<Lens, LensError> {
        let f = self.focal_length;
        if !(f > 0.0 && f.is_finite()) {
            return Err(invalid("focal length", f, "more than 0, in mm"));
        }
        let image = self.image_distance()?;
        let mut lens = Lens {
            object: self.object,
            aperture: self.aperture,
            fields: self.fields.clone(),
            wavelengths: self.wavelengths.clone(),
            image_solve: Some(0.0),
            ..blank()
        };
        let stop = Row { stop: true, comment: "Stop".to_owned(), ..Row::default() };
        match self.form {
            StartingForm::Empty => {
                lens.surfaces = vec![Row { thickness: image, ..stop }];
                self.replace_focus(&mut lens);
            }
            StartingForm::Element(form) => {
                let um = lens.wavelengths.get(lens.primary()).map_or(0.0, |w| w.um);
                let mut rows = self.element(form).rows(um)?;
                rows.iter_mut().rev().take(1).for_each(|row| row.thickness = image);
                lens.surfaces = vec![Row { thickness: 0.02 * f, ..stop }];
                lens.surfaces.append(&mut rows);
            }
        }
        lens.name = self.name();
        lens.check()?;
        let um = lens.wavelengths[lens.primary()].um;
        lens.resolve(0, um)?;
        Ok(lens)
    }

    /// A lens that has grown from one without glass, with the aperture and the fields that were asked
    /// for. What a person has changed meanwhile stays as it is.
    #[must_use]
    pub fn with_asked_focus(&self, lens: &Lens) -> Lens {
        let (aperture, fields) = (self.aperture, self.fields.clone());
        let mut without = Lens { aperture, fields, ..blank() };
        self.replace_focus(&mut without);
        let mut lens = lens.clone();
        if lens.aperture == without.aperture {
            lens.aperture = self.aperture;
        }
        if lens.fields == without.fields {
            lens.fields = self.fields.clone();
        }
        lens
    }

    /// The distance of the paraxial image from a thin lens in mm.
    fn image_distance(&self) -> Result<f64, LensError> {
        match self.object {
            Object::Infinity => Ok(self.focal_length),
            Object::Finite(distance) if distance > self.focal_length => {
                Ok(1.0 / (1.0 / self.focal_length - 1.0 / distance))
            }
            Object::Finite(distance) => Err(invalid(
                "object distance",
                distance,
                "more than the focal length, so that there is a real image",
            )),
        }
    }

    /// Without glass there is no focus to which an f-number or an image height could refer: they
    /// become the diameter of the stop and field angles that belong to the same focal length.
    fn replace_focus(&self, lens: &mut Lens) {
        let image = self.image_distance().unwrap_or(self.focal_length);
        if let Aperture::FNumber(number) = self.aperture {
            lens.aperture = Aperture::EntrancePupilDiameter(image / number);
        }
        if self.fields.kind == FieldKind::ImageHeight {
            let angle = |height: f64| (height / image).atan().to_degrees();
            let values = self.fields.values.iter();
            let values = values.map(|f| FieldPoint { x: angle(f.x), y: angle(f.y), ..*f });
            lens.fields = Fields { kind: FieldKind::Angle, values: values.collect() };
        }
    }

    /// The element behind the stop, bent for the least spherical aberration of a thin lens:
    /// `q = −2 (n²−1) p / (n+2)` with the position factor p (Welford 1986, section 12.3).
    fn element(&self, form: ElementForm) -> NewElement {
        let f = self.focal_length;
        let position = match self.object {
            Object::Infinity => -1.0,
            Object::Finite(distance) => 2.0 * f / distance - 1.0,
        };
        let shape_factor = -0.74 * position;
        NewElement { form, focal_length: f, semi_diameter: self.semi_diameter(), shape_factor }
    }

    /// The height of the beam at the element, with a tenth for the field.
    fn semi_diameter(&self) -> f64 {
        let f = self.focal_length;
        let beam = match (self.aperture, self.object) {
            (Aperture::EntrancePupilDiameter(diameter), _) => 0.5 * diameter,
            (Aperture::FNumber(number), _) => 0.5 * self.image_distance().unwrap_or(f) / number,
            (Aperture::ObjectNa(na), Object::Finite(distance)) => na * distance,
            (Aperture::ObjectNa(_), Object::Infinity) => 0.1 * f,
            (Aperture::StopSemiDiameter(height), _) => height,
        };
        (1.1 * beam).clamp(0.02 * f, 0.5 * f)
    }

    fn name(&self) -> String {
        let form = match self.form {
            StartingForm::Empty => "New lens",
            StartingForm::Element(ElementForm::Singlet) => "Singlet",
            StartingForm::Element(ElementForm::CementedDoublet) => "Achromat",
        };
        let number = match self.aperture {
            Aperture::FNumber(number) => format!(" f/{}", format_short(number)),
            _ => String::new(),
        };
        format!("{form} {} mm{number}", format_short(self.focal_length))
    }
}

fn invalid(what: &str, found: f64, expected: &'static str) -> LensError {
    LensError::InvalidNumber { what: what.to_owned(), found, expected }
}
