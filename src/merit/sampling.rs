//! The rays that spots are computed from: the pupils, sampled once to a tolerance.

use super::{Goal, MeritError, Term};
use crate::analysis::{ReferenceForm, TransferRays, brightest_strehl, rms_without_tilt, transfer};
use crate::lens::{FieldPoint, Lens, TermScope, TermSelection};
use crate::pupil::{
    Accuracy, Aiming, FixedLaunch, Launch, Nodes, PupilMoments, RayModel, Region, RegionKind,
    TracedPupil, converge_every_order,
};
use crate::trace::{Ray, Rays};
use rayon::prelude::*;
use serde::Serialize;
use std::f64::consts::PI;

/// The sampling of one spot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SpotSampling {
    /// The zoom position, counted from 0.
    pub zoom: usize,
    /// The field, counted from 0.
    pub field: usize,
    /// The wavelength in micrometres.
    pub um: f64,
    /// Rays traced per evaluation of the merit function; 0 if no light gets through, and the spot
    /// then has no weight.
    pub rays: usize,
    /// The estimated relative error of the spot's radius.
    pub error: f64,
    /// The fraction of the paraxial entrance pupil that is transmitted.
    pub light: f64,
    /// The area of the pupil in mm² of the first vertex plane.
    pub area: f64,
}

/// The error of a transfer that counts as much as the whole radius of a spot: its integrand
/// oscillates, and a hundredth of contrast is more than a designer can tell.
pub(super) const TRANSFER_SCALE: f64 = 5.0;

/// The numbers of wavefronts that terms ask for, each with those before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub(super) enum WaveDemand {
    #[default]
    Nothing,
    /// The RMS wavefront, and so optical paths.
    Wavefront,
    /// The Strehl ratio, which needs more rays.
    Strehl,
}

/// The demands of terms on the rays, besides spots.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct SamplingDemand {
    /// The numbers of wavefronts that terms ask for.
    pub(super) waves: WaveDemand,
    /// The spatial frequencies of terms about contrast, in cycles/mm.
    pub(super) frequencies: Vec<f64>,
    /// True if the rays are for errors of making, in which a lens is not symmetric about its axis.
    pub(super) errors: bool,
    /// True if a term asks for contrast by diffraction.
    pub(super) diffraction: bool,
}

impl SamplingDemand {
    /// True if a term asks for wavefronts.
    pub(super) fn has_waves(&self) -> bool {
        self.waves > WaveDemand::Nothing
    }

    pub(super) fn of_goal(goal: &Goal) -> Self {
        let mut demand = Self::default();
        for weighted in &goal.terms {
            match weighted.term {
                Term::Wavefront => demand.waves = demand.waves.max(WaveDemand::Wavefront),
                Term::Strehl => demand.waves = WaveDemand::Strehl,
                Term::GeometricMtf { frequency, .. } => demand.frequencies.push(frequency),
                Term::Mtf { .. } => demand.diffraction = true,
                _ => {}
            }
        }
        demand
    }

    /// The numbers that must converge: the radius of the spot, the RMS wavefront and the Strehl ratio if they are
    /// asked for, and the transfer at each frequency. `None` if no ray arrives.
    fn numbers(
        &self,
        region: &Region<'_>,
        nodes: &Nodes,
        reference: Option<ReferenceForm>,
    ) -> Option<Vec<f64>> {
        let moments = region.moments(nodes);
        if !(moments.area > 0.0) {
            return None;
        }
        let mut numbers = vec![moments.rms_radius()];
        if let Some(form) = reference {
            numbers.push(rms_without_tilt(region, nodes, form).unwrap_or(0.0));
            if self.waves == WaveDemand::Strehl {
                numbers.push(brightest_strehl(region, nodes, form).unwrap_or(0.0));
            }
        }
        if !self.frequencies.is_empty() {
            numbers.extend(transfer(region, nodes, moments.centroid, &self.frequencies)?);
        }
        Some(numbers)
    }

    /// The scales of [`SamplingDemand::numbers`]: lengths and waves are relative, a Strehl
    /// ratio and a transfer are not.
    fn scales(&self, numbers: &[f64]) -> Vec<f64> {
        let relative = 1 + usize::from(self.has_waves());
        let scale = |(i, value): (usize, &f64)| if i < relative { *value } else { TRANSFER_SCALE };
        numbers.iter().enumerate().map(scale).collect()
    }
}

/// The pupil of one field and wavelength, as last found.
#[derive(Debug, Clone)]
pub(super) struct SampledPupil {
    pub(super) field: usize,
    pub(super) wavelength: usize,
    /// Its normalized weight by field and wavelength, without dark pupils: all add up to 1.
    pub(super) share: f64,
    /// Its weight in means of light, which include dark pupils.
    pub(super) weight: f64,
    /// The cosine of the angle with the axis at which a collimated beam arrives.
    cosine: Option<f64>,
    fixed_launch: FixedLaunch,
    /// Its form when its rays were found: the one that the order of quadrature is for.
    found: RegionKind,
    /// Its form in the lens that is tracked from: the one whose rays were found, or one followed since.
    kind: RegionKind,
    /// The order of quadrature that reaches the tolerance.
    order: usize,
    /// The form of its reference sphere; `None` if no term asks for the wavefront.
    pub(super) reference: Option<ReferenceForm>,
    /// The rays of its transfer by diffraction; `None` if no term asks for it, or if it has none.
    pub(super) transfer: Option<TransferRays>,
    pub(super) moments: PupilMoments,
    /// [`TracedPupil::signed_area`], in mm².
    pub(super) area: f64,
    /// The area of the ideal entrance pupil, in mm².
    ideal_area: f64,
}

/// The rays of one zoom position.
#[derive(Debug, Clone)]
pub(super) struct RaySampling {
    /// The rays of each wavelength, all fields one after the other.
    pub(super) channels: Vec<ChannelRays>,
    /// The chief ray of each field at the primary wavelength.
    pub(super) chief_rays: Rays<f64>,
    pub(super) fields: Vec<FieldPoint>,
    pub(super) pupils: Vec<SampledPupil>,
    pub(super) aiming: Aiming,
    spot_samplings: Vec<SpotSampling>,
    demand: SamplingDemand,
    /// The largest estimated error of a transfer; 0 if none is asked for.
    pub(super) transfer_error: f64,
}

/// The rays at one wavelength.
#[derive(Debug, Clone)]
pub(super) struct ChannelRays {
    pub(super) um: f64,
    pub(super) rays: Rays<f64>,
    /// The image points of the rays through the lens in which their pupils were found, in mm.
    pub(super) points: Vec<[f64; 2]>,
    /// The weight of each ray in the spot of its field, including the weights of fields and
    /// wavelengths.
    pub(super) weights: Vec<f64>,
    /// The optical path from the object to the start of each ray, in mm; empty if no term asks for
    /// it.
    pub(super) paths: Vec<f64>,
    /// The index behind the last ray of each field.
    pub(super) ends: Vec<usize>,
    /// True for each field whose rays also represent their mirror images.
    pub(super) mirrored: Vec<bool>,
}

impl ChannelRays {
    fn new(um: f64) -> Self {
        Self {
            um,
            rays: Rays::default(),
            points: Vec::new(),
            weights: Vec::new(),
            paths: Vec::new(),
            ends: Vec::new(),
            mirrored: Vec::new(),
        }
    }

    /// Adds the rays of a pupil, which together have the weight `share`.
    fn add_pupil(&mut self, traced: &TracedPupil<'_>, share: f64, with_paths: bool) {
        let weight: f64 = traced.landed.arrivals().map(|(_, w)| w).sum();
        for (i, w) in traced.landed.arrivals() {
            self.rays.push(traced.rays.get(i));
            if with_paths {
                self.paths.push(traced.path_to(traced.rays.get(i)));
            }
            self.points.push([traced.landed.sink.x[i], traced.landed.sink.y[i]]);
            self.weights.push(share * w / weight);
        }
    }

    /// The rays of a field.
    pub(super) fn range(&self, field: usize) -> std::ops::Range<usize> {
        let start = field.checked_sub(1).map_or(0, |before| self.ends[before]);
        start..self.ends[field]
    }
}

impl SampledPupil {
    /// True if its field and its wavelength are in a scope.
    pub(super) fn is_in(&self, scope: TermScope) -> bool {
        scope.has(TermSelection::Fields, self.field)
            && scope.has(TermSelection::Wavelengths, self.wavelength)
    }
}

impl RaySampling {
    /// Finds the pupils of a lens, each sampled so that the radius of its spot is accurate to a
    /// relative tolerance. A lens without any light is an error unless `dark_too`.
    pub(super) fn new(
        lens: &Lens,
        zoom: usize,
        tolerance: f64,
        dark_too: bool,
        demand: SamplingDemand,
    ) -> Result<Self, MeritError> {
        let model = RayModel::from_lens(lens, zoom)?;
        let mut sampling = Self {
            channels: Vec::new(),
            chief_rays: Rays::default(),
            fields: model.fields.clone(),
            pupils: Vec::new(),
            aiming: model.aiming,
            spot_samplings: Vec::new(),
            demand,
            transfer_error: 0.0,
        };
        let total: f64 = sampling.fields.iter().map(|f| f.weight).sum();
        let channels: f64 = model.channels.iter().map(|c| c.weight).sum();
        for (wavelength, channel) in model.channels.iter().enumerate() {
            for number in 0..sampling.fields.len() {
                let field = sampling.fields[number];
                let spot = SpotSampling::unlit(zoom, number, channel.um);
                let launch = model.launch(field, wavelength);
                let launch =
                    launch.map_err(|cause| MeritError::Launch { field: number, zoom, cause })?;
                if wavelength == model.primary {
                    sampling.chief_rays.push(chief_ray(&launch).ok_or_else(|| no_light(&spot))?);
                }
                let share = field.weight / total * channel.weight / channels;
                if share > 0.0 {
                    sampling.find_pupil(launch, share, tolerance, spot);
                }
            }
        }
        sampling.redistribute_dark_shares();
        let traced = sampling.trace_pupils(&model, false);
        sampling.channels = sampling.channel_rays(&model, &traced);
        for (sampled, (pupil, traced)) in
            sampling.spot_samplings.iter_mut().zip(sampling.pupils.iter_mut().zip(&traced))
        {
            (pupil.moments, pupil.area) = (traced.moments, traced.signed_area());
            sampled.area = traced.moments.area;
            sampled.light = traced.landed.arrivals().map(|(_, w)| w).sum::<f64>() / PI;
            sampled.rays = if sampled.light > 0.0 { traced.rays.len() } else { 0 };
        }
        match sampling.spot_samplings.first() {
            Some(first) if !dark_too && sampling.spot_samplings.iter().all(|s| s.rays == 0) => {
                Err(no_light(first))
            }
            _ => Ok(sampling),
        }
    }

    /// Finds the pupil of a field and the order of quadrature that it needs.
    fn find_pupil(&mut self, launch: Launch<'_>, share: f64, tolerance: f64, spot: SpotSampling) {
        let (field, wavelength) = (spot.field, launch.wavelength);
        let (fixed_launch, cosine) = (launch.to_fixed(), launch.axis_cosine());
        let ideal_area = PI * launch.area();
        let region = Region::new(launch);
        let asked = self.demand.has_waves();
        let reference = asked.then(|| ReferenceForm::of_region(&region).ok()).flatten();
        let accuracy = Accuracy { tolerance, ..Accuracy::default() };
        let numbers = |nodes: &Nodes| self.demand.numbers(&region, nodes, reference);
        let found =
            converge_every_order(&region, accuracy, numbers, |list| self.demand.scales(list));
        let relative = if reference.is_some() { 2 } else { 1 };
        let [mut error, mut transfer_error] = [0.0f64; 2];
        for (i, (value, change)) in
            found.iter().flat_map(|f| f.values.iter().zip(&f.errors)).enumerate()
        {
            if i < relative {
                error = error.max(change / value.max(f64::MIN_POSITIVE));
            } else {
                transfer_error = transfer_error.max(*change);
            }
        }
        let find = || TransferRays::find(&region, TRANSFER_SCALE * tolerance).ok();
        let transfer = self.demand.diffraction.then(find).flatten();
        transfer_error = transfer_error.max(transfer.map_or(0.0, |rays| rays.error));
        self.transfer_error = self.transfer_error.max(transfer_error);
        // Without light no order is better than another one, and the highest would take millions of rays.
        let orders = match &found {
            Some(found) => found.orders,
            None if region.is_sampled() => 1,
            None => region.orders(),
        };
        let (kind, moments) = (region.kind, PupilMoments::default());
        let order = orders.saturating_sub(1);
        self.pupils.push(SampledPupil {
            field,
            wavelength,
            share,
            weight: share,
            cosine,
            fixed_launch,
            found: kind.clone(),
            kind,
            order,
            reference,
            transfer,
            moments,
            area: 0.0,
            ideal_area,
        });
        self.spot_samplings.push(SpotSampling { error, ..spot });
    }

    /// Distributes the weight of dark pupils among the others.
    fn redistribute_dark_shares(&mut self) {
        let has_light = |pupil: &&mut SampledPupil| {
            !matches!(pupil.kind, RegionKind::Dark | RegionKind::Unbounded)
        };
        let traced: f64 = self.pupils.iter_mut().filter(has_light).map(|pupil| pupil.share).sum();
        if traced > 0.0 {
            self.pupils.iter_mut().filter(has_light).for_each(|pupil| pupil.share /= traced);
        }
    }

    /// Traces every pupil through a lens: as last found, or with its edge tracked to the present
    /// lens.
    pub(super) fn trace_pupils<'a>(
        &self,
        model: &'a RayModel,
        track: bool,
    ) -> Vec<TracedPupil<'a>> {
        let traced = |pupil: &SampledPupil| {
            let launch = pupil.fixed_launch.launch(model);
            let region = if track {
                Region::track(&pupil.kind, launch)
            } else {
                Region { launch, kind: pupil.kind.clone(), rays: 0 }
            };
            self.trace_region(pupil, &region)
        };
        self.pupils.par_iter().map(traced).collect()
    }

    /// Traces pupils whose forms are known, one for each of the sampling.
    pub(super) fn trace_forms<'a>(
        &self,
        model: &'a RayModel,
        known: &[TracedPupil<'_>],
    ) -> Vec<TracedPupil<'a>> {
        let traced = |(pupil, known): (&SampledPupil, &TracedPupil<'_>)| {
            let launch = pupil.fixed_launch.launch(model);
            let region = Region { launch, kind: known.form().clone(), rays: 0 };
            self.trace_region(pupil, &region)
        };
        self.pupils.par_iter().zip(known).map(traced).collect()
    }

    fn trace_region<'a>(&self, pupil: &SampledPupil, region: &Region<'a>) -> TracedPupil<'a> {
        let order = region.order_like(&pupil.found, pupil.order);
        if self.demand.frequencies.is_empty() && !self.demand.errors {
            region.trace_pupil(order)
        } else {
            region.trace_whole_pupil(order)
        }
    }

    /// The rays of the same pupils for errors of making, of an order of quadrature that is lower by
    /// `fewer`.
    pub(super) fn for_errors(&self, model: &RayModel, fewer: usize) -> Self {
        let mut sampling = self.clone();
        sampling.demand = SamplingDemand { errors: true, ..SamplingDemand::default() };
        let pupils = sampling.pupils.iter_mut();
        pupils.for_each(|pupil| pupil.order = pupil.order.saturating_sub(fewer));
        let traced = sampling.trace_pupils(model, false);
        sampling.with_pupils(model, &traced)
    }

    /// The highest order of quadrature.
    pub(super) fn highest_order(&self) -> usize {
        self.pupils.iter().map(|pupil| pupil.order).max().unwrap_or(0)
    }

    /// The rays of all pupils.
    pub(super) fn rays(&self) -> usize {
        self.channels.iter().map(|channel| channel.weights.len()).sum()
    }

    /// Tracks the pupils from these forms from now on, one for each.
    pub(super) fn follow_pupils(&mut self, forms: Vec<RegionKind>) {
        for (pupil, form) in self.pupils.iter_mut().zip(forms) {
            pupil.kind = form;
        }
    }

    /// Returns an error if a pupil has gone dark since it was found: its spot would be empty, and
    /// so the sharpest of all.
    pub(super) fn check_light(&self, traced: &[TracedPupil<'_>]) -> Result<(), MeritError> {
        let was_lit = |pupil: &SampledPupil| pupil.moments.area > 0.0;
        let mut all = self.pupils.iter().zip(traced).zip(&self.spot_samplings);
        match all.find(|((pupil, traced), _)| was_lit(pupil) && !(traced.moments.area > 0.0)) {
            Some((_, spot)) => Err(no_light(spot)),
            None => Ok(()),
        }
    }

    /// The same sampling with the rays of traced pupils.
    pub(super) fn with_pupils(&self, model: &RayModel, traced: &[TracedPupil<'_>]) -> Self {
        let mut pupils = self.pupils.clone();
        for (pupil, traced) in pupils.iter_mut().zip(traced) {
            (pupil.moments, pupil.area) = (traced.moments, traced.signed_area());
        }
        Self { channels: self.channel_rays(model, traced), pupils, ..self.clone() }
    }

    /// The rays of all pupils, sorted by wavelength and field.
    fn channel_rays(&self, model: &RayModel, traced: &[TracedPupil<'_>]) -> Vec<ChannelRays> {
        let mut channels: Vec<ChannelRays> =
            model.channels.iter().map(|c| ChannelRays::new(c.um)).collect();
        for (wavelength, channel) in channels.iter_mut().enumerate() {
            let mirrors_in_x = model.channels[wavelength].system.mirrors_in_x();
            for field in 0..self.fields.len() {
                channel.mirrored.push(mirrors_in_x && self.fields[field].x == 0.0);
                let is_same = |(pupil, _): &(&SampledPupil, &TracedPupil<'_>)| {
                    (pupil.wavelength, pupil.field) == (wavelength, field)
                };
                let mine = self.pupils.iter().zip(traced).filter(is_same);
                mine.for_each(|(pupil, traced)| {
                    channel.add_pupil(traced, pupil.share, self.demand.has_waves());
                });
                channel.ends.push(channel.weights.len());
            }
        }
        channels
    }

    /// The areas of the pupils in mm²; for dark ones those of the ideal entrance pupil.
    pub(super) fn areas(&self) -> Vec<f64> {
        let area =
            |pupil: &SampledPupil| if pupil.area > 0.0 { pupil.area } else { pupil.ideal_area };
        self.pupils.iter().map(area).collect()
    }

    /// The index of the field on the axis, if there is one.
    pub(super) fn axis(&self) -> Option<usize> {
        self.fields.iter().position(|field| field.x == 0.0 && field.y == 0.0)
    }

    /// True if a pupil is that of a field on the axis.
    pub(super) fn is_axial(&self, pupil: &SampledPupil) -> bool {
        let field = self.fields[pupil.field];
        field.x == 0.0 && field.y == 0.0
    }

    /// The cosine of the angle with the axis at which the beam of a field arrives.
    pub(super) fn cosine(&self, field: usize) -> Option<f64> {
        self.pupils.iter().find(|pupil| pupil.field == field)?.cosine
    }

    pub(super) fn spot_samplings(&self) -> Vec<SpotSampling> {
        self.spot_samplings.clone()
    }

    /// True if no light of a field gets through at any wavelength.
    pub(super) fn is_dark(&self, field: usize) -> bool {
        self.channels.iter().all(|channel| channel.range(field).is_empty())
    }

    pub(super) fn chief_count(&self) -> usize {
        self.chief_rays.len()
    }
}

impl SpotSampling {
    fn unlit(zoom: usize, field: usize, um: f64) -> Self {
        Self { zoom, field, um, rays: 0, error: 0.0, light: 0.0, area: 0.0 }
    }
}

fn no_light(spot: &SpotSampling) -> MeritError {
    MeritError::NoLight { field: spot.field, zoom: spot.zoom, um: spot.um }
}

/// The ray through the centre of the pupil.
fn chief_ray(launch: &Launch<'_>) -> Option<Ray<f64>> {
    launch.ray([0.0, 0.0])
}
