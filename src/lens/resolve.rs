//! From what was written to plain numbers: pickups, glasses, the focus solve.

use super::system::{Shape, Surface, System};
use super::{Lens, LensError, Medium, Object, Parameter, Pickup, Row, SystemError};
use super::{glass, gradient};
use crate::math::Real;

impl Lens {
    /// The lens at a wavelength in micrometres and a zoom position: plain numbers, with pickups
    /// applied, the last gap solved where the lens asks for it, and the image plane appended.
    ///
    /// # Errors
    /// Whatever [`Lens::check`] refuses, a wavelength outside a glass's data, no such zoom position.
    pub fn resolve(&self, zoom: usize, um: f64) -> Result<System<f64>, LensError> {
        self.check()?;
        if zoom >= self.zoom_positions() {
            let text =
                format!("no zoom position {zoom}; expected 0 to {}", self.zoom_positions() - 1);
            return Err(LensError::Inconsistent(text));
        }
        let lens = self.with_pickups()?;
        let mut system = lens.resolve_unsolved(zoom, um)?;
        if let Some(offset) = lens.image_solve {
            let primary = lens.wavelengths[lens.primary()].um;
            let gap = paraxial_image_distance(&lens.resolve_unsolved(zoom, primary)?, lens.object)
                + offset;
            let last = lens.surfaces.len() - 1;
            system.surfaces[last].thickness = gap;
        }
        system.check()?;
        Ok(system)
    }

    /// The same lens with every pickup's value written into it.
    pub fn with_pickups(&self) -> Result<Self, LensError> {
        let mut lens = self.clone();
        for pickup in self.pickup_order()? {
            let source = lens.get(pickup.source).unwrap_or(0.0);
            lens.set(pickup.parameter, pickup.offset + pickup.scale * source);
        }
        Ok(lens)
    }

    /// Every number that moves with `parameter` and by how much, itself with factor 1 first.
    pub fn dependents(&self, parameter: Parameter) -> Vec<(Parameter, f64)> {
        let mut moving = vec![(parameter, 1.0)];
        for pickup in self.pickup_order().unwrap_or_default() {
            let factor = moving.iter().find(|(p, _)| *p == pickup.source).map(|(_, f)| *f);
            moving.extend(factor.map(|f| (pickup.parameter, f * pickup.scale)));
        }
        moving
    }

    /// The pickups so that each stands behind those it depends on.
    pub(super) fn pickup_order(&self) -> Result<Vec<Pickup>, LensError> {
        let mut waiting = self.pickups.clone();
        let mut ordered = Vec::with_capacity(waiting.len());
        while !waiting.is_empty() {
            let depends = |p: &Pickup| waiting.iter().any(|other| other.parameter == p.source);
            let (later, ready): (Vec<Pickup>, Vec<Pickup>) =
                waiting.iter().copied().partition(|p| depends(p));
            if ready.is_empty() {
                let text = format!("the pickup of the {} depends on itself", later[0].parameter);
                return Err(LensError::Inconsistent(text));
            }
            ordered.extend(ready);
            waiting = later;
        }
        Ok(ordered)
    }

    fn resolve_unsolved(&self, zoom: usize, um: f64) -> Result<System<f64>, LensError> {
        let index_before = index(&self.object_medium, 0, um, 1.0)?;
        let mut surfaces = Vec::with_capacity(self.surfaces.len() + 1);
        let mut current = index_before;
        for (i, row) in self.surfaces.iter().enumerate() {
            current = index(&row.medium, i, um, current)?;
            let thickness = self.thickness_at(i, zoom).unwrap_or(row.thickness);
            let mut surface = row.surface(thickness, current);
            // A gradient that varies nowhere is glass.
            surface.grin = self.grade(i).filter(|grade| !grade.is_constant());
            check_lowest_index(i, &surface)?;
            surfaces.push(surface);
        }
        surfaces.push(image_plane(current));
        Ok(System { index_before, surfaces, stop: self.stop() })
    }
}

impl Row {
    fn surface(&self, thickness: f64, index: f64) -> Surface<f64> {
        Surface {
            shape: self.shape(),
            thickness,
            index,
            grin: None,
            semi_diameter: self.semi_diameter.unwrap_or(f64::INFINITY),
            obstruction: self.obstruction.unwrap_or(0.0),
            mirror: self.medium == Medium::Mirror,
            hyperhemisphere: self.hyperhemisphere,
        }
    }
}

/// No glass has an index below 1 where light goes.
fn check_lowest_index(surface: usize, face: &Surface<f64>) -> Result<(), LensError> {
    let Some(field) = face.gradient() else { return Ok(()) };
    let lowest = gradient::lowest_index(&field, face.thickness);
    if lowest >= 1.0 {
        return Ok(());
    }
    let why = format!("falls to the index {lowest:.4} inside; expected 1 or more everywhere");
    Err(SystemError::Grin { surface, why }.into())
}

/// A plane that clips nothing and refracts nothing.
fn image_plane(index: f64) -> Surface<f64> {
    Surface {
        shape: Shape::Plane,
        thickness: 0.0,
        index,
        semi_diameter: f64::INFINITY,
        obstruction: 0.0,
        mirror: false,
        hyperhemisphere: false,
        grin: None,
    }
}

fn index(medium: &Medium, surface: usize, um: f64, before: f64) -> Result<f64, LensError> {
    match medium {
        Medium::Air => Ok(1.0),
        Medium::Mirror => Ok(before),
        Medium::Index(n) => Ok(*n),
        Medium::Model { nd, vd } => Ok(glass::model_index(*nd, *vd, um)),
        Medium::Grin(gradient) => index(&gradient.base, surface, um, before),
        Medium::Glass(name) => {
            let Some(found) = glass::find(name) else {
                let similar = glass::similar_names(name);
                return Err(LensError::UnknownGlass { surface, name: name.clone(), similar });
            };
            found.index(um).ok_or_else(|| {
                let [low, high] = found.range_um;
                LensError::WavelengthOutOfRange { surface, name: name.clone(), um, low, high }
            })
        }
    }
}

/// The distance from the last surface before the image plane to the paraxial image, from the
/// marginal ray `n'u' = nu − y (n' − n) c`; the last thickness itself where there is no image.
///
/// The index counts negative behind an odd number of mirrors (Welford, *Aberrations of Optical
/// Systems*, 1986, section 3.3).
pub fn paraxial_image_distance<R: Real>(system: &System<R>, object: Object) -> R {
    let last = system.surfaces.len() - 2;
    let mut n = system.index_before;
    let (mut y, mut nu) = match object {
        Object::Infinity => (R::ONE, R::ZERO),
        Object::Finite(distance) => (R::from_f64(distance), system.index_before),
    };
    let mut sense = R::ONE;
    for (i, surface) in system.surfaces[..=last].iter().enumerate() {
        if surface.mirror {
            sense = -sense;
        }
        let behind = sense * surface.index;
        nu -= y * (behind - n) * surface.shape.curvature();
        n = behind;
        if i == last {
            break;
        }
        match surface.gradient() {
            None => y += surface.thickness * nu / n,
            Some(field) => {
                let slab = gradient::ParaxialGrin::directed(&field, surface.thickness, sense);
                (y, nu) = slab.transfer(y, nu);
                n = slab.index_behind;
            }
        }
    }
    if nu.value() == 0.0 { system.surfaces[last].thickness } else { -(y * n / nu) }
}
