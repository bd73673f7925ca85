//! The merit of a draft: the mean square of its spots and the squared violations of its limits.

use super::beams::FieldBeam;
use super::parameter::model;
use super::{BeamPlan, DraftParameter, Freedom, LensDraft, LimitCost, USED_TERMS};
use crate::lens::{Lens, Medium, System, glass::model_index};
use crate::search::design::LensRequirements;
use crate::search::design::judge::{asked_wavelengths, is_aspheric};
use crate::search::design::rims::StopPlace;
use crate::search::predicted_gain::QuadraticModel;
use crate::solve::{LeastSquaresPoint, SeparateResidual};
use crate::trace::{ImagePoints, Rays, SurfaceParameter, TraceSink as _, Tracer};
use nalgebra::{DMatrix, DVector};

/// The merit of a draft by its parameters.
#[derive(Debug)]
pub(in crate::search::design) struct DraftMerit<'a> {
    pub(super) draft: LensDraft,
    pub(super) asked: &'a LensRequirements,
    pub(super) plan: &'a BeamPlan,
    pub(super) freedom: Freedom,
    pub(super) parameters: Vec<DraftParameter>,
    /// The height of the beams at every surface, in mm.
    pub(super) rims: Vec<f64>,
    beams: Vec<FieldBeam>,
    /// The distance in front of the first vertex at which rays start, in mm.
    back: f64,
    systems: Vec<DraftSystem>,
    primary: usize,
    /// The numbers of the systems by which rays are differentiated.
    selected: Vec<(Option<usize>, SurfaceParameter)>,
}

/// A draft at a wavelength.
#[derive(Debug)]
struct DraftSystem {
    /// The wavelength in micrometres.
    um: f64,
    /// Its weight; all weights add up to 1.
    weight: f64,
    system: System<f64>,
}

/// A sum of squared residuals with its derivatives.
#[derive(Debug)]
pub(super) struct ResidualSum {
    point: LeastSquaresPoint,
    /// The limits that are broken, each with its surface and its violation in mm.
    pub(super) broken: Vec<(&'static str, Option<usize>, f64)>,
}

/// The rays of a wavelength with the derivatives of their image points by the parameters.
struct ChannelSpots {
    weight: f64,
    x: Vec<f64>,
    y: Vec<f64>,
    /// For each ray the derivatives of x, then those of y.
    slopes: Vec<f64>,
}

/// The radius of aspheric surfaces relative to the height of the beams on them.
const ASPHERE_ROOM: f64 = 1.3;

impl ResidualSum {
    fn new(count: usize) -> Self {
        let half_gradient = DVector::zeros(count);
        let normal = DMatrix::zeros(count, count);
        let point = LeastSquaresPoint { value: 0.0, half_gradient, normal, separate: Vec::new() };
        Self { point, broken: Vec::new() }
    }

    /// Adds a squared residual with its derivatives.
    pub(super) fn add(&mut self, weight: f64, residual: f64, slopes: &[f64]) {
        let slopes = DVector::from_column_slice(slopes);
        self.point.value += weight * residual * residual;
        self.point.half_gradient.axpy(weight * residual, &slopes, 1.0);
        self.point.normal.ger(weight, &slopes, &slopes, 1.0);
    }

    /// Adds a squared residual with its derivatives where it is positive, nothing elsewhere.
    pub(super) fn add_one_sided(&mut self, weight: f64, residual: f64, slopes: &[f64]) {
        // One that is not a number makes the sum none, and is refused with it.
        if residual > 0.0 || residual.is_nan() {
            self.add(weight, residual, slopes);
        }
        let slope = DVector::from_column_slice(slopes);
        let (value, is_one_sided, is_cheap) = (residual, true, false);
        let residual = SeparateResidual { value, slope, is_one_sided, is_cheap };
        self.point.separate.push(residual.scaled(weight));
    }
}

impl<'a> DraftMerit<'a> {
    /// The merit of a draft; `None` if its beams do not get through.
    pub(in crate::search::design) fn new(
        draft: &LensDraft,
        asked: &'a LensRequirements,
        plan: &'a BeamPlan,
        freedom: Freedom,
    ) -> Option<Self> {
        let mut draft = draft.clone();
        let freedom = Freedom { pupil: freedom.pupil && plan.traced.is_none(), ..freedom };
        let parameters = DraftParameter::all(&draft, freedom);
        clamp(&mut draft, asked, &parameters);
        let beams = plan.beams(asked);
        let back = beams.iter().map(|beam| beam.axes[1]).fold(0.0, f64::max);
        let rows = draft.lens.surfaces.len();
        let mut selected = Vec::new();
        for parameter in &parameters {
            if let DraftParameter::Surface(row, parameter) = parameter {
                selected.push((Some(*row), *parameter));
            }
        }
        let (systems, primary) = systems(&draft, asked, &parameters)?;
        let mut merit = Self {
            draft,
            asked,
            plan,
            freedom,
            parameters,
            rims: vec![0.0; rows],
            beams,
            back,
            systems,
            primary,
            selected,
        };
        merit.aim()?;
        merit.rims = merit.beam_heights()?;
        merit.limit_aspheres();
        Some(merit)
    }

    /// Gives aspheric surfaces rims somewhat outside the beams: rays are not to look for crossings where
    /// the high powers of the surface have long left it.
    fn limit_aspheres(&mut self) {
        let is_term = |parameter: &DraftParameter| match parameter {
            DraftParameter::Surface(row, SurfaceParameter::AsphereTerm(_)) => Some(*row),
            _ => None,
        };
        for row in self.parameters.iter().filter_map(is_term) {
            let radius = ASPHERE_ROOM * self.rims[row];
            for DraftSystem { system, .. } in self.systems.iter_mut().filter(|_| radius > 0.0) {
                system.surfaces[row].semi_diameter = radius;
            }
        }
    }

    /// The values of the parameters in the draft.
    pub(in crate::search::design) fn start(&self) -> Vec<f64> {
        self.parameters.iter().map(|parameter| parameter.get(&self.draft)).collect()
    }

    /// The draft with these values.
    pub(super) fn draft_at(&self, values: &[f64]) -> LensDraft {
        let mut draft = self.draft.clone();
        for (parameter, value) in self.parameters.iter().zip(values) {
            parameter.set(&mut draft, *value);
        }
        draft
    }

    /// The range by which each value may change.
    pub(super) fn room(&self, values: &[f64]) -> Vec<[f64; 2]> {
        let room = |(parameter, value): (&DraftParameter, &f64)| {
            let [low, high] = parameter.range(&self.draft, self.asked);
            [(low - value).min(0.0), (high - value).max(0.0)]
        };
        self.parameters.iter().zip(values).map(room).collect()
    }

    pub(super) fn index_of(&self, parameter: DraftParameter) -> Option<usize> {
        self.parameters.iter().position(|other| *other == parameter)
    }

    /// The merit with its derivatives; `None` if a ray is lost.
    pub(in crate::search::design) fn evaluate(
        &mut self,
        values: &[f64],
    ) -> Option<LeastSquaresPoint> {
        self.sum(values).map(|sum| sum.point)
    }

    fn sum(&mut self, values: &[f64]) -> Option<ResidualSum> {
        self.draft = self.draft_at(values);
        self.update_systems();
        let mut sum = ResidualSum::new(values.len());
        self.add_spots(&mut sum)?;
        self.add_limits(&mut sum)?;
        sum.point.value.is_finite().then_some(sum)
    }

    /// The RMS spot radius over the fields, in mm.
    pub(super) fn rms(&mut self) -> Option<f64> {
        let values = self.start();
        let sum = self.sum(&values)?;
        let squares: f64 = sum.broken.iter().map(|(_, _, v)| v * v).sum();
        Some((sum.point.value - self.plan.limit_weight * squares).max(0.0).sqrt())
    }

    /// The gains that aspheric figures promise, by row.
    pub(super) fn asphere_gains(&mut self) -> Option<Vec<(usize, f64)>> {
        let values = self.start();
        let point = self.evaluate(&values)?;
        let is_plain = |row: usize| !is_aspheric(&self.draft.lens.surfaces[row]);
        let row_of = |number: usize| match self.parameters[number] {
            DraftParameter::Surface(
                row,
                SurfaceParameter::Conic | SurfaceParameter::AsphereTerm(_),
            ) if is_plain(row) => Some(row),
            _ => None,
        };
        let is_new = |number: usize| row_of(number).is_some();
        let model = QuadraticModel::new(&point.half_gradient, &point.normal, is_new)?;
        let mut gains = vec![0.0; self.draft.lens.surfaces.len()];
        for number in 0..values.len() {
            if let Some((row, gain)) = row_of(number).zip(model.gain(number)) {
                gains[row] = f64::max(gains[row], gain / point.value.max(f64::MIN_POSITIVE));
            }
        }
        Some(gains.into_iter().enumerate().collect())
    }

    /// The costs of the limits of the draft at a minimum of the merit: by their multipliers.
    pub(super) fn limit_costs(&mut self) -> Option<Vec<LimitCost>> {
        let values = self.start();
        let sum = self.sum(&values)?;
        let weight = self.plan.limit_weight;
        let squares: f64 = sum.broken.iter().map(|(_, _, v)| weight * v * v).sum();
        let rms = (sum.point.value - squares).max(0.0).sqrt().max(1e-9);
        let of_penalty = |&(term, surface, violation): &(&'static str, Option<usize>, f64)| {
            LimitCost::of_length(term, surface, 1e3 * weight * violation.abs() / rms)
        };
        let mut costs: Vec<LimitCost> = sum.broken.iter().map(of_penalty).collect();
        for (i, parameter) in self.parameters.iter().enumerate() {
            let DraftParameter::Surface(row, SurfaceParameter::Thickness) = *parameter else {
                continue;
            };
            let [least, _] = parameter.range(&self.draft, self.asked);
            let slope = sum.point.half_gradient[i];
            if values[i] <= least && slope > 0.0 {
                let air = self.draft.lens.surfaces[row].medium == Medium::Air;
                let term = if air { "air_center" } else { "glass_center" };
                costs.push(LimitCost::of_length(term, Some(row), 1e3 * slope / rms));
            }
        }
        Some(costs)
    }

    fn update_systems(&mut self) {
        for DraftSystem { um, system, .. } in &mut self.systems {
            for parameter in &self.parameters {
                match parameter {
                    DraftParameter::Surface(row, SurfaceParameter::Index)
                    | DraftParameter::Abbe(row) => {
                        let (nd, vd) = model(&self.draft.lens, *row);
                        system.surfaces[*row].index = model_index(nd, vd, *um);
                    }
                    DraftParameter::Surface(row, number) => {
                        *number.value_mut(system, *row) = parameter.get(&self.draft);
                    }
                    DraftParameter::Pupil => {}
                }
            }
        }
    }

    /// The rays of all fields, the chief rays of all fields last.
    fn rays(&self, pupil: f64) -> Rays<f64> {
        let mut rays = Rays::default();
        self.beams.iter().for_each(|beam| beam.push_rays(pupil, self.back, &mut rays));
        self.beams.iter().for_each(|beam| rays.push(beam.ray(beam.chief, pupil, self.back)));
        rays
    }

    fn add_spots(&self, sum: &mut ResidualSum) -> Option<()> {
        let rays = self.rays(self.pupil());
        let shift = 1e-5 * self.asked.focal_length;
        let moved = self.freedom.pupil.then(|| self.rays(self.pupil() + shift));
        let channels: Option<Vec<ChannelSpots>> = (0..self.systems.len())
            .map(|c| self.channel(c, &rays, moved.as_ref(), shift))
            .collect();
        let channels = channels?;
        let total: f64 = self.beams.iter().map(|beam| beam.weight).sum();
        let mut from = 0;
        for beam in &self.beams {
            add_field(&channels, beam, from, beam.weight / total, sum);
            from += beam.points.len();
        }
        for (i, beam) in self.beams.iter().enumerate() {
            self.add_distortion(&channels[self.primary], beam, from + i, sum);
        }
        Some(())
    }

    fn pupil(&self) -> f64 {
        if self.plan.traced.is_some() { 0.0 } else { self.draft.pupil }
    }

    /// The image points of a wavelength with their derivatives.
    fn channel(
        &self,
        number: usize,
        rays: &Rays<f64>,
        moved: Option<&Rays<f64>>,
        shift: f64,
    ) -> Option<ChannelSpots> {
        let DraftSystem { um, weight, system } = &self.systems[number];
        let tracer = Tracer::new(system).ok()?;
        let (landings, matrix) = tracer.jacobian(rays, &self.selected);
        if !(0..rays.len()).all(|i| landings.fate(i).is_imaged()) {
            return None;
        }
        let by_pupil = match moved {
            None => None,
            Some(moved) => {
                let mut there = ImagePoints::<f64>::default();
                tracer.trace_batch(moved, &mut there);
                (0..rays.len()).all(|i| there.fate(i).is_imaged()).then_some(())?;
                Some(there)
            }
        };
        let width = self.selected.len();
        let count = self.parameters.len();
        let by_glass: Vec<Option<[f64; 2]>> =
            self.selected.iter().map(|selected| self.index_slopes(*selected, *um)).collect();
        let mut slopes = vec![0.0; 2 * count * rays.len()];
        let rows = matrix.chunks_exact(width).zip(slopes.chunks_exact_mut(count));
        rows.for_each(|(row, to)| spread_row(row, &by_glass, to));
        if let Some(there) = &by_pupil {
            for ray in 0..rays.len() {
                let change = [there.x[ray] - landings.x[ray], there.y[ray] - landings.y[ray]];
                slopes[(2 * ray + 1) * count - 1] = change[0] / shift;
                slopes[(2 * ray + 2) * count - 1] = change[1] / shift;
            }
        }
        Some(ChannelSpots { weight: *weight, x: landings.x, y: landings.y, slopes })
    }

    /// The derivatives of the index at a wavelength by index and Abbe number at the d line.
    fn index_slopes(
        &self,
        (row, parameter): (Option<usize>, SurfaceParameter),
        um: f64,
    ) -> Option<[f64; 2]> {
        let row = row.filter(|_| parameter == SurfaceParameter::Index)?;
        let (nd, vd) = model(&self.draft.lens, row);
        let n = |nd: f64, vd: f64| model_index(nd, vd, um);
        let step = 1e-4;
        let by_abbe = (n(nd, vd + step) - n(nd, vd - step)) / (2.0 * step);
        // The dispersion is proportional to nd - 1.
        Some([(n(nd, vd) - 1.0) / (nd - 1.0), by_abbe])
    }

    /// Adds the squared excess of the distortion of a chief ray over its limit, in mm of the image.
    fn add_distortion(
        &self,
        channel: &ChannelSpots,
        beam: &FieldBeam,
        ray: usize,
        sum: &mut ResidualSum,
    ) {
        let slope = beam.angle.tan();
        let (focal, by_focal) = self.focal_length();
        let most = (self.asked.distortion * (1.0 - 5.0 * self.plan.margin)) * slope.abs();
        let off = channel.y[ray] - focal * slope;
        let over = off.abs() - most * focal.abs();
        if slope == 0.0 {
            return;
        }
        let count = self.parameters.len();
        let mut row = channel.slopes[(2 * ray + 1) * count..(2 * ray + 2) * count].to_vec();
        let of_focal = slope + most * off.signum() * focal.signum();
        for (parameter, by) in by_focal {
            if let Some(i) = self.index_of(parameter) {
                row[i] -= of_focal * by;
            }
        }
        row.iter_mut().for_each(|by| *by *= off.signum());
        if over > 0.0 {
            sum.broken.push(("distortion", None, over));
        }
        sum.add_one_sided(self.plan.limit_weight, over, &row);
    }

    /// The focal length in mm with its derivatives, from a paraxial ray traced forwards and its
    /// adjoint traced backwards; of a near object the magnification times its distance.
    pub(super) fn focal_length(&self) -> (f64, Vec<(DraftParameter, f64)>) {
        let system = &self.systems[self.primary].system;
        let surfaces = &system.surfaces[..system.surfaces.len() - 1];
        let (mut y, mut w) = (1.0, self.asked.object_slope());
        let mut states = Vec::new();
        let mut before = 1.0;
        for surface in surfaces {
            let power = (surface.index - before) * surface.shape.curvature();
            let height = y;
            w -= power * y;
            y += surface.thickness / surface.index * w;
            states.push((height, w, before, power));
            before = surface.index;
        }
        let focal = -1.0 / w;
        let scale = focal * focal;
        let (mut of_y, mut of_w) = (0.0, 1.0);
        let mut slopes = Vec::new();
        let mut by_index_behind = vec![0.0; surfaces.len()];
        for (i, surface) in surfaces.iter().enumerate().rev() {
            let (height, w, before, power) = states[i];
            let (n, t, c) = (surface.index, surface.thickness, surface.shape.curvature());
            if i + 1 < surfaces.len() {
                slopes.push((SurfaceParameter::Thickness, i, scale * of_y * w / n));
                by_index_behind[i] -= of_y * w * t / (n * n);
                of_w += t / n * of_y;
            }
            let by_power = -of_w * height;
            slopes.push((SurfaceParameter::Curvature, i, scale * by_power * (n - before)));
            by_index_behind[i] += by_power * c;
            if i > 0 {
                by_index_behind[i - 1] -= by_power * c;
            }
            of_y -= power * of_w;
        }
        let by_index = by_index_behind
            .iter()
            .enumerate()
            .map(|(i, by)| (SurfaceParameter::Index, i, scale * by));
        let all = slopes.into_iter().chain(by_index);
        (focal, all.map(|(p, i, by)| (DraftParameter::Surface(i, p), by)).collect())
    }

    /// Shifts the beams so that their chief rays cross the axis where that of a narrow field does.
    fn aim(&mut self) -> Option<()> {
        if self.plan.traced.is_some() {
            return Some(());
        }
        let system = &self.systems[self.primary].system;
        let stop = StopPlace::find(system, self.draft.pupil);
        let (system, surface) = stop.inserted(system);
        let tracer = Tracer::new(&system).ok()?.without_rims();
        let back = self.back;
        let pupil = self.draft.pupil;
        for beam in self.beams.iter_mut().filter(|beam| beam.angle != 0.0) {
            let limit = 0.5 * beam.axes[1];
            let mut height = |center: f64| {
                beam.center = center;
                let ray = tracer.trace_to(beam.ray([0.0; 2], pupil, back), surface);
                ray.fate.is_imaged().then_some(ray.ray.point.y)
            };
            let mut center = 0.0;
            for _ in 0..4 {
                let step = 1e-3 * limit.max(1e-6);
                let Some((here, there)) = height(center).zip(height(center + step)) else { break };
                let slope = (there - here) / step;
                if !(slope.abs() > 1e-3) {
                    break;
                }
                center = (center - here / slope).clamp(-4.0 * limit, 4.0 * limit);
            }
            beam.center = if center.is_finite() { center } else { 0.0 };
        }
        Some(())
    }

    /// The heights of the beams at the surfaces, in mm; `None` if a ray is lost.
    fn beam_heights(&self) -> Option<Vec<f64>> {
        let system = &self.systems[self.primary].system;
        let heights = self.heights_in(system, self.rims.len())?;
        Some(heights.into_iter().map(|[_, all]| all).collect())
    }

    /// Points at the edge of a beam, or all points of one that is traced.
    fn edge_points(&self, beam: &FieldBeam) -> Vec<[f64; 2]> {
        let [x, y] = beam.axes;
        match self.plan.traced {
            Some(_) => beam.points.iter().map(|(point, _)| *point).collect(),
            None => vec![[0.0, y], [0.0, -y], [x, 0.0]],
        }
    }

    /// The heights of the axial beam and of all beams at the first surfaces of a system, in mm.
    fn heights_in(&self, system: &System<f64>, count: usize) -> Option<Vec<[f64; 2]>> {
        let tracer = Tracer::new(system).ok()?.without_rims();
        let mut heights = vec![[0.0_f64; 2]; count];
        for beam in &self.beams {
            let on_axis = beam.angle == 0.0;
            for point in self.edge_points(beam) {
                let ray = beam.ray(point, self.pupil(), self.back);
                let traced = tracer.visit(ray, |i, at| {
                    raise(&mut heights, i, at.x.hypot(at.y), on_axis);
                });
                traced.fate.is_imaged().then_some(())?;
            }
        }
        Some(heights)
    }
}

/// The heights of the axial beam and of all beams of a draft at the rows of its lens with a
/// diaphragm, in mm, where all beams are wider than asked for by the factor `surplus`.
pub(in crate::search::design) fn beam_heights(
    draft: &LensDraft,
    asked: &LensRequirements,
    lens: &Lens,
    surplus: f64,
) -> Option<Vec<[f64; 2]>> {
    let plan = BeamPlan { difficulty: [surplus, 1.0], ..BeamPlan::full(1.0) };
    let freedom = Freedom { glasses: false, aspheric_surfaces: 0, terms: USED_TERMS, pupil: true };
    let merit = DraftMerit::new(draft, asked, &plan, freedom)?;
    let mut system = lens.resolve(0, lens.wavelengths[lens.primary()].um).ok()?;
    for surface in &mut system.surfaces {
        surface.semi_diameter = f64::INFINITY;
    }
    merit.heights_in(&system, lens.surfaces.len())
}

/// Raises the heights of the axial beam and of all beams at a surface to that of a ray.
fn raise(heights: &mut [[f64; 2]], surface: usize, height: f64, on_axis: bool) {
    if let Some([axial, all]) = heights.get_mut(surface) {
        *all = all.max(height);
        *axial = if on_axis { axial.max(height) } else { *axial };
    }
}

/// The derivatives by the parameters from those by the numbers of a system: a glass has two
/// parameters, index and Abbe number, in place of the index.
fn spread_row(row: &[f64], by_glass: &[Option<[f64; 2]>], to: &mut [f64]) {
    let mut column = 0;
    for (value, by_glass) in row.iter().zip(by_glass) {
        let factors = by_glass.as_ref().map_or(&[1.0][..], |both| &both[..]);
        for factor in factors {
            to[column] = value * factor;
            column += 1;
        }
    }
}

/// Adds the spot of a field about its centroid over all wavelengths.
fn add_field(
    channels: &[ChannelSpots],
    beam: &FieldBeam,
    from: usize,
    share: f64,
    sum: &mut ResidualSum,
) {
    let count = sum.point.half_gradient.len();
    let on_axis = beam.angle == 0.0;
    let (mut mean, mut mean_slope) = (0.0, vec![0.0; count]);
    if !on_axis {
        for channel in channels {
            for (i, (_, weight)) in beam.points.iter().enumerate() {
                let (ray, weight) = (from + i, weight * channel.weight);
                mean += weight * channel.y[ray];
                let slopes = &channel.slopes[(2 * ray + 1) * count..(2 * ray + 2) * count];
                mean_slope.iter_mut().zip(slopes).for_each(|(to, by)| *to += weight * by);
            }
        }
    }
    let rays = channels.len() * beam.points.len();
    let mut rows = DMatrix::zeros(count, 2 * rays);
    let mut residuals = DVector::zeros(2 * rays);
    let all = channels.iter().flat_map(|channel| {
        beam.points.iter().enumerate().map(move |(i, (_, weight))| (channel, from + i, weight))
    });
    for (number, (channel, ray, weight)) in all.enumerate() {
        let root = (share * weight * channel.weight).sqrt();
        let slopes = &channel.slopes[2 * ray * count..(2 * ray + 2) * count];
        let (of_x, of_y) = slopes.split_at(count);
        residuals[2 * number] = root * channel.x[ray];
        residuals[2 * number + 1] = root * (channel.y[ray] - mean);
        let mut to = rows.column_mut(2 * number);
        to.iter_mut().zip(of_x).for_each(|(to, slope)| *to = root * slope);
        let mut to = rows.column_mut(2 * number + 1);
        let centred = of_y.iter().zip(&mean_slope).map(|(slope, mean)| root * (slope - mean));
        to.iter_mut().zip(centred).for_each(|(to, slope)| *to = slope);
    }
    sum.point.value += residuals.norm_squared();
    sum.point.half_gradient.gemv(1.0, &rows, &residuals, 1.0);
    sum.point.normal.gemm(1.0, &rows, &rows.transpose(), 1.0);
}

/// The systems of a draft at the wavelengths that are asked for, with shapes that have all
/// parameters, and the index of the primary one.
fn systems(
    draft: &LensDraft,
    asked: &LensRequirements,
    parameters: &[DraftParameter],
) -> Option<(Vec<DraftSystem>, usize)> {
    let total: f64 = asked.wavelengths.iter().map(|(_, weight)| weight).sum();
    let mut systems = Vec::new();
    for (um, weight) in &asked.wavelengths {
        let mut system = draft.lens.resolve(0, *um).ok()?;
        for parameter in parameters {
            if let DraftParameter::Surface(row, number) = parameter {
                number.promote_shape(&mut system, *row);
            }
        }
        for surface in &mut system.surfaces {
            surface.semi_diameter = f64::INFINITY;
        }
        systems.push(DraftSystem { um: *um, weight: weight / total, system });
    }
    let lens = asked_wavelengths(asked);
    let primary = lens.iter().position(|w| w.primary).unwrap_or(0);
    Some((systems, primary))
}

/// Moves the parameters of a draft into their ranges.
fn clamp(draft: &mut LensDraft, asked: &LensRequirements, parameters: &[DraftParameter]) {
    for parameter in parameters {
        let [low, high] = parameter.range(draft, asked);
        let value = parameter.get(draft);
        let inside = value.max(low).min(high);
        if inside != value {
            parameter.set(draft, inside);
        }
    }
    for row in &mut draft.lens.surfaces {
        if let Medium::Model { nd, .. } = &mut row.medium {
            *nd = nd.max(1.3);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::search::design::LensSpecification;
    use crate::search::design::starts::{achromats, library_starts};

    fn requirements(spec: &str) -> LensRequirements {
        let spec: LensSpecification = serde_json::from_str(spec).unwrap();
        LensRequirements::complete(&spec).unwrap().0
    }

    /// The terms that a merit counts as broken.
    fn broken(merit: &mut DraftMerit<'_>, values: &[f64]) -> Vec<&'static str> {
        let mut terms: Vec<_> = merit.sum(values).unwrap().broken.iter().map(|b| b.0).collect();
        terms.sort_unstable();
        terms.dedup();
        terms
    }

    /// Every derivative against a central difference, with every limit broken that needs no rays.
    #[test]
    fn the_merit_of_a_draft_has_the_derivative_of_its_value() {
        let asked = requirements(
            r#"{"focal_length_mm": 60.0, "f_number": 5.0, "half_field_deg": 4.0,
                "max_elements": 2, "min_back_focus_mm": 70.0, "max_track_mm": 75.0}"#,
        );
        let mut draft = achromats(&asked).swap_remove(1).draft;
        // Outside the map of glasses on both sides, too thin at its rim, and off the focal length.
        draft.lens.surfaces[0].medium = Medium::Model { nd: 1.75, vd: 62.0 };
        draft.lens.surfaces[1].medium = Medium::Model { nd: 1.52, vd: 32.0 };
        draft.lens.surfaces[0].curvature *= 1.2;
        draft.lens.surfaces[0].thickness = 0.5;
        draft.lens.surfaces[1].thickness = 25.0;
        draft.lens.surfaces[2].conic = -0.5;
        let freedom =
            Freedom { glasses: true, aspheric_surfaces: 1, terms: USED_TERMS, pupil: true };
        let plan = BeamPlan { margin: 0.05, ..BeamPlan::full(0.3) };
        let mut merit = DraftMerit::new(&draft, &asked, &plan, freedom).unwrap();
        let values = merit.start();
        let terms = broken(&mut merit, &values);
        for term in ["back_focus", "focal_length", "glass", "glass_edge", "total_track"] {
            assert!(terms.contains(&term), "{term} is not broken: {terms:?}");
        }
        let point = merit.evaluate(&values).unwrap();
        for (i, parameter) in merit.parameters.clone().into_iter().enumerate() {
            let step = match parameter {
                DraftParameter::Surface(_, SurfaceParameter::Curvature) => 1e-7,
                DraftParameter::Surface(_, SurfaceParameter::AsphereTerm(term)) => {
                    1e-5 * 1e-2_f64.powi(term as i32)
                }
                DraftParameter::Surface(_, SurfaceParameter::Index) => 1e-6,
                _ => 1e-4,
            };
            let mut value = |by: f64| {
                let mut values = values.clone();
                values[i] += by;
                merit.evaluate(&values).unwrap().value
            };
            let difference = (value(step) - value(-step)) / (2.0 * step);
            let found = 2.0 * point.half_gradient[i];
            let size = found.abs().max(difference.abs()).max(1e-9);
            assert!(
                (found - difference).abs() < 1e-4 * size,
                "{parameter:?}: {found:e}, by a difference {difference:e}"
            );
        }
    }

    #[test]
    fn the_focal_length_of_a_draft_is_that_of_first_order_optics() {
        let asked =
            requirements(r#"{"focal_length_mm": 80.0, "f_number": 8.0, "half_field_deg": 2.0}"#);
        for start in achromats(&asked) {
            let plan = BeamPlan::full(1.0);
            let freedom =
                Freedom { glasses: false, aspheric_surfaces: 0, terms: USED_TERMS, pupil: false };
            let merit = DraftMerit::new(&start.draft, &asked, &plan, freedom).unwrap();
            let beam = crate::paraxial::Beam::for_lens(&start.draft.lens, 0);
            let system = &merit.systems[merit.primary].system;
            let exact = crate::paraxial::first_order(system, &beam).unwrap().efl.unwrap();
            assert!((merit.focal_length().0 / exact - 1.0).abs() < 1e-10, "{exact}");
        }
    }

    /// Chief rays cross the axis where that of a narrow field does, although the lens in front of
    /// the stop has an aberration of its pupil.
    #[test]
    fn beams_are_aimed_at_the_middle_of_the_stop() {
        let asked = requirements(
            r#"{"focal_length_mm": 60.0, "f_number": 4.0, "half_field_deg": 22.0, "max_elements": 6}"#,
        );
        let plan = BeamPlan::full(1.0);
        let freedom =
            Freedom { glasses: false, aspheric_surfaces: 0, terms: USED_TERMS, pupil: false };
        let mut moved: f64 = 0.0;
        for start in library_starts(&asked, &[]).iter().take(4) {
            let draft = &start.draft;
            let Some(merit) = DraftMerit::new(draft, &asked, &plan, freedom) else { continue };
            let system = &merit.systems[merit.primary].system;
            let (system, stop) = StopPlace::find(system, draft.pupil).inserted(system);
            let tracer = Tracer::new(&system).unwrap().without_rims();
            for beam in merit.beams.iter().filter(|beam| beam.angle != 0.0) {
                let chief = tracer.trace_to(beam.ray([0.0; 2], draft.pupil, merit.back), stop);
                let height = chief.ray.point.y;
                assert!(height.abs() < 1e-3 * beam.axes[1], "{}: {height}", start.name);
                moved = moved.max(beam.center.abs());
            }
        }
        assert!(moved > 0.01, "nothing to aim: {moved}");
    }

    #[test]
    fn a_focal_length_is_broken_by_what_is_beyond_its_range() {
        let asked =
            requirements(r#"{"focal_length_mm": 80.0, "f_number": 8.0, "half_field_deg": 2.0}"#);
        let plan = BeamPlan::full(1.0);
        let freedom =
            Freedom { glasses: false, aspheric_surfaces: 0, terms: USED_TERMS, pupil: false };
        let start = achromats(&asked).swap_remove(0).draft;
        for sign in [-1.0, 1.0] {
            let (mut before, mut found) = (80.0, None);
            for i in 0..400 {
                let mut draft = start.clone();
                for row in &mut draft.lens.surfaces {
                    row.curvature /= 1.0 + sign * 1e-4 * f64::from(i);
                }
                let mut merit = DraftMerit::new(&draft, &asked, &plan, freedom).unwrap();
                let values = merit.start();
                let focal = merit.focal_length().0;
                let sum = merit.sum(&values).unwrap();
                let broken = sum.broken.iter().find(|broken| broken.0 == "focal_length");
                found = broken.map(|broken| broken.2);
                if let Some(violation) = found {
                    // The first that is out of range is out by less than the last change.
                    let change: f64 = focal - before;
                    assert!(violation > 0.0 && (focal - 80.0) * sign > 0.0, "{focal}: {violation}");
                    assert!(violation <= 1.01 * change.abs(), "{focal}: {violation} {change}");
                    break;
                }
                before = focal;
            }
            assert!(found.is_some());
        }
    }
}
