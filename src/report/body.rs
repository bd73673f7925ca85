//! The glass bodies of a lens as solids of revolution: where each stands, its two surfaces, its rim, its
//! volume and its weight.
//!
//! A body reaches to the larger of its two semi-diameters; the smaller surface continues flat, as in
//! drawings of the section. A body that light crosses twice, as in front of a mirror, is one body.

use crate::lens::{Lens, LensSection, Medium, Pose, Shape, SurfaceNumber, System, glass};
use crate::math::Vec3;
use std::f64::consts::PI;

/// The smallest cylinder at the rim of a body that can be made and drawn, in mm.
const THINNEST: f64 = 1e-3;
/// Two places nearer to each other than this, in mm, are one place.
const SAME_PLACE: f64 = 1e-9;
/// The heights at which two surfaces are compared.
const HEIGHTS: u32 = 200;

/// A body of glass between two surfaces.
#[derive(Debug, Clone, PartialEq)]
pub struct LensBody {
    /// Its number in the lens, from 1.
    pub number: usize,
    /// Its surfaces in the order of its own axis, by index; the second one comes first in the lens
    /// where light travels backwards.
    pub surfaces: [usize; 2],
    /// The material.
    pub medium: Medium,
    /// The forms of the surfaces.
    pub shapes: [Shape<f64>; 2],
    /// The radii in mm to which the surfaces are curved.
    pub heights: [f64; 2],
    /// The distance of the vertices along the axis, in mm.
    pub thickness: f64,
    /// The place of the first surface in the frame of the lens.
    pub frame: Pose<f64>,
    /// The reason why it is no solid of revolution.
    fault: Option<BodyError>,
}

/// The reason why a body is not a solid of revolution that can be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BodyError {
    /// The surfaces do not have one axis.
    #[error(
        "surfaces {0} and {1} are tilted or decentred against each other; expected one axis of \
         revolution"
    )]
    Axes(SurfaceNumber, SurfaceNumber),
    /// The body has no thickness somewhere.
    #[error(
        "surfaces {surfaces} leave {thickness:.6} mm of glass {height:.4} mm from the axis; expected \
         {THINNEST} mm or more"
    )]
    Thickness {
        /// The two surfaces.
        surfaces: String,
        /// The thickness, in mm.
        thickness: f64,
        /// The distance from the axis, in mm.
        height: f64,
    },
    /// A surface ends before its semi-diameter.
    #[error("surface {0} ends before its semi-diameter of {1} mm")]
    Edge(SurfaceNumber, f64),
    /// A surface of more than a half sphere.
    #[error("surface {0} is more than half a sphere, which is not drawn as a solid")]
    Hyperhemisphere(SurfaceNumber),
    /// A surface whose form is not known.
    #[error("surface {0} is of a kind that is not known here ({1})")]
    Locked(SurfaceNumber, String),
    /// A surface that is not one of revolution, or no conic with even powers.
    #[error("surface {0} is a {1}, which is not drawn as a solid of revolution")]
    Freeform(SurfaceNumber, &'static str),
}

/// The bodies of a lens in the order of the light; mirrors and stops are none.
pub fn lens_bodies(lens: &Lens, section: &LensSection<'_>) -> Vec<LensBody> {
    let system = section.system();
    let mut bodies: Vec<LensBody> = Vec::new();
    for (front, row) in lens.surfaces.iter().enumerate() {
        let back = front + 1;
        let is_body = is_material(&row.medium) && back < lens.surfaces.len();
        if !is_body {
            continue;
        }
        let body = body(lens, section, system, front, bodies.len() + 1);
        if !bodies.iter().any(|other| other.coincides(&body)) {
            bodies.push(body);
        }
    }
    bodies
}

fn is_material(medium: &Medium) -> bool {
    !matches!(medium, Medium::Air | Medium::Mirror) && *medium != Medium::Index(1.0)
}

fn body(
    lens: &Lens,
    section: &LensSection<'_>,
    system: &System<f64>,
    front: usize,
    number: usize,
) -> LensBody {
    let backwards = system.surfaces[front].thickness < 0.0;
    let surfaces = if backwards { [front + 1, front] } else { [front, front + 1] };
    let [frame, other] = surfaces.map(|i| section.place(i));
    let mut body = LensBody {
        number,
        surfaces,
        medium: lens.surfaces[front].medium.clone(),
        shapes: surfaces.map(|i| system.surfaces[i].shape),
        heights: surfaces.map(|i| section.heights()[i]),
        thickness: frame.point_in(other.shift).z,
        frame,
        fault: None,
    };
    body.fault = body.find_fault(lens, &other);
    body
}

impl LensBody {
    /// The body, if it is a solid of revolution that can be made.
    ///
    /// # Errors
    /// See [`BodyError`].
    pub fn solid(&self) -> Result<&Self, BodyError> {
        self.fault.clone().map_or(Ok(self), Err)
    }

    /// The radius of the rim, in mm.
    pub fn rim(&self) -> f64 {
        self.heights[0].max(self.heights[1])
    }

    /// The z in mm of one of the surfaces from the first vertex, at a distance from the axis; flat
    /// beyond the height of the surface.
    pub fn z(&self, side: usize, height: f64) -> f64 {
        let vertex = if side == 0 { 0.0 } else { self.thickness };
        vertex + self.shapes[side].clamped_sag(height.min(self.heights[side]))
    }

    /// The length of the cylinder at the rim, in mm.
    pub fn edge_thickness(&self) -> f64 {
        self.z(1, self.rim()) - self.z(0, self.rim())
    }

    /// The volume in mm³, in closed form.
    pub fn volume(&self) -> f64 {
        let rim = self.rim();
        let side = |i: usize| filled(&self.shapes[i], self.heights[i], rim);
        PI * rim * rim * self.thickness + side(1) - side(0)
    }

    /// The density of the material in g/cm³; `None` if it is not known.
    pub fn density(&self) -> Option<f64> {
        match &self.medium {
            Medium::Glass(name) => glass::find(name)?.density,
            Medium::Air
            | Medium::Model { .. }
            | Medium::Index(_)
            | Medium::Mirror
            | Medium::Grin(_) => None,
        }
    }

    /// The mass in g; `None` if the density is not known.
    pub fn mass(&self) -> Option<f64> {
        Some(1e-3 * self.volume() * self.density()?)
    }

    /// The surfaces as the lens counts them.
    pub fn surface_numbers(&self) -> String {
        let [a, b] = self.surfaces;
        format!("{} and {}", SurfaceNumber::new(a.min(b)), SurfaceNumber::new(a.max(b)))
    }

    fn coincides(&self, other: &Self) -> bool {
        let near = |a: f64, b: f64| (a - b).abs() < SAME_PLACE;
        let apart = self.frame.shift - other.frame.shift;
        apart.dot(apart) < SAME_PLACE * SAME_PLACE
            && self.frame.turn == other.frame.turn
            && near(self.thickness, other.thickness)
            && self.medium == other.medium
            && self.shapes == other.shapes
    }

    fn find_fault(&self, lens: &Lens, other: &Pose<f64>) -> Option<BodyError> {
        let numbers = self.surfaces.map(SurfaceNumber::new);
        let own = |i: usize| &lens.surfaces[self.surfaces[i]];
        for side in [0, 1] {
            if let Some(locked) = &own(side).locked {
                return Some(BodyError::Locked(numbers[side], locked.kind.clone()));
            }
            if let Some(form) = &own(side).freeform {
                return Some(BodyError::Freeform(numbers[side], form.kind.name()));
            }
            if let Some(ideal) = own(side).ideal {
                return Some(BodyError::Freeform(numbers[side], ideal.name()));
            }
            if own(side).hyperhemisphere {
                return Some(BodyError::Hyperhemisphere(numbers[side]));
            }
            let height = self.heights[side];
            if self.shapes[side].sag(height * height).is_none() {
                return Some(BodyError::Edge(numbers[side], height));
            }
        }
        if !self.is_coaxial(other) {
            return Some(BodyError::Axes(numbers[0], numbers[1]));
        }
        self.thin_place()
    }

    /// True if the second surface, which is at `other`, has the axis of the first one.
    fn is_coaxial(&self, other: &Pose<f64>) -> bool {
        let vertex = self.frame.point_in(other.shift);
        let axis = self.frame.direction_in(other.direction_out(Vec3::new(0.0, 0.0, 1.0)));
        vertex.x.hypot(vertex.y) < SAME_PLACE && axis.x.hypot(axis.y) < SAME_PLACE && axis.z > 0.0
    }

    fn thin_place(&self) -> Option<BodyError> {
        let place = |i: u32| self.rim() * f64::from(i) / f64::from(HEIGHTS);
        let glass = |height: &f64| self.z(1, *height) - self.z(0, *height);
        let thin = (0..=HEIGHTS).map(place).find(|height| !(glass(height) >= THINNEST))?;
        Some(BodyError::Thickness {
            surfaces: self.surface_numbers(),
            thickness: glass(&thin),
            height: thin,
        })
    }
}

/// The volume between the vertex plane and a surface that is curved up to a height and flat from there
/// to the rim: `∫ 2πr z dr`.
fn filled(shape: &Shape<f64>, height: f64, rim: f64) -> f64 {
    let (c, conic, terms) = shape.numbers();
    let h2 = height * height;
    let root = (1.0 - (1.0 + conic) * c * c * h2).max(0.0).sqrt();
    let sag = c * h2 / (1.0 + root);
    // `π h² s − ∫ π r² dz` up to the sag s of the conic `r² = 2 z/c − (1 + k) z²`, where s/c is
    // `h²/(1 + root)`.
    let base = PI * sag * (h2 / (1.0 + root) - 2.0 / 3.0 * (1.0 + conic) * sag * sag);
    let power = |(j, a): (usize, f64)| {
        let m = 4 + 2 * j as i32;
        2.0 * PI * a * height.powi(m + 2) / f64::from(m + 2)
    };
    let polynomial: f64 = terms.into_iter().enumerate().map(power).sum();
    base + polynomial + PI * (rim * rim - h2) * shape.clamped_sag(height)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_volume_in_closed_form_is_that_of_thin_shells() {
        let shapes = [
            Shape::Plane,
            Shape::Sphere { curvature: 0.05 },
            Shape::Conic { curvature: -0.04, conic: -1.7 },
            Shape::Asphere {
                curvature: 0.03,
                conic: 0.8,
                terms: [1e-5, -2e-7, 0.0, 1e-11, 0.0, 0.0, 0.0],
            },
        ];
        for shape in shapes {
            let (height, rim, shells) = (9.0, 11.0, 200_000);
            let shell = |i: usize| {
                let r = rim * (i as f64 + 0.5) / f64::from(shells);
                2.0 * PI * r * shape.clamped_sag(r.min(height)) * rim / f64::from(shells)
            };
            let sum: f64 = (0..shells as usize).map(shell).sum();
            let found = filled(&shape, height, rim);
            assert!(
                (found - sum).abs() < 1e-9 * (1.0 + sum.abs()) * 1e3,
                "{shape:?} {found} {sum}"
            );
        }
    }

    #[test]
    fn half_a_ball_has_two_thirds_of_its_cylinder() {
        let outside = filled(&Shape::Sphere { curvature: 0.1 }, 10.0, 10.0);
        assert!((outside - PI * 1000.0 / 3.0).abs() < 1e-9, "{outside}");
    }

    /// Two equal spheres that meet: the first place without glass is at most a step beyond the height
    /// `h` at which twice the sag `c h² / (1 + sqrt(1 − c² h²))` is the thickness.
    #[test]
    fn glass_ends_where_two_spheres_meet() {
        let (c, thickness, rim) = (0.05, 1.0, 12.0);
        let body = LensBody {
            number: 1,
            surfaces: [0, 1],
            medium: Medium::Index(1.5),
            shapes: [Shape::Sphere { curvature: c }, Shape::Sphere { curvature: -c }],
            heights: [rim; 2],
            thickness,
            frame: Pose::centred(),
            fault: None,
        };
        let sag: f64 = 0.5 * thickness;
        let meet = (2.0 * sag / c - sag * sag).sqrt();
        let Some(BodyError::Thickness { thickness, height, .. }) = body.thin_place() else {
            panic!("the glass ends at {meet} mm");
        };
        let step = rim / f64::from(HEIGHTS);
        assert!((meet - step..=meet + step).contains(&height), "{height} {meet}");
        assert!(thickness < THINNEST && thickness > -2.0 * c * rim * step, "{thickness}");
    }
}
