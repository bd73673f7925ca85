//! Cardinal points, pupils, marginal and chief ray.
//!
//! The rays `(y, nu) = (1, 0)` and `(0, 1)` in front of the lens are the columns of its matrix
//! (Welford 1986, section 3.6). A ray with height zero at the stop gives both pupils without a special
//! case: a pupil at infinity is a ray that leaves parallel to the axis.

use super::ray::{ParaxialRay, paraxial_grins, paraxial_ray, signed_indices};
use crate::lens::{Aperture, FieldKind, Lens, Object, System};
use crate::math::Real;
use serde::Serialize;

/// The use of a lens: the position of the object, the system aperture and the size of the field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Beam {
    /// The position of the object.
    pub object: Object,
    /// The system aperture.
    pub aperture: Aperture,
    /// The quantity that `edge` is.
    pub field: FieldKind,
    /// The edge of the field, to which the chief ray belongs, in degrees or mm as `field` says.
    pub edge: f64,
}

impl Beam {
    /// The beam of a lens at a zoom position, up to its field point farthest from the axis.
    pub fn for_lens(lens: &Lens, zoom: usize) -> Self {
        let fields = lens.fields_at(zoom);
        let edge = fields.values.iter().fold(0.0, |edge: f64, field| {
            let here = if field.x == 0.0 { field.y } else { field.x.hypot(field.y) };
            if here.abs() > edge.abs() { here } else { edge }
        });
        Self { object: lens.object, aperture: lens.aperture_at(zoom), field: fields.kind, edge }
    }
}

/// A reason for which first-order data do not exist for a beam.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ParaxialError {
    /// The entrance pupil is at infinity and has no diameter.
    #[error(
        "the aperture is an entrance pupil diameter, but the entrance pupil is at infinity; \
         expected an object NA, an f-number or the semi-diameter of the stop"
    )]
    PupilAtInfinity,
    /// The lens is afocal, so that there is no f-number.
    #[error(
        "the aperture is an f-number, but the lens focuses nothing; expected an entrance pupil \
         diameter, or an element with a focal length"
    )]
    Afocal,
    /// The object lies in the plane of the entrance pupil.
    #[error("the object lies in the plane of the entrance pupil, so that there is no beam")]
    ObjectInPupil,
    /// The object NA is not below the index of object space.
    #[error("the object NA is {na}, but the index there is {index}; expected a smaller NA")]
    NumericalAperture {
        /// The numerical aperture.
        na: f64,
        /// The index in front of the lens.
        index: f64,
    },
    /// The stop lies at an image of the object, so that its size limits no beam.
    #[error("the stop lies at an image of the object, so that its size does not limit the beam")]
    StopAtImage,
}

/// The entrance or exit pupil: an image of the stop.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ParaxialPupil<R> {
    /// The position in mm, of the entrance pupil from the first vertex, of the exit pupil from the
    /// last vertex before the image; `None` at infinity (telecentric).
    pub position: Option<R>,
    /// The diameter in mm; `None` at infinity.
    pub diameter: Option<R>,
}

/// The first-order data of a lens at one wavelength.
///
/// Data that do not exist are `None`: the focal length of an afocal lens, the position of a pupil at
/// infinity, the magnification of an object at infinity.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FirstOrder<R> {
    /// The power in 1/mm, positive for a converging lens.
    #[serde(skip)]
    pub power: R,
    /// The equivalent focal length `1/power`, in mm.
    pub efl: Option<R>,
    /// The back focal point, from the last vertex before the image in mm.
    pub bfl: Option<R>,
    /// The front focal point, from the first vertex in mm.
    pub ffl: Option<R>,
    /// The front principal plane, from the first vertex in mm.
    pub front_principal_plane: Option<R>,
    /// The rear principal plane, from the last vertex before the image in mm.
    pub rear_principal_plane: Option<R>,
    /// The entrance pupil: the stop as seen from the object.
    pub entrance_pupil: ParaxialPupil<R>,
    /// The exit pupil: the stop as seen from the image.
    pub exit_pupil: ParaxialPupil<R>,
    /// The height of the marginal ray at the stop, in mm, not negative.
    pub stop_semi_diameter: R,
    /// The f-number: focal length over entrance pupil diameter.
    pub f_number: Option<R>,
    /// The working f-number: the reciprocal of twice the image-space numerical aperture `n'u'` of the
    /// marginal ray.
    pub working_f_number: Option<R>,
    /// The paraxial image, from the last vertex before the image in mm.
    pub paraxial_image: Option<R>,
    /// The distance from the paraxial image to the image plane, in mm.
    pub image_defocus: Option<R>,
    /// The magnification: image height over object height; `None` for an object at infinity.
    pub magnification: Option<R>,
    /// The Lagrange invariant `n (ū y − u ȳ)`, in mm.
    pub lagrange: Option<R>,
    /// The Petzval sum `Σ (n' − n) c / (n n')` in 1/mm, less `∫ 2 n₁/n² dz` in every GRIN medium
    /// `n = n₀ + n₁ r²` (Marchand 1978, chapter 9).
    pub petzval_sum: R,
    /// The marginal ray, from the axial object point through the rim of the stop.
    #[serde(skip)]
    pub marginal: ParaxialRay<R>,
    /// The chief ray, from the edge of the field through the centre of the stop; `None` for a field of
    /// 90 degrees or more, or for a collimated beam and a pupil at infinity.
    #[serde(skip)]
    pub chief: Option<ParaxialRay<R>>,
}

impl FirstOrder<f64> {
    /// The radius of the Petzval surface in mm, minus one over the Petzval sum; `None` for a flat one.
    pub fn petzval_radius(&self) -> Option<f64> {
        (self.petzval_sum != 0.0).then(|| -1.0 / self.petzval_sum)
    }
}

/// The matrix of a lens from its first vertex to every surface, as two rays.
struct TransferRays<R> {
    /// The ray with `(y, nu) = (1, 0)`.
    parallel: ParaxialRay<R>,
    /// The ray with `(y, nu) = (0, 1)`.
    slanted: ParaxialRay<R>,
    /// The signed index in front of the lens.
    index: R,
    /// The signed index behind the lens.
    index_behind: R,
    stop: usize,
    /// The last surface before the image.
    last: usize,
}

impl<R: Real> TransferRays<R> {
    fn new(system: &System<R>) -> Self {
        let indices = signed_indices(system);
        let last = system.surfaces.len().saturating_sub(2);
        Self {
            parallel: paraxial_ray(system, R::ONE, R::ZERO),
            slanted: paraxial_ray(system, R::ZERO, R::ONE / indices[0]),
            index: indices[0],
            index_behind: indices[last + 1],
            stop: system.stop.unwrap_or(0),
            last,
        }
    }

    fn power(&self) -> R {
        -(self.index_behind * self.parallel.slopes[self.last])
    }

    /// The position of the entrance pupil, from the first vertex; `None` at infinity.
    fn entrance(&self) -> Option<R> {
        let height = self.parallel.heights[self.stop];
        (height.value() != 0.0).then(|| self.index * self.slanted.heights[self.stop] / height)
    }

    /// The height at the stop of the ray with this height and slope in front of the lens.
    fn height_at_stop(&self, (y, u): (R, R)) -> R {
        y * self.parallel.heights[self.stop] + self.index * u * self.slanted.heights[self.stop]
    }

    /// The slope behind the lens of the ray with this height and slope in front of it.
    fn slope_behind(&self, (y, u): (R, R)) -> R {
        y * self.parallel.slopes[self.last] + self.index * u * self.slanted.slopes[self.last]
    }

    /// The height of the ray in the entrance pupil; `None` at infinity.
    fn height_in_pupil(&self, (y, u): (R, R)) -> Option<R> {
        self.entrance().map(|z| y + z * u)
    }

    /// The factor that scales the axial ray to the marginal ray.
    fn marginal_scale(&self, beam: &Beam) -> Result<R, ParaxialError> {
        let ray = unscaled_marginal(beam.object);
        let pupil = self.height_in_pupil(ray);
        let upwards =
            |size: R| if pupil.is_some_and(|h| h < R::ZERO) { -size.abs() } else { size.abs() };
        match beam.aperture {
            Aperture::EntrancePupilDiameter(diameter) => {
                let height = pupil.ok_or(ParaxialError::PupilAtInfinity)?;
                nonzero(height, ParaxialError::ObjectInPupil)?;
                Ok(R::from_f64(0.5 * diameter) / height)
            }
            Aperture::FNumber(f_number) => {
                let slope = self.index_behind * self.slope_behind(ray);
                nonzero(slope, ParaxialError::Afocal)?;
                Ok(upwards(R::from_f64(0.5 / f_number) / slope))
            }
            Aperture::ObjectNa(na) => {
                let index = self.index.value();
                if na >= index {
                    return Err(ParaxialError::NumericalAperture { na, index });
                }
                Ok(upwards(R::from_f64((na / index).asin().tan())))
            }
            Aperture::StopSemiDiameter(radius) => {
                let height = self.height_at_stop(ray);
                nonzero(height, ParaxialError::StopAtImage)?;
                Ok(upwards(R::from_f64(radius) / height))
            }
        }
    }

    /// Height at the first vertex and slope of the chief ray.
    fn chief(&self, beam: &Beam) -> Option<(R, R)> {
        let edge = R::from_f64(beam.edge);
        match (beam.field, beam.object) {
            (FieldKind::Angle, _) => {
                let slope = (beam.edge.abs() < 90.0).then(|| beam.edge.to_radians().tan())?;
                self.through_pupil(R::from_f64(slope))
            }
            (FieldKind::ObjectHeight, Object::Finite(distance)) => self.off_axis(distance, edge),
            (FieldKind::ImageHeight, Object::Finite(distance)) => {
                let magnification = self.magnification(distance)?;
                self.off_axis(distance, edge / magnification)
            }
            (FieldKind::ImageHeight, Object::Infinity) => {
                self.through_pupil(edge * self.power() / self.index)
            }
            (FieldKind::ObjectHeight, Object::Infinity) => None,
        }
    }

    fn through_pupil(&self, slope: R) -> Option<(R, R)> {
        self.entrance().map(|z| (-(z * slope), slope))
    }

    /// The chief ray of an object point at a height, parallel to the axis for a pupil at infinity.
    fn off_axis(&self, distance: f64, height: R) -> Option<(R, R)> {
        let Some(pupil) = self.entrance() else { return Some((height, R::ZERO)) };
        let reach = R::from_f64(distance) + pupil;
        (reach.value() != 0.0).then(|| (height * pupil / reach, -(height / reach)))
    }

    /// Image height over object height; `None` for an image at infinity.
    fn magnification(&self, distance: f64) -> Option<R> {
        let behind =
            self.index_behind * self.slope_behind(unscaled_marginal(Object::Finite(distance)));
        (behind.value() != 0.0).then(|| self.index / behind)
    }
}

/// The height at the first vertex and the slope of the marginal ray, up to a factor.
fn unscaled_marginal<R: Real>(object: Object) -> (R, R) {
    match object {
        Object::Infinity => (R::ONE, R::ZERO),
        Object::Finite(distance) => (R::from_f64(distance), R::ONE),
    }
}

fn nonzero<R: Real>(value: R, otherwise: ParaxialError) -> Result<(), ParaxialError> {
    if value.value() == 0.0 { Err(otherwise) } else { Ok(()) }
}

/// The first-order data of a lens for a beam. The first surface is the stop of a system without a
/// marked stop; the last surface is the image plane.
///
/// # Errors
/// An aperture that does not define a beam for the lens; see [`ParaxialError`].
pub fn first_order<R: Real>(
    system: &System<R>,
    beam: &Beam,
) -> Result<FirstOrder<R>, ParaxialError> {
    let basis = TransferRays::new(system);
    let last = basis.last;
    let scale = basis.marginal_scale(beam)?;
    let (y, u): (R, R) = unscaled_marginal(beam.object);
    let marginal = paraxial_ray(system, y * scale, u * scale);
    let chief = basis.chief(beam).map(|(y, u)| paraxial_ray(system, y, u));
    let power = basis.power();
    let efl = inverse(power);
    let bfl = basis.parallel.crossing(last);
    let ffl = efl.map(|f| f * basis.index * basis.index_behind * basis.slanted.slopes[last]);
    let ffl = ffl.map(|z| -z);
    let paraxial_image = marginal.crossing(last);
    let entrance_pupil = entrance_pupil(&basis, (y * scale, u * scale));
    let na = basis.index_behind * marginal.slopes[last];
    Ok(FirstOrder {
        power,
        efl,
        bfl,
        ffl,
        front_principal_plane: ffl.zip(efl).map(|(z, f)| z + basis.index * f),
        rear_principal_plane: bfl.zip(efl).map(|(z, f)| z - basis.index_behind * f),
        f_number: efl.zip(entrance_pupil.diameter).and_then(|(f, d)| ratio(f, d)),
        entrance_pupil,
        exit_pupil: exit_pupil(&basis, system, &marginal),
        stop_semi_diameter: marginal.heights[basis.stop].abs(),
        working_f_number: inverse((na + na).abs()),
        paraxial_image,
        image_defocus: paraxial_image.map(|z| system.surfaces[last].thickness - z),
        magnification: match beam.object {
            Object::Infinity => None,
            Object::Finite(distance) => basis.magnification(distance),
        },
        lagrange: chief.as_ref().map(|chief| lagrange(basis.index, &marginal, chief)),
        petzval_sum: petzval_sum(system),
        marginal,
        chief,
    })
}

fn inverse<R: Real>(value: R) -> Option<R> {
    (value.value() != 0.0).then(|| R::ONE / value)
}

fn ratio<R: Real>(over: R, under: R) -> Option<R> {
    (under.value() != 0.0).then(|| (over / under).abs())
}

fn lagrange<R: Real>(index: R, marginal: &ParaxialRay<R>, chief: &ParaxialRay<R>) -> R {
    let (y, u) = (marginal.heights[0], marginal.start_slope);
    index * (chief.start_slope * y - u * chief.heights[0])
}

fn entrance_pupil<R: Real>(basis: &TransferRays<R>, marginal: (R, R)) -> ParaxialPupil<R> {
    let diameter = basis.height_in_pupil(marginal).map(|h| (h + h).abs());
    ParaxialPupil { position: basis.entrance(), diameter }
}

/// The exit pupil, from a ray with height zero at the stop.
fn exit_pupil<R: Real>(
    basis: &TransferRays<R>,
    system: &System<R>,
    marginal: &ParaxialRay<R>,
) -> ParaxialPupil<R> {
    let stop = basis.stop;
    let height = -basis.slanted.heights[stop];
    let slope = basis.parallel.heights[stop] / basis.index;
    let position = paraxial_ray(system, height, slope).crossing(basis.last);
    let (y, u) = (marginal.heights[basis.last], marginal.slopes[basis.last]);
    ParaxialPupil { position, diameter: position.map(|z| (y + z * u).abs() * R::TWO) }
}

fn petzval_sum<R: Real>(system: &System<R>) -> R {
    let indices = signed_indices(system);
    let gaps = paraxial_grins(system);
    let (mut sum, mut n) = (R::ZERO, indices[0]);
    for (i, surface) in system.surfaces.iter().enumerate() {
        let behind = indices[i + 1];
        sum += (behind - n) * surface.curvature() / (n * behind);
        n = behind;
        if let Some(Some(gap)) = gaps.get(i) {
            sum += gap.petzval;
            n = gap.index_behind;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lens::{Shape, Surface};
    use crate::math::Dual;

    fn surface<R: Real>(curvature: f64, thickness: f64, index: f64) -> Surface<R> {
        let terms = [R::ZERO; crate::lens::ASPHERE_TERMS];
        Surface {
            shape: Shape::simplest(R::from_f64(curvature), R::ZERO, terms),
            ..Surface::plane(R::from_f64(thickness), R::from_f64(index))
        }
    }

    fn system<R: Real>(surfaces: &[(f64, f64, f64)], stop: usize) -> System<R> {
        let mut surfaces: Vec<_> = surfaces.iter().map(|(c, t, n)| surface(*c, *t, *n)).collect();
        let behind = surfaces.last().map_or(R::ONE, |s: &Surface<R>| s.index);
        surfaces.push(Surface { index: behind, ..surface(0.0, 0.0, 1.0) });
        System { index_before: R::ONE, surfaces, stop: Some(stop) }
    }

    fn beam(object: Object, aperture: Aperture) -> Beam {
        Beam { object, aperture, field: FieldKind::Angle, edge: 5.0 }
    }

    #[test]
    fn an_afocal_lens_has_no_focal_length_and_no_nan() {
        let plate = system::<f64>(&[(0.0, 5.0, 1.5), (0.0, 10.0, 1.0)], 0);
        let data =
            first_order(&plate, &beam(Object::Infinity, Aperture::EntrancePupilDiameter(4.0)))
                .unwrap();
        assert_eq!((data.power, data.efl, data.bfl, data.f_number), (0.0, None, None, None));
        assert_eq!(data.exit_pupil.diameter, Some(4.0));
        let f_number = beam(Object::Infinity, Aperture::FNumber(4.0));
        assert_eq!(first_order(&plate, &f_number), Err(ParaxialError::Afocal));
    }

    #[test]
    fn a_stop_in_the_focal_plane_is_telecentric() {
        // Stop in the back focal plane of a thin lens: the entrance pupil lies at infinity.
        let lens = system::<f64>(&[(0.02, 0.0, 1.5), (-0.02, 50.0, 1.0), (0.0, 50.0, 1.0)], 2);
        let finite = Object::Finite(50.0);
        let data = first_order(&lens, &beam(finite, Aperture::ObjectNa(0.1))).unwrap();
        assert_eq!(data.entrance_pupil, ParaxialPupil { position: None, diameter: None });
        assert!((data.stop_semi_diameter - 50.0 * 0.1f64.asin().tan()).abs() < 1e-12);
        let diameter = beam(finite, Aperture::EntrancePupilDiameter(4.0));
        assert_eq!(first_order(&lens, &diameter), Err(ParaxialError::PupilAtInfinity));
        let chief = Beam {
            field: FieldKind::ObjectHeight,
            edge: 3.0,
            ..beam(finite, Aperture::ObjectNa(0.1))
        };
        let data = first_order(&lens, &chief).unwrap();
        assert!(data.chief.unwrap().heights[2].abs() < 1e-15);
    }

    #[test]
    fn the_apertures_agree_with_each_other() {
        let lens = system::<f64>(&[(0.02, 4.0, 1.5), (0.0, 3.0, 1.0), (-0.01, 60.0, 1.0)], 1);
        for object in [Object::Infinity, Object::Finite(300.0)] {
            let given = Aperture::EntrancePupilDiameter(8.0);
            let data = first_order(&lens, &beam(object, given)).unwrap();
            let stop = Aperture::StopSemiDiameter(data.stop_semi_diameter);
            let f_number = Aperture::FNumber(data.working_f_number.unwrap());
            for aperture in [stop, f_number] {
                let same = first_order(&lens, &beam(object, aperture)).unwrap();
                let diameter = same.entrance_pupil.diameter.unwrap();
                assert!((diameter - 8.0).abs() < 1e-12, "{aperture:?}: {diameter}");
            }
        }
    }

    #[test]
    fn a_concave_mirror_focuses_at_half_its_radius() {
        let mut mirror = system::<f64>(&[(-0.01, -50.0, 1.0)], 0);
        mirror.surfaces[0].mirror = true;
        let data =
            first_order(&mirror, &beam(Object::Infinity, Aperture::EntrancePupilDiameter(10.0)))
                .unwrap();
        assert!((data.efl.unwrap() - 50.0).abs() < 1e-12);
        assert!((data.bfl.unwrap() + 50.0).abs() < 1e-12);
        assert!(
            data.rear_principal_plane.unwrap().abs() < 1e-12
                && data.image_defocus.unwrap().abs() < 1e-12
        );
        assert_eq!(data.petzval_sum, -0.02);
    }

    #[test]
    fn a_dual_carries_the_derivative_of_the_focal_length() {
        let with = |curvature: Dual<f64, 1>| {
            let mut lens = system(&[(0.02, 4.0, 1.5), (-0.01, 60.0, 1.0)], 0);
            lens.surfaces[0].shape = Shape::Sphere { curvature };
            first_order(&lens, &beam(Object::Infinity, Aperture::EntrancePupilDiameter(8.0)))
                .unwrap()
        };
        let exact = with(Dual::variable(0.02, 0));
        let h = 1e-5;
        let [up, down] = [0.02 + h, 0.02 - h].map(|c| with(Dual::constant(c)));
        let slope = (up.efl.unwrap().value - down.efl.unwrap().value) / (2.0 * h);
        assert!((exact.efl.unwrap().slope[0] / slope - 1.0).abs() < 1e-6);
        let slope = (up.bfl.unwrap().value - down.bfl.unwrap().value) / (2.0 * h);
        assert!((exact.bfl.unwrap().slope[0] / slope - 1.0).abs() < 1e-6);
    }
}
