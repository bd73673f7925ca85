//! Geometry that many rooms need: lengths along the axis, sags, and the lens traversed backwards.

use super::{Lens, Medium, Pose, Row, Shape, Surface, System};
use crate::math::{Real, Vec3};

impl Lens {
    /// The sum of the absolute thicknesses as written, in mm: the length of the lens from its first
    /// vertex to the image plane, along the light.
    pub fn total_track(&self) -> f64 {
        self.surfaces.iter().map(|row| row.thickness.abs()).sum()
    }

    /// The direction of the light in the gap behind a surface: 1 towards +z, −1 towards −z, which is
    /// behind an odd number of mirrors.
    pub fn light_direction(&self, surface: usize) -> f64 {
        let mirrors = self.surfaces[..=surface].iter().filter(|row| row.medium == Medium::Mirror);
        if mirrors.count() % 2 == 0 { 1.0 } else { -1.0 }
    }
}

impl<R: Real> System<R> {
    /// The sum of the absolute thicknesses in front of the last surface, in mm; see
    /// [`Lens::total_track`].
    pub fn total_track(&self) -> R {
        let gaps = self.surfaces.iter().take(self.surfaces.len().saturating_sub(1));
        gaps.fold(R::ZERO, |sum, surface| sum + surface.thickness.abs())
    }

    /// The direction of the light in the gap behind a surface, 1 or −1; see
    /// [`Lens::light_direction`].
    pub fn light_direction(&self, surface: usize) -> R {
        let mirrors = self.surfaces[..=surface].iter().filter(|surface| surface.mirror);
        if mirrors.count() % 2 == 0 { R::ONE } else { -R::ONE }
    }

    /// The frame in front of every surface, with its origin at the vertex, in that of the first one:
    /// its axis is turned and displaced by the breaks of the surfaces before.
    pub fn frames(&self) -> Vec<Pose<R>> {
        let mut frame = Pose::centred();
        let mut frames = Vec::with_capacity(self.surfaces.len());
        for surface in &self.surfaces {
            frames.push(frame);
            let gap =
                Pose { shift: Vec3::new(R::ZERO, R::ZERO, surface.thickness), ..Pose::centred() };
            frame = match &surface.axis {
                None => frame.then(&gap),
                Some(axis) => frame.then(axis).then(&gap),
            };
        }
        frames
    }

    /// The position of every vertex along the axis, in mm from the first one; the last is as a rule
    /// that of the image plane. A broken axis is straightened.
    pub fn vertex_positions(&self) -> Vec<R> {
        let gaps = self.surfaces.iter().map(|surface| surface.thickness);
        let positions = gaps.scan(R::ZERO, |z, gap| {
            let vertex = *z;
            *z += gap;
            Some(vertex)
        });
        positions.collect()
    }
}

impl System<f64> {
    /// The position of the last surface on the axis, as a rule the image plane, in mm from the
    /// first vertex.
    pub fn image_position(&self) -> f64 {
        self.surfaces.iter().take(self.surfaces.len().saturating_sub(1)).map(|s| s.thickness).sum()
    }
}

impl<R: Real> Shape<R> {
    /// The distance from the axis in mm at which the conic part of the surface ends, where its
    /// normal is perpendicular to the axis; infinite for a plane, a paraboloid and a hyperboloid.
    pub fn edge(&self) -> f64 {
        let (curvature, conic, _) = self.numbers();
        let square = (1.0 + conic.value()) * curvature.value() * curvature.value();
        if square > 0.0 { 1.0 / square.sqrt() } else { f64::INFINITY }
    }
}

impl Shape<f64> {
    /// The sag in mm at a distance from the axis, or at the edge of the surface where it ends
    /// before.
    pub fn clamped_sag(&self, height: f64) -> f64 {
        let height = height.abs().min(self.edge());
        let (c, conic, terms) = self.numbers();
        let r2 = height * height;
        // Rounding may put the edge itself outside.
        let root = (1.0 - (1.0 + conic) * c * c * r2).max(0.0).sqrt();
        let polynomial = terms.into_iter().rev().fold(0.0, |sum, a| sum * r2 + a) * r2 * r2;
        c * r2 / (1.0 + root) + polynomial
    }
}

impl Surface<f64> {
    /// The sag in mm of the section with the y-z plane at a height, or that at the edge of the surface
    /// where it ends before; an irregularity is left out.
    pub fn clamped_sag(&self, y: f64) -> f64 {
        match &self.freeform {
            None => self.shape.clamped_sag(y),
            Some(form) => form.section_sag(&self.shape, y),
        }
    }

    /// The sag in mm of the section with the y-z plane at a height; `None` beyond the edge of the
    /// surface.
    pub fn section_sag(&self, y: f64) -> Option<f64> {
        match &self.freeform {
            None => Some(self.shape.sag(y * y)?.0),
            Some(form) => {
                Some(form.sag(&form.base(&self.shape), 0.0, y)[0]).filter(|z| z.is_finite())
            }
        }
    }
}

impl Row {
    /// The form of the surface, without that of a freeform.
    pub fn shape(&self) -> Shape<f64> {
        let mut terms = [0.0; super::ASPHERE_TERMS];
        terms.iter_mut().zip(&self.asphere).for_each(|(to, from)| *to = *from);
        Shape::simplest(self.curvature, self.conic, terms)
    }

    /// The reason why the surface cannot limit a beam by its height, if there is one.
    pub fn stop_fault(&self) -> Option<&'static str> {
        self.hyperhemisphere.then_some(
            "the stop is a hyperhemisphere, of which both halves have the same height; expected the \
             stop on a surface of its own",
        )
    }

    /// True if the surface curves back to the axis, as a sphere and an ellipsoid do, and so has a far half.
    pub fn has_far_half(&self) -> bool {
        self.curvature != 0.0 && self.conic > -1.0 && self.asphere.iter().all(|term| *term == 0.0)
    }
}

impl<R: Real> System<R> {
    /// The same surfaces traversed by light from the image. The new first vertex is the last one
    /// before the image plane, and the new image plane lies `distance` mm behind the old first
    /// vertex. The old image plane is removed: it is now the object, at the distance of the old last
    /// thickness in front of the new first vertex.
    #[must_use]
    pub fn reversed(&self, distance: R) -> Self {
        let Some((image, surfaces)) = self.surfaces.split_last() else { return self.clone() };
        let mirrors = surfaces.iter().filter(|surface| surface.mirror).count();
        // Light that travels towards −z at the end already has the right direction.
        let turn = if mirrors % 2 == 0 { -R::ONE } else { R::ONE };
        let gap = |i: usize| i.checked_sub(1).map_or(distance, |i| -(turn * surfaces[i].thickness));
        let directed = |pose: Pose<R>| if turn < R::ZERO { pose.reflected() } else { pose };
        let count = surfaces.len();
        let reversed = (0..count).rev().map(|i| Surface {
            shape: surfaces[i].shape.with_sag_sign(turn),
            thickness: gap(i),
            index: self.index_before(i),
            grin: i
                .checked_sub(1)
                .and_then(|i| surfaces[i].grin.map(|grin| grin.reversed(surfaces[i].thickness))),
            pose: reversed_pose(&surfaces[i]).map(directed),
            axis: surfaces[i].axis.map(|axis| directed(axis.inverse())),
            astigmatism: surfaces[i].astigmatism.map(|astigmatism| turn * astigmatism),
            freeform: surfaces[i].freeform.as_ref().map(|form| Box::new(form.with_sag_sign(turn))),
            ..surfaces[i].clone()
        });
        let plane = Surface { index: self.index_before, thickness: R::ZERO, ..image.clone() };
        Self {
            index_before: surfaces.last().map_or(self.index_before, |surface| surface.index),
            surfaces: reversed.chain(std::iter::once(plane)).collect(),
            stop: self.stop.map(|stop| count - 1 - stop),
        }
    }
}

/// The pose of a surface on the axis behind it.
fn reversed_pose<R: Real>(surface: &Surface<R>) -> Option<Pose<R>> {
    let Some(axis) = surface.axis else { return surface.pose };
    let own = surface.pose.unwrap_or_else(Pose::centred);
    Some(axis.inverse().then(&own))
}

impl<R: Real> Shape<R> {
    /// The same form with its sag multiplied by `turn`, which is 1 or −1.
    fn with_sag_sign(self, turn: R) -> Self {
        match self {
            Self::Plane => Self::Plane,
            Self::Sphere { curvature } => Self::Sphere { curvature: turn * curvature },
            Self::Conic { curvature, conic } => Self::Conic { curvature: turn * curvature, conic },
            Self::Asphere { curvature, conic, terms } => Self::Asphere {
                curvature: turn * curvature,
                conic,
                terms: terms.map(|term| turn * term),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sag_ends_at_the_edge() {
        for radius in [0.3, 7.0, 1234.5] {
            let sphere = Shape::Sphere { curvature: 1.0 / radius };
            assert!((sphere.edge() / radius - 1.0).abs() < 1e-15);
            for height in [radius, 2.0 * radius] {
                assert!((sphere.clamped_sag(height) / radius - 1.0).abs() < 1e-7);
            }
            let inside = sphere.sag(0.25 * radius * radius).unwrap().0;
            assert_eq!(sphere.clamped_sag(-0.5 * radius).to_bits(), inside.to_bits());
        }
        assert_eq!(Shape::<f64>::Plane.clamped_sag(1e9), 0.0);
    }
}
