//! Bounded quantities of chief rays and of first and third order, differentiated by dual numbers.
//!
//! A chief ray enters the lens where it did when the merit function was set up, as those of the
//! distortion do; it is the same ray at all wavelengths.

use super::constraints::{ConstraintMargin, along_light, sag_at};
use super::first_order::image_scale;
use super::spot::{lost_chief_error, paraxial_heights};
use super::sum::{DerivativeLevel, SumOfSquares};
use super::{EvaluationContext, MeritError, Term, WeightedTerm};
use crate::lens::{
    Aperture, IndexRange, LensError, OperandKind, System, TemperatureChange, TermScope,
    TermSelection, paraxial_image_distance,
};
use crate::math::{Real, Vec3};
use crate::paraxial::{SeidelSums, first_order, seidel};
use crate::trace::{Ray, Tracer};
use nalgebra::DVector;

/// A bounded quantity at one place of a lens.
pub(super) struct OperandValue {
    pub(super) margin: ConstraintMargin,
    /// Its derivatives by the variables; zeros unless they are asked for.
    pub(super) slope: DVector<f64>,
}

/// Adds the squared violations of a bounded quantity.
pub(super) fn add_operand(
    context: &EvaluationContext<'_>,
    weighted: WeightedTerm,
    sum: &mut SumOfSquares,
) -> Result<(), MeritError> {
    for OperandValue { margin, slope } in operand_values(context, weighted, sum.level)? {
        let ConstraintMargin { value, min, max, .. } = margin;
        match (min, max) {
            (Some(min), Some(max)) if min == max => sum.add_residual(1.0, value - min, &slope),
            _ => {
                min.into_iter().for_each(|min| sum.add_one_sided(1.0, min - value, -&slope));
                max.into_iter().for_each(|max| sum.add_one_sided(1.0, value - max, slope.clone()));
            }
        }
    }
    Ok(())
}

/// The values of a bounded quantity at all places of its scope; none for any other term, and at a zoom
/// position outside its scope.
pub(super) fn operand_values(
    context: &EvaluationContext<'_>,
    weighted: WeightedTerm,
    level: DerivativeLevel,
) -> Result<Vec<OperandValue>, MeritError> {
    let WeightedTerm { term, scope, .. } = weighted;
    let zoom = context.zoom.zoom;
    let Term::Operand { kind, min, max } = term else { return Ok(Vec::new()) };
    if !scope.has(TermSelection::Zooms, zoom) {
        return Ok(Vec::new());
    }
    let operand = Operand { context, kind, scope };
    let systems = context.systems.of_wavelengths(context.zoom.primary);
    let count = context.values.len();
    let mut values = Vec::new();
    for site in operand.sites() {
        let value = operand.measure(&systems, site)?;
        let um = site.wavelength.map(|i| context.sampling.channels[i].um);
        let OperandSite { surface, field, .. } = site;
        let margin =
            ConstraintMargin { term: kind.name(), surface, field, zoom, um, value, min, max };
        values.push((site, OperandValue { margin, slope: DVector::zeros(count) }));
    }
    if level > DerivativeLevel::Value {
        for (first, systems) in context.zoom.all_systems_along(context.systems) {
            for (site, value) in &mut values {
                let slopes = operand.measure(&systems, *site)?.slope;
                value.slope.iter_mut().skip(first).zip(slopes).for_each(|(to, by)| *to = by);
            }
        }
    }
    Ok(values.into_iter().map(|(_, value)| value).collect())
}

/// A quantity and where it is measured.
struct Operand<'a> {
    context: &'a EvaluationContext<'a>,
    kind: OperandKind,
    scope: TermScope,
}

/// A place of a quantity.
#[derive(Debug, Clone, Copy, Default)]
struct OperandSite {
    surface: Option<usize>,
    field: Option<usize>,
    /// The index of the wavelength, of a scope that names some.
    wavelength: Option<usize>,
}

impl Operand<'_> {
    /// The number of surfaces without the image.
    fn rows(&self) -> usize {
        self.context.zoom.is_glass.len()
    }

    fn sites(&self) -> Vec<OperandSite> {
        let last = self.rows() - 1;
        let surfaces: Vec<Option<usize>> = match (self.kind, self.scope.surfaces) {
            (OperandKind::Gap, None) => (0..last).map(Some).collect(),
            (OperandKind::Sag, None) => (0..=last).filter(|i| self.has_rim(*i)).map(Some).collect(),
            (OperandKind::IncidenceAngle, None) => (0..=last).map(Some).collect(),
            (OperandKind::Track, _) | (_, None) => vec![None],
            (kind, Some(_)) if kind.is_third_order() => vec![None],
            (OperandKind::Sag, Some([first, end])) => {
                (first..=end).filter(|i| self.has_rim(*i)).map(Some).collect()
            }
            (_, Some([first, end])) => (first..=end).map(Some).collect(),
        };
        let fields = self.fields();
        let wavelengths = self.wavelengths();
        let mut sites = Vec::new();
        for surface in surfaces {
            for field in &fields {
                let site = |wavelength: &Option<usize>| OperandSite {
                    surface,
                    field: *field,
                    wavelength: *wavelength,
                };
                sites.extend(wavelengths.iter().map(site));
            }
        }
        sites
    }

    fn has_rim(&self, surface: usize) -> bool {
        self.context.systems.manufactured.surfaces[surface].outer_radius().is_finite()
    }

    /// The fields whose chief rays are asked for, without those that have no light.
    fn fields(&self) -> Vec<Option<usize>> {
        if !self.kind.traces_chief_rays() {
            return vec![None];
        }
        let sampling = self.context.sampling;
        let is_off_axis = |field: usize| {
            let point = sampling.fields[field];
            self.kind != OperandKind::Distortion || point.x != 0.0 || point.y != 0.0
        };
        let asked = |field: &usize| {
            let is_chosen = self.scope.has(TermSelection::Fields, *field);
            is_chosen && !sampling.is_dark(*field) && is_off_axis(*field)
        };
        (0..sampling.chief_rays.len()).filter(asked).map(Some).collect()
    }

    /// The wavelengths at which a chief ray is traced by itself.
    fn wavelengths(&self) -> Vec<Option<usize>> {
        let compares = matches!(
            self.kind,
            OperandKind::LateralColor | OperandKind::AxialColor | OperandKind::SecondarySpectrum
        );
        match self.scope.wavelengths {
            Some([first, last]) if !compares => (first..=last).map(Some).collect(),
            _ => vec![None],
        }
    }

    /// The quantity at a place, in mm or degrees.
    fn measure<R: Real>(&self, systems: &[System<R>], site: OperandSite) -> Result<R, MeritError> {
        let system = &systems[site.wavelength.unwrap_or(self.context.zoom.primary)];
        let surface = site.surface.unwrap_or(self.rows() - 1);
        Ok(match self.kind {
            OperandKind::Gap => along_light(system, surface),
            OperandKind::Track => {
                let [first, last] = self.scope.surfaces.unwrap_or([0, self.rows() - 1]);
                (first..=last).fold(R::ZERO, |sum, gap| sum + along_light(system, gap))
            }
            OperandKind::Sag => {
                let surface = &system.surfaces[surface];
                sag_at(surface, surface.semi_diameter)
            }
            OperandKind::AxialColor => {
                let [short, long] = self.outer_wavelengths();
                let object = self.context.zoom.object;
                paraxial_image_distance(&systems[short], object)
                    - paraxial_image_distance(&systems[long], object)
            }
            OperandKind::SecondarySpectrum => {
                let [short, long] = self.outer_wavelengths();
                let primary = self.context.zoom.primary;
                if [short, long].contains(&primary) {
                    let why = "the primary wavelength is not between two others";
                    return Err(MeritError::DoesNotApply { term: self.kind.name(), why });
                }
                let [short, middle, long] = [short, primary, long]
                    .map(|i| paraxial_image_distance(&systems[i], self.context.zoom.object));
                middle - (short + long) * R::from_f64(0.5)
            }
            OperandKind::ThermalFocus => {
                let changes = self.context.zoom.temperature_changes()?;
                let focus = |change: &TemperatureChange| self.defocus(&change.apply(system));
                focus(&changes[1]) - focus(&changes[0])
            }
            OperandKind::LateralColor => {
                let [short, long] = self.outer_wavelengths();
                let image = self.rows();
                self.chief(&systems[short], site)?.height(image)?
                    - self.chief(&systems[long], site)?.height(image)?
            }
            OperandKind::ChiefRayHeight => {
                self.chief(system, site)?.height(site.surface.unwrap_or(self.rows()))?
            }
            OperandKind::Distortion => self.distortion(system, site)?,
            OperandKind::ChiefRayAngle | OperandKind::Telecentricity => {
                self.chief(system, site)?.angle_behind(surface)?
            }
            OperandKind::IncidenceAngle => self.chief(system, site)?.incidence(surface)?,
            kind => self.third_order(kind, systems, system)?,
        })
    }

    /// The height of a chief ray in the image over that without distortion, minus 1, in percent.
    fn distortion<R: Real>(&self, system: &System<R>, site: OperandSite) -> Result<R, MeritError> {
        let chief = self.chief(system, site)?;
        let ideal = paraxial_heights(self.context)?[site.field.unwrap_or(0)];
        let along = ideal[0] * chief.along[0] + ideal[1] * chief.along[1];
        let ideal = image_scale(system, self.context.zoom.object) * R::from_f64(along);
        let ratio = chief.height(self.rows())? * (R::ONE / ideal);
        Ok((ratio - R::ONE) * R::from_f64(100.0))
    }

    /// The distance from the image plane to the paraxial image, in mm.
    fn defocus<R: Real>(&self, system: &System<R>) -> R {
        let gap = system.surfaces[self.rows() - 1].thickness;
        paraxial_image_distance(system, self.context.zoom.object) - gap
    }

    /// The wavelengths of the scope at the ends of the spectrum, the shorter one first.
    fn outer_wavelengths(&self) -> [usize; 2] {
        let channels = &self.context.sampling.channels;
        let [first, last] = self.scope.wavelengths.unwrap_or([0, channels.len() - 1]);
        let by_length = |a: &usize, b: &usize| channels[*a].um.total_cmp(&channels[*b].um);
        let shortest = (first..=last).min_by(by_length).unwrap_or(first);
        let longest = (first..=last).max_by(by_length).unwrap_or(last);
        [shortest, longest]
    }

    fn chief<'s, R: Real>(
        &'s self,
        system: &'s System<R>,
        site: OperandSite,
    ) -> Result<ChiefRay<'s, R>, MeritError> {
        if system.has_poses() {
            let why = "surfaces are decentred or tilted, and a chief ray has no plane then";
            return Err(MeritError::DoesNotApply { term: self.kind.name(), why });
        }
        let field = site.field.unwrap_or(0);
        let tracer = Tracer::new(system).map_err(LensError::from)?.without_rims();
        let point = self.context.sampling.fields[field];
        let size = point.x.hypot(point.y);
        let along = if size > 0.0 { [point.x / size, point.y / size] } else { [0.0, 1.0] };
        let ray = self.context.sampling.chief_rays.get(field).cast();
        Ok(ChiefRay { context: self.context, field, system, tracer, ray, along })
    }

    /// A third-order sum over the surfaces of the scope.
    fn third_order<R: Real>(
        &self,
        kind: OperandKind,
        systems: &[System<R>],
        system: &System<R>,
    ) -> Result<R, MeritError> {
        let missing = |why| MeritError::DoesNotApply { term: kind.name(), why };
        let zoom = self.context.zoom;
        let data = first_order(system, &zoom.beam).map_err(crate::pupil::RayModelError::from)?;
        let [short, long] = self.outer_wavelengths();
        let outer = Some((&systems[short], &systems[long]));
        let sums = seidel(system, &data, outer)
            .ok_or_else(|| missing("the lens has no chief ray, or a gradient-index medium"))?;
        let chosen: IndexRange = self.scope.surfaces.unwrap_or([0, self.rows() - 1]);
        let all = sums.surfaces[chosen[0]..=chosen[1]].iter();
        let sum = all.fold(R::ZERO, |sum, at| sum + third_order_sum(kind, at));
        Ok(sum * self.beam_width(system, kind))
    }

    /// The change of a third-order sum with the stop, whose size is the aperture: the beam is as wide as
    /// the stop is now, and the sum grows with a power of it.
    fn beam_width<R: Real>(&self, system: &System<R>, kind: OperandKind) -> R {
        let zoom = self.context.zoom;
        let Aperture::StopSemiDiameter(radius) = zoom.beam.aperture else { return R::ONE };
        let width = system.surfaces[zoom.stop].semi_diameter * R::from_f64(1.0 / radius);
        let power = match kind {
            OperandKind::SphericalAberration => 4,
            OperandKind::Coma => 3,
            OperandKind::Astigmatism | OperandKind::PetzvalCurvature => 2,
            _ => 1,
        };
        (0..power).fold(R::ONE, |product, _| product * width)
    }
}

fn third_order_sum<R: Real>(kind: OperandKind, sums: &SeidelSums<R>) -> R {
    match kind {
        OperandKind::SphericalAberration => sums.s1,
        OperandKind::Coma => sums.s2,
        OperandKind::Astigmatism => sums.s3,
        OperandKind::PetzvalCurvature => sums.s4,
        _ => sums.s5,
    }
}

/// The chief ray of a field in one system.
struct ChiefRay<'a, R> {
    context: &'a EvaluationContext<'a>,
    field: usize,
    system: &'a System<R>,
    tracer: Tracer<R>,
    ray: Ray<R>,
    /// The direction of the field across the axis.
    along: [f64; 2],
}

impl<R: Real> ChiefRay<'_, R> {
    /// The ray behind a surface.
    fn behind(&self, surface: usize) -> Result<Ray<R>, MeritError> {
        let traced = self.tracer.trace_to(self.ray, surface);
        if traced.fate.is_imaged() {
            Ok(traced.ray)
        } else {
            Err(lost_chief_error(self.context, self.field, traced.fate))
        }
    }

    /// The part of a vector along the field.
    fn across(&self, vector: Vec3<R>) -> R {
        vector.x * R::from_f64(self.along[0]) + vector.y * R::from_f64(self.along[1])
    }

    fn height(&self, surface: usize) -> Result<R, MeritError> {
        Ok(self.across(self.behind(surface)?.point))
    }

    fn angle_behind(&self, surface: usize) -> Result<R, MeritError> {
        let direction = self.behind(surface)?.direction;
        Ok(degrees(self.across(direction), direction.z))
    }

    /// The angle between the ray in front of a surface and the normal there.
    fn incidence(&self, surface: usize) -> Result<R, MeritError> {
        let before = surface.checked_sub(1).map(|before| self.behind(before)).transpose()?;
        let direction = before.unwrap_or(self.ray).direction;
        let point = self.behind(surface)?.point;
        let shape = &self.system.surfaces[surface].shape;
        let r2 = point.x * point.x + point.y * point.y;
        let slope = shape.sag(r2).map_or(R::ZERO, |(_, slope)| slope);
        let (across, along) = (self.across(direction), direction.z);
        let normal = -(slope + slope) * self.across(point);
        Ok(degrees(across - along * normal, across * normal + along))
    }
}

/// The angle in degrees, −90 to 90, between a line with these components across and along the axis
/// and the axis.
fn degrees<R: Real>(across: R, along: R) -> R {
    let (across, along) = if along < R::ZERO { (-across, -along) } else { (across, along) };
    let length = (across * across + along * along).sqrt();
    let (sin, cos) = (across * (R::ONE / length), along * (R::ONE / length));
    let at = sin.value().atan2(cos.value());
    // The sine of the difference to a fixed angle has the derivative of the angle.
    let difference = sin * R::from_f64(at.cos()) - cos * R::from_f64(at.sin());
    (R::from_f64(at) + difference) * R::from_f64(1f64.to_degrees())
}
