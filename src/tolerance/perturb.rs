//! A resolved lens with errors of making.
//!
//! Errors of one surface apply first, then those of bodies: rolls, then bodies of few surfaces, then
//! larger ones that contain them, each of which carries along what it contains.

use super::{ToleranceError, is_beside_grin};
use crate::lens::{
    Perturbation, PerturbationKind, Pose, RigidMotion, Surface, SurfaceAperture, System,
};
use crate::math::Real;
use std::collections::HashMap;

/// A lens as designed, resolved at its wavelengths.
#[derive(Debug, Clone)]
pub struct NominalLens {
    /// The lens at each wavelength. Its semi-diameters clip nothing: they tell where the crossing with
    /// an asphere is sought first.
    pub systems: Vec<System<f64>>,
    /// The wavelengths, in micrometres.
    pub wavelengths: Vec<f64>,
    /// The index of the primary wavelength.
    pub primary: usize,
    /// The semi-diameter of each surface in mm: the unit of an irregularity.
    pub semi_diameters: Vec<f64>,
    /// The radii in mm of the clear aperture and of the obstruction of each surface, and its apertures of
    /// other forms, which clip in a lens with its rims; empty if nothing does.
    pub rims: Vec<(f64, f64, Vec<SurfaceAperture>)>,
}

/// The lens at each wavelength with errors of making; numbers without an error are as designed.
///
/// # Errors
/// An error of surfaces that do not exist, or that is not possible on its surface.
pub fn perturb<R: Real>(
    lens: &NominalLens,
    errors: &[(Perturbation, R)],
) -> Result<Vec<System<R>>, ToleranceError> {
    check_all(lens, errors.iter().map(|(what, _)| *what))?;
    let mut systems: Vec<System<R>> = lens.systems.iter().map(System::cast).collect();
    for (what, value) in errors {
        let semi_diameter = lens.semi_diameters.get(what.first).copied().unwrap_or(1.0);
        for system in &mut systems {
            add_to_surface(system, *what, *value, semi_diameter);
        }
        if what.kind == PerturbationKind::Abbe {
            change_dispersion(&mut systems, lens.primary, what.first, *value);
        }
    }
    let moved = bodies(errors);
    if !moved.is_empty() {
        systems.iter_mut().for_each(|system| place(system, lens, &moved));
    }
    Ok(systems)
}

/// Checks that errors are possible.
///
/// # Errors
/// An error of surfaces that do not exist, or that is not possible on its surface.
pub(super) fn check_all(
    lens: &NominalLens,
    errors: impl IntoIterator<Item = Perturbation>,
) -> Result<(), ToleranceError> {
    errors.into_iter().try_for_each(|what| check(lens, what))
}

/// Checks that an error is possible.
fn check(lens: &NominalLens, what: Perturbation) -> Result<(), ToleranceError> {
    let system = &lens.systems[lens.primary];
    let surfaces = system.surfaces.len() - 1;
    let Perturbation { kind, first, last } = what;
    if first > last || last >= surfaces || (first != last && !kind.moves_a_body()) {
        return Err(ToleranceError::NoSuchSurface { what, surfaces });
    }
    let refuse = |why: &'static str| Err(ToleranceError::NotPossible { what, why });
    let own = &system.surfaces[first];
    let touches_grin = is_beside_grin(system, first);
    match kind {
        PerturbationKind::ThicknessAdjusted if first + 1 >= surfaces => {
            refuse("has no gap behind the next surface that could take it up")
        }
        _ if kind.moves_a_body() && breaks_axis_inside(&system.surfaces[first..=last]) => refuse(
            "holds a break of the axis between its surfaces, which do not move as one body then",
        ),
        PerturbationKind::ElementRollX | PerturbationKind::ElementRollY
            if own.shape.curvature() == 0.0 =>
        {
            refuse("needs a centre of curvature, which a plane does not have")
        }
        PerturbationKind::Irregularity | PerturbationKind::AsphereSlope
            if !(lens.semi_diameters[first] > 0.0) =>
        {
            refuse("needs the semi-diameter of the surface, which is not known")
        }
        _ if touches_grin && kind.breaks_symmetry() => {
            refuse("touches a GRIN medium, which is not supported")
        }
        _ => Ok(()),
    }
}

/// True if the surfaces of a body do not stand on one axis. A break of the axis in front of the first one
/// places all of it, and one behind the last one nothing of it.
fn breaks_axis_inside(body: &[Surface<f64>]) -> bool {
    let inner = body.len().saturating_sub(1);
    body.iter().take(inner).skip(1).any(|surface| surface.axis.is_some())
}

/// Adds an error to the numbers of its surface; poses and dispersion are no such numbers.
fn add_to_surface<R: Real>(
    system: &mut System<R>,
    Perturbation { kind, first, .. }: Perturbation,
    value: R,
    semi_diameter: f64,
) {
    let own = &mut system.surfaces[first];
    match kind {
        PerturbationKind::Curvature => own.shape = own.shape.with_added(value, R::ZERO, R::ZERO),
        PerturbationKind::Conic => {
            own.shape = own.shape.as_conic().with_added(R::ZERO, value, R::ZERO);
        }
        PerturbationKind::Asphere => {
            own.shape = own.shape.as_asphere().with_added(R::ZERO, R::ZERO, value);
        }
        PerturbationKind::Irregularity => add_irregularity(own, value, semi_diameter),
        PerturbationKind::AsphereSlope => {
            let [curvature, fourth] = slope_changes(semi_diameter);
            let (curvature, fourth) = (R::from_f64(curvature), R::from_f64(fourth));
            own.shape =
                own.shape.as_asphere().with_added(value * curvature, R::ZERO, value * fourth);
        }
        PerturbationKind::Thickness => own.thickness += value,
        PerturbationKind::ThicknessAdjusted => {
            own.thickness += value;
            system.surfaces[first + 1].thickness -= value;
        }
        PerturbationKind::Index => own.index += value,
        _ => {}
    }
}

/// The changes of the curvature and of the coefficient of r⁴ by a slope error of one radian: the sag
/// `s/2 (r⁴/h³ − r²/h)` for the semi-diameter h.
pub(super) fn slope_changes(semi_diameter: f64) -> [f64; 2] {
    [-1.0 / semi_diameter, 0.5 / semi_diameter.powi(3)]
}

/// Adds `A/2 (ρ⁴ + ρy²)` to the sag.
fn add_irregularity<R: Real>(surface: &mut Surface<R>, value: R, semi_diameter: f64) {
    let square = semi_diameter * semi_diameter;
    let half = value * R::from_f64(0.5 / square);
    let fourth = half * R::from_f64(1.0 / square);
    surface.shape = surface.shape.as_asphere().with_added(R::ZERO, R::ZERO, fourth);
    surface.astigmatism = Some(surface.astigmatism.unwrap_or(R::ZERO) + half);
}

/// Changes the dispersion behind a surface: `n → n_p + (n − n_p)/(1 + v)`, `n_p` at the primary
/// wavelength.
fn change_dispersion<R: Real>(systems: &mut [System<R>], primary: usize, surface: usize, v: R) {
    let center = systems[primary].surfaces[surface].index;
    let inverse = R::ONE / (R::ONE + v);
    for system in systems {
        let index = &mut system.surfaces[surface].index;
        *index = center + (*index - center) * inverse;
    }
}

/// A body that moves: its surfaces, and the sums of its errors.
struct Body<R> {
    first: usize,
    last: usize,
    rolls: bool,
    /// True for a single surface, which moves in its own frame.
    alone: bool,
    decenter: [R; 2],
    tilt: [R; 2],
}

/// Places the surfaces of bodies that move.
fn place<R: Real>(system: &mut System<R>, lens: &NominalLens, bodies: &[Body<R>]) {
    let vertices = system.vertex_positions();
    for body in bodies {
        let pose = Pose::new(body.decenter, body.tilt);
        let curvature = lens.systems[lens.primary].surfaces[body.first].shape.curvature();
        let center = if body.rolls { 1.0 / curvature } else { 0.0 };
        let motion = RigidMotion { pivot: vertices[body.first] + R::from_f64(center), pose };
        let mut is_first = true;
        for (surface, vertex) in system
            .surfaces
            .iter_mut()
            .zip(vertices.iter().copied())
            .take(body.last + 1)
            .skip(body.first)
        {
            let own = surface.pose.unwrap_or_else(Pose::centred);
            // The first surface of several stands on the axis in front of its break, the others on that behind.
            let axis = surface.axis.filter(|_| is_first && body.first < body.last);
            is_first = false;
            surface.pose = Some(if body.alone {
                pose.carried(&RigidMotion { pivot: vertex, pose: own }, vertex)
            } else if let Some(axis) = axis {
                axis.then(&axis.inverse().then(&own).carried(&motion, vertex))
            } else {
                own.carried(&motion, vertex)
            });
        }
    }
}

/// The bodies that move, in the order in which they do: single surfaces, rolls, then the smaller
/// before the larger ones.
fn bodies<R: Real>(errors: &[(Perturbation, R)]) -> Vec<Body<R>> {
    let mut bodies: Vec<Body<R>> = Vec::new();
    let mut single = Vec::new();
    let mut places = HashMap::new();
    for (what, value) in errors.iter().filter(|(w, _)| w.kind >= PerturbationKind::SurfaceDecenterX)
    {
        let rolls =
            matches!(what.kind, PerturbationKind::ElementRollX | PerturbationKind::ElementRollY);
        let list = if what.kind.moves_a_body() { &mut bodies } else { &mut single };
        let alone = !what.kind.moves_a_body();
        let at = *places.entry((what.first, what.last, rolls, alone)).or_insert_with(|| {
            let (decenter, tilt) = ([R::ZERO; 2], [R::ZERO; 2]);
            list.push(Body { first: what.first, last: what.last, rolls, alone, decenter, tilt });
            list.len() - 1
        });
        *list[at].number(what.kind) += *value;
    }
    bodies.sort_by_key(|body| (!body.rolls, body.last - body.first));
    single.append(&mut bodies);
    single
}

impl<R: Real> Body<R> {
    /// The number that an error of this kind adds to.
    fn number(&mut self, kind: PerturbationKind) -> &mut R {
        match kind {
            PerturbationKind::SurfaceDecenterX | PerturbationKind::ElementDecenterX => {
                &mut self.decenter[0]
            }
            PerturbationKind::SurfaceDecenterY | PerturbationKind::ElementDecenterY => {
                &mut self.decenter[1]
            }
            PerturbationKind::SurfaceTiltX
            | PerturbationKind::ElementTiltX
            | PerturbationKind::ElementRollX => &mut self.tilt[0],
            _ => &mut self.tilt[1],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::Shape;

    /// A slope error leaves the sag at the centre and at the rim, and has its slope there.
    #[test]
    fn a_slope_error_is_a_zone_with_its_slope_at_the_rim() {
        let (rim, slope) = (8.0_f64, 1e-3);
        let [curvature, fourth] = slope_changes(rim).map(|by| by * slope);
        let sag = |r: f64| 0.5 * curvature * r * r + fourth * r.powi(4);
        assert!(sag(rim).abs() < 1e-15 && sag(0.5 * rim) < -1e-4);
        let step = 1e-5;
        let found = (sag(rim + step) - sag(rim - step)) / (2.0 * step);
        assert!((found - slope).abs() < 1e-9, "{found}");
        let shape = Shape::Sphere { curvature: 0.02 }.as_asphere();
        assert_eq!(shape.with_added(curvature, 0.0, fourth).curvature(), 0.02 + curvature);
    }
}
