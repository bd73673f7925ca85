//! A lens at another temperature: its glasses expand and change their index, its mount expands.
//!
//! A body of one material keeps its form and grows by `1 + α ΔT`: a curvature shrinks, a thickness grows.
//! A cemented surface takes the mean of both glasses. The mount holds neighbouring elements at their rims,
//! so that an air gap grows with the mount there, and with the sags of its surfaces on the axis (as in
//! Rogers and Roberts, *Thermal compensation techniques*, Handbook of Optics, volume I, 1995, chapter 39).
//! Mirrors and stops grow with the mount.

use super::environment::check_celsius;
use super::resolve::index_at;
use super::{Lens, LensError, Medium, MediumPlace, Surface, SurfaceNumber, System, at_zoom, glass};
use crate::math::Real;

/// The change of a system at one wavelength with temperature.
#[derive(Debug, Clone, PartialEq)]
pub struct TemperatureChange {
    surfaces: Vec<SurfaceChange>,
    /// The growth of the mount.
    mount: f64,
    /// The change of the index in object space.
    index_before: f64,
}

/// The change of a surface and of the gap behind it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct SurfaceChange {
    /// The ratio of lengths of the surface after and before.
    growth: f64,
    /// The same of the body that fills the gap; `None` for air.
    body: Option<f64>,
    /// The change of the index behind the surface.
    index: f64,
}

impl TemperatureChange {
    /// The change of a lens from its own temperature to another one, in °C, at a wavelength in µm.
    ///
    /// # Errors
    /// A temperature outside the range of the formulas, a glass whose expansion or change of index is
    /// unknown, or a surface whose change is not computed: a freeform, an ideal element, a gradient index.
    pub fn new(lens: &Lens, um: f64, celsius: f64) -> Result<Self, LensError> {
        check_celsius(celsius)?;
        let own = lens.environment;
        let by = 1e-6 * (celsius - own.temperature());
        let mount = 1.0 + own.mount_expansion * by;
        let mut bodies = Vec::new();
        for (i, row) in lens.surfaces.iter().enumerate() {
            if row.freeform.is_some() || row.ideal.is_some() {
                let number = SurfaceNumber::new(i);
                let text = format!(
                    "surface {number} has a form whose change with temperature is not computed"
                );
                return Err(LensError::Inconsistent(text));
            }
            let expansion = expansion(&row.medium, MediumPlace::behind(i))?;
            bodies.push(expansion.map(|expansion| 1.0 + expansion * by));
        }
        let mut surfaces = Vec::new();
        let object =
            |temperature| index_at(&lens.object_medium, MediumPlace::Object, um, 1.0, temperature);
        let mut indices = [object(own.celsius)?, object(Some(celsius))?];
        let index_before = indices[1] - indices[0];
        for (i, row) in lens.surfaces.iter().enumerate() {
            for (index, temperature) in indices.iter_mut().zip([own.celsius, Some(celsius)]) {
                *index = index_at(&row.medium, MediumPlace::behind(i), um, *index, temperature)?;
            }
            let front = i.checked_sub(1).and_then(|i| bodies[i]);
            let growth = match (front, bodies[i]) {
                (Some(front), Some(back)) => 0.5 * (front + back),
                (Some(only), None) | (None, Some(only)) => only,
                (None, None) => mount,
            };
            surfaces.push(SurfaceChange {
                growth,
                body: bodies[i],
                index: indices[1] - indices[0],
            });
        }
        Ok(Self { surfaces, mount, index_before })
    }

    /// The system at the other temperature, from that of the lens before.
    pub fn apply<R: Real>(&self, system: &System<R>) -> System<R> {
        let mut changed = system.clone();
        changed.index_before += R::from_f64(self.index_before);
        for (i, change) in self.surfaces.iter().enumerate() {
            let surface = &mut changed.surfaces[i];
            scale(surface, change.growth);
            surface.index += R::from_f64(change.index);
            surface.thickness = match change.body {
                Some(growth) => surface.thickness * R::from_f64(growth),
                None => self.air_gap(system, i),
            };
        }
        changed
    }

    /// An air gap, which grows with the mount between the rims of its surfaces; between the vertices of
    /// those without one.
    fn air_gap<R: Real>(&self, system: &System<R>, gap: usize) -> R {
        let at_rim = |i: usize| {
            let growth = self.surfaces.get(i).map_or(self.mount, |change| change.growth);
            rim_sag(&system.surfaces[i]) * R::from_f64(self.mount - growth)
        };
        let between = system.surfaces[gap].thickness * R::from_f64(self.mount);
        between + at_rim(gap + 1) - at_rim(gap)
    }
}

/// The sag at the rim; zero for a surface without one, or beyond its edge.
fn rim_sag<R: Real>(surface: &Surface<R>) -> R {
    let rim = surface.semi_diameter;
    if !rim.value().is_finite() {
        return R::ZERO;
    }
    surface.shape.sag(rim * rim).map_or(R::ZERO, |(sag, _)| sag)
}

/// Scales the form and the rim of a surface.
fn scale<R: Real>(surface: &mut Surface<R>, growth: f64) {
    surface.shape = surface.shape.scaled(growth);
    if surface.semi_diameter.value().is_finite() {
        surface.semi_diameter = surface.semi_diameter * R::from_f64(growth);
    }
    surface.obstruction = surface.obstruction * R::from_f64(growth);
    surface.apertures.iter_mut().for_each(|own| *own = own.scaled(growth));
}

/// The expansion of what fills a gap, in 1e-6/K; `None` for air and behind a mirror.
fn expansion(medium: &Medium, place: MediumPlace) -> Result<Option<f64>, LensError> {
    let unknown = |name: String| Err(LensError::NoThermalData { place, name });
    match medium {
        Medium::Air | Medium::Mirror => Ok(None),
        Medium::Index(n) if *n == 1.0 => Ok(None),
        Medium::Glass(name) => {
            let properties = glass::find(name).and_then(|glass| glass.properties());
            match properties.and_then(|known| known.expansion) {
                Some(expansion) => Ok(Some(expansion)),
                None => unknown(name.clone()),
            }
        }
        Medium::Model { nd, vd } => unknown(format!("the model glass nd {nd}, vd {vd}")),
        Medium::Index(n) => unknown(format!("the index {n}")),
        Medium::Grin(_) => unknown("the gradient index".to_owned()),
    }
}

impl Lens {
    /// The lens at one of its zoom positions and at another temperature in °C: a prescription whose glasses
    /// have the indices and the lengths of that temperature, with the image plane where the mount holds it.
    /// It has no variables, pickups or merit function.
    ///
    /// # Errors
    /// As [`TemperatureChange::new`], and a lens that cannot be resolved.
    pub fn at_temperature(&self, zoom: usize, celsius: f64) -> Result<Self, LensError> {
        let um = self.wavelengths[self.primary()].um;
        let system = self.resolve(zoom, um)?;
        let changed = TemperatureChange::new(self, um, celsius)?.apply(&system);
        let mut lens = at_zoom(self, zoom);
        for (row, surface) in lens.surfaces.iter_mut().zip(&changed.surfaces) {
            let (curvature, _, terms) = surface.shape.numbers();
            let count = row.asphere.len().min(terms.len());
            (row.curvature, row.thickness) = (curvature, surface.thickness);
            row.asphere[..count].copy_from_slice(&terms[..count]);
            row.semi_diameter = row.semi_diameter.map(|_| surface.semi_diameter);
            row.obstruction = row.obstruction.map(|_| surface.obstruction);
            row.apertures.clone_from(&surface.apertures);
        }
        lens.environment.celsius = Some(celsius);
        lens.image_solve = None;
        lens.pickups.clear();
        lens.variables.clear();
        (lens.merit, lens.tolerances) = (None, None);
        lens.check()?;
        Ok(lens)
    }
}
