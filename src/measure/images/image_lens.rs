//! The lenses of a file of exact answers, with the indices that it lists.

use super::entry::{ImageEntry, ImageFileError};
use crate::lens::{Aperture, FieldKind, FieldPoint, Object, Shape, Surface, System};
use crate::paraxial::Beam;
use crate::pupil::{Aiming, RayModel};
use serde_json::Value;

/// A lens of such a file.
#[derive(Debug, Clone)]
pub struct ImageLens<'a> {
    pub(super) entry: ImageEntry<'a>,
    id: &'a str,
    primary: usize,
    stop: usize,
}

/// A field of a lens, with its entry and the lens as its numbers are computed.
pub type ImageField<'a> = (ImageEntry<'a>, RayModel, FieldPoint);

/// The largest field in degrees that the lenses are prepared for.
const EDGE: f64 = 30.0;

pub(super) fn on_y(y: f64) -> FieldPoint {
    FieldPoint { x: 0.0, y, weight: 1.0 }
}

impl<'a> ImageLens<'a> {
    /// The lenses of a file.
    ///
    /// # Errors
    /// A file without such lenses.
    pub fn read_all(file: &'a Value) -> Result<Vec<Self>, ImageFileError> {
        ImageEntry::new(file, "").get("lenses").list()?.into_iter().map(Self::new).collect()
    }

    fn new(entry: ImageEntry<'a>) -> Result<Self, ImageFileError> {
        let (primary, stop) = (entry.get("primary"), entry.get("stop_surface"));
        let (colors, rows) = (entry.get("wavelengths_um").list()?, entry.get("surfaces").list()?);
        let within = |entry: &ImageEntry<'_>, count: usize| {
            let found = entry.count()?;
            let text = format!("less than {count}");
            let refuse = || ImageFileError::new(&entry.place, text);
            (found < count).then_some(found).ok_or_else(refuse)
        };
        let (primary, stop) = (within(&primary, colors.len())?, within(&stop, rows.len())?);
        let weights = entry.get("weights");
        if weights.list()?.len() != colors.len() {
            let text = format!("{} numbers", colors.len());
            return Err(ImageFileError::new(&weights.place, text));
        }
        Ok(Self { id: entry.get("id").text()?, primary, stop, entry })
    }

    /// Its name in the file.
    pub fn id(&self) -> &'a str {
        self.id
    }

    /// The index of the primary wavelength.
    pub fn primary(&self) -> usize {
        self.primary
    }

    /// The lens over the unit disc if no rim clips, else limited by its rims alone.
    ///
    /// # Errors
    /// A lens that cannot be traced.
    pub fn model(&self, clipped: bool) -> Result<RayModel, ImageFileError> {
        let ums = self.entry.get("wavelengths_um").numbers()?;
        let weights = self.entry.get("weights").numbers()?;
        let colors = ums.into_iter().zip(weights).enumerate();
        let color = |(w, (um, weight))| Ok((um, weight, self.system(w, clipped)?));
        let systems: Vec<(f64, f64, System<f64>)> = colors.map(color).collect::<Result<_, _>>()?;
        let rim =
            systems.first().map_or(0.0, |(.., system)| system.surfaces[self.stop].semi_diameter);
        let aperture = if clipped {
            Aperture::StopSemiDiameter(rim)
        } else {
            Aperture::EntrancePupilDiameter(self.entry.at("epd")?)
        };
        let beam = Beam { object: Object::Infinity, aperture, field: FieldKind::Angle, edge: EDGE };
        let model = RayModel::from_systems(systems, self.primary, beam, Aiming::Paraxial);
        model.map_err(|why| ImageFileError::new(&self.entry.place, format!("a lens: {why}")))
    }

    fn system(&self, wavelength: usize, clipped: bool) -> Result<System<f64>, ImageFileError> {
        let surface = |row: &ImageEntry<'_>| {
            let radius = row.get("radius");
            let curvature = if radius.is_null() { 0.0 } else { radius.number()?.recip() };
            let terms = row.get("asphere").numbers()?;
            let shape = Shape::new(curvature, row.at("conic")?, &terms, 0);
            let rim = row.get("semi_diameter");
            let open = rim.is_null() || !clipped;
            let index = row.get("n").list()?.get(wavelength).map(ImageEntry::number);
            let missing = |what: &str| ImageFileError::new(&row.place, what);
            Ok(Surface {
                shape: shape.map_err(|_why| missing("a shape"))?,
                semi_diameter: if open { f64::INFINITY } else { rim.number()? },
                ..Surface::plane(
                    row.at("thickness")?,
                    index.ok_or_else(|| missing("an index of every wavelength"))??,
                )
            })
        };
        let rows = self.entry.get("surfaces").list()?;
        let mut surfaces: Vec<_> = rows.iter().map(surface).collect::<Result<_, _>>()?;
        surfaces.push(Surface::plane(0.0, 1.0));
        Ok(System { index_before: 1.0, surfaces, stop: Some(self.stop) })
    }

    /// Every field.
    ///
    /// # Errors
    /// As of [`ImageLens::model`], or a field without an angle.
    pub fn fields(&self) -> Result<Vec<ImageField<'a>>, ImageFileError> {
        let field = |entry: ImageEntry<'a>| {
            let model = self.model(entry.get("pupil").text()? == "clip")?;
            let point = on_y(entry.at("field_deg")?);
            Ok((entry, model, point))
        };
        self.entry.get("fields").list()?.into_iter().map(field).collect()
    }
}
