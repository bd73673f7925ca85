//! Resolves a lens to plain numbers: applies pickups, looks up glasses, solves the image distance.

use super::system::{Surface, System};
use super::{
    IdealAction, Lens, LensError, Medium, MediumPlace, Object, Parameter, Pickup, Pose, Row,
    SystemError,
};
use super::{glass, grin};
use crate::math::Real;

impl Lens {
    /// The lens at a zoom position and a wavelength `um` in micrometres as plain numbers, with
    /// pickups applied, the last thickness solved if the lens has an image solve, and the image
    /// plane appended.
    ///
    /// # Errors
    /// A fault found by [`Lens::check`], a wavelength outside the data of a glass, or a zoom position
    /// that does not exist.
    pub fn resolve(&self, zoom: usize, um: f64) -> Result<System<f64>, LensError> {
        self.check()?;
        if zoom >= self.zoom_positions() {
            let text =
                format!("no zoom position {zoom}; expected 0 to {}", self.zoom_positions() - 1);
            return Err(LensError::Inconsistent(text));
        }
        let mut lens = self.with_pickups()?;
        lens.take_numbers_of(zoom);
        let mut system = lens.resolve_unsolved(um)?;
        if let Some(offset) = lens.image_solve {
            let primary = lens.wavelengths[lens.primary()].um;
            let gap =
                paraxial_image_distance(&lens.resolve_unsolved(primary)?, lens.object) + offset;
            let last = lens.surfaces.len() - 1;
            system.surfaces[last].thickness = gap;
        }
        system.check()?;
        Ok(system)
    }

    /// The same lens with the value of every pickup written into it.
    ///
    /// # Errors
    /// A pickup that depends on itself.
    pub fn with_pickups(&self) -> Result<Self, LensError> {
        let mut lens = self.clone();
        for pickup in self.pickup_order()? {
            let source = lens.get(pickup.source).unwrap_or(0.0);
            lens.set(pickup.parameter, pickup.offset + pickup.scale * source);
        }
        Ok(lens)
    }

    /// Writes the numbers of a zoom position into the rows.
    pub(super) fn take_numbers_of(&mut self, zoom: usize) {
        let Some(position) = self.zoom.get(zoom) else { return };
        for own in &position.numbers {
            if let Some(row) = self.surfaces.get_mut(own.surface) {
                row.set(own.quantity, own.value);
            }
        }
    }

    /// Every parameter that changes with `parameter`, with its derivative; `parameter` itself, with
    /// the derivative 1, is the first.
    pub fn dependents(&self, parameter: Parameter) -> Vec<(Parameter, f64)> {
        let mut moving = vec![(parameter, 1.0)];
        for pickup in self.pickup_order().unwrap_or_default() {
            let factor = moving.iter().find(|(p, _)| *p == pickup.source).map(|(_, f)| *f);
            moving.extend(factor.map(|f| (pickup.parameter, f * pickup.scale)));
        }
        moving
    }

    /// The pickups in an order in which each follows those that it depends on.
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

    fn resolve_unsolved(&self, um: f64) -> Result<System<f64>, LensError> {
        let celsius = self.environment.celsius;
        let index_before = index_at(&self.object_medium, MediumPlace::Object, um, 1.0, celsius)?;
        let mut surfaces = Vec::with_capacity(self.surfaces.len() + 1);
        let mut current = index_before;
        for (i, row) in self.surfaces.iter().enumerate() {
            current = index_at(&row.medium, MediumPlace::behind(i), um, current, celsius)?;
            let mut surface = row.surface(current, um);
            // A GRIN medium with a constant index is homogeneous.
            surface.grin = self.grin_coefficients(i).filter(|grin| !grin.is_constant());
            check_lowest_index(i, &surface)?;
            surfaces.push(surface);
        }
        surfaces.push(Surface::plane(0.0, current));
        Ok(System { index_before, surfaces, stop: self.stop() })
    }
}

impl Row {
    /// The position of the surface on the axis in front of it; `None` for a centred one.
    pub fn pose(&self) -> Option<Pose<f64>> {
        let centred = self.decenter == [0.0; 2] && self.tilt == [0.0; 2];
        let own = (!centred).then(|| Pose::new(self.decenter, self.tilt.map(f64::to_radians)));
        match (self.break_before, own) {
            (None, own) => own,
            (Some(axis), None) => Some(axis.pose()),
            (Some(axis), Some(own)) => Some(axis.pose().then(&own)),
        }
    }

    /// The frame of the axis behind the surface in that of the axis in front of it; `None` where the
    /// axis is not broken, or goes on as it was behind two breaks.
    pub fn axis(&self) -> Option<Pose<f64>> {
        match [self.break_before, self.break_after] {
            [None, None] => None,
            [Some(only), None] | [None, Some(only)] => Some(only.pose()),
            [Some(before), Some(after)] => {
                Some(before.pose().then(&after.pose())).filter(|pose| !pose.is_nearly_centred())
            }
        }
    }

    fn surface(&self, index: f64, um: f64) -> Surface<f64> {
        Surface {
            shape: self.shape(),
            thickness: self.thickness,
            index,
            grin: None,
            semi_diameter: self.semi_diameter.unwrap_or(f64::INFINITY),
            obstruction: self.obstruction.unwrap_or(0.0),
            apertures: self.apertures.clone(),
            mirror: self.medium == Medium::Mirror,
            hyperhemisphere: self.hyperhemisphere,
            pose: self.pose(),
            axis: self.axis(),
            astigmatism: None,
            freeform: self.freeform.clone().map(Box::new),
            ideal: match (self.ideal, &self.freeform) {
                (Some(ideal), _) => Some(ideal.action(um)),
                (None, Some(form)) => IdealAction::of_form(form.kind, um),
                (None, None) => None,
            },
        }
    }
}

/// Checks that the index of a GRIN medium is nowhere below 1.
fn check_lowest_index(i: usize, surface: &Surface<f64>) -> Result<(), LensError> {
    let Some(profile) = surface.grin_profile() else { return Ok(()) };
    let lowest = grin::lowest_index(&profile, surface.thickness);
    if lowest >= 1.0 {
        return Ok(());
    }
    let why = format!("falls to the index {lowest:.4} inside; expected 1 or more everywhere");
    Err(SystemError::Grin { surface: i.into(), why }.into())
}

/// The index of a medium at a wavelength in micrometres and the temperature of its catalogue; that of the
/// gap in front for a mirror.
pub(super) fn index(
    medium: &Medium,
    place: MediumPlace,
    um: f64,
    before: f64,
) -> Result<f64, LensError> {
    index_at(medium, place, um, before, None)
}

/// The index of a medium at a wavelength in micrometres and a temperature in °C, or that of its catalogue;
/// that of the gap in front for a mirror.
pub(super) fn index_at(
    medium: &Medium,
    place: MediumPlace,
    um: f64,
    before: f64,
    celsius: Option<f64>,
) -> Result<f64, LensError> {
    let known = |index: f64| match celsius {
        Some(_) if index != 1.0 => {
            Err(LensError::NoThermalData { place, name: format!("the index {index}") })
        }
        _ => Ok(index),
    };
    match medium {
        Medium::Air => Ok(1.0),
        Medium::Mirror => Ok(before),
        Medium::Index(n) => known(*n),
        Medium::Model { nd, vd } => known(glass::model_index(*nd, *vd, um)),
        // The change of a gradient with temperature is unknown.
        Medium::Grin(_) if celsius.is_some() => {
            Err(LensError::NoThermalData { place, name: "the gradient index".to_owned() })
        }
        Medium::Grin(grin) => index(&grin.base, place, um, before),
        Medium::Glass(name) => {
            let Some(found) = glass::find(name) else {
                let similar = glass::similar_names(name);
                return Err(LensError::UnknownGlass { place, name: name.clone(), similar });
            };
            let index = found.index(um).ok_or_else(|| {
                let [low, high] = found.range_um;
                LensError::WavelengthOutOfRange { place, name: name.clone(), um, low, high }
            })?;
            let Some(celsius) = celsius else { return Ok(index) };
            let unknown = || LensError::NoThermalData { place, name: name.clone() };
            found.index_at(um, celsius).ok_or_else(unknown)
        }
    }
}

/// The distance in mm from the last surface before the image plane to the paraxial image, from the
/// marginal ray `n'u' = nu − y (n' − n) c`; the last thickness itself if the image is at infinity.
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
        nu -= y * (behind - n) * surface.curvature();
        if surface.ideal.is_some() {
            nu -= y * surface.added_power();
        }
        n = behind;
        if i == last {
            break;
        }
        match surface.grin_profile() {
            None => y += surface.thickness * nu / n,
            Some(profile) => {
                let gap = grin::ParaxialGrin::directed(&profile, surface.thickness, sense);
                (y, nu) = gap.transfer(y, nu);
                n = gap.index_behind;
            }
        }
    }
    if nu.value() == 0.0 { system.surfaces[last].thickness } else { -(y * n / nu) }
}
