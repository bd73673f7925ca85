//! The rays that spots are computed from, found once to a tolerance.

use super::MeritError;
use crate::lens::{Field, Lens};
use crate::pupil::{Accuracy, Bench, Launch, Nodes, Region, converged};
use crate::trace::{Points, Ray, Rays};
use serde::Serialize;

/// How one spot is sampled.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Sampled {
    /// The zoom position.
    pub zoom: usize,
    /// The field, counted from 0.
    pub field: usize,
    /// The wavelength in micrometres.
    pub um: f64,
    /// Rays traced for each value of the merit function; none where no light gets through, and the
    /// spot then counts nothing.
    pub rays: usize,
    /// The estimated relative error of the spot's radius.
    pub error: f64,
    /// The share of the paraxial entrance pupil that gets through.
    pub light: f64,
}

/// The rays of one zoom position.
#[derive(Debug, Clone)]
pub(super) struct Sampling {
    /// One for each wavelength, all fields one after the other.
    pub(super) colors: Vec<Color>,
    /// The chief ray of each field at the primary wavelength.
    pub(super) chief: Rays<f64>,
    pub(super) fields: Vec<Field>,
    sampled: Vec<Sampled>,
}

/// The rays at one wavelength.
#[derive(Debug, Clone)]
pub(super) struct Color {
    pub(super) um: f64,
    pub(super) rays: Rays<f64>,
    /// The share of each ray in the spot of its field, fields and wavelengths weighted.
    pub(super) weights: Vec<f64>,
    /// Where the rays of each field end.
    pub(super) ends: Vec<usize>,
    /// Whether the rays of each field stand for their mirror images as well.
    pub(super) mirrored: Vec<bool>,
}

impl Color {
    /// The rays of a field.
    pub(super) fn range(&self, field: usize) -> std::ops::Range<usize> {
        let start = field.checked_sub(1).map_or(0, |before| self.ends[before]);
        start..self.ends[field]
    }
}

impl Sampling {
    pub(super) fn new(lens: &Lens, zoom: usize, tolerance: f64) -> Result<Self, MeritError> {
        let bench = Bench::of(lens, zoom)?;
        let fields = bench.fields.clone();
        let total: f64 = fields.iter().map(|f| f.weight).sum();
        let colors: f64 = bench.colors.iter().map(|c| c.weight).sum();
        let mut sampling =
            Self { colors: Vec::new(), chief: Rays::default(), fields, sampled: Vec::new() };
        for (wavelength, color) in bench.colors.iter().enumerate() {
            let mut found = Color {
                um: color.um,
                rays: Rays::default(),
                weights: Vec::new(),
                ends: Vec::new(),
                mirrored: Vec::new(),
            };
            for number in 0..sampling.fields.len() {
                let field = sampling.fields[number];
                let share = field.weight / total * color.weight / colors;
                let launch = bench.launch(field, wavelength);
                let launch =
                    launch.map_err(|cause| MeritError::Launch { field: number, zoom, cause })?;
                let place =
                    Sampled { zoom, field: number, um: color.um, rays: 0, error: 0.0, light: 0.0 };
                if wavelength == bench.primary {
                    sampling.chief.push(chief(&launch).ok_or_else(|| dark(&place))?);
                }
                found.mirrored.push(launch.is_symmetric());
                if share > 0.0 {
                    sampling.sampled.push(found.add(launch, share, tolerance, place));
                }
                found.ends.push(found.weights.len());
            }
            sampling.colors.push(found);
        }
        sampling.share_of_light();
        match sampling.sampled.first() {
            Some(first) if sampling.sampled.iter().all(|s| s.rays == 0) => Err(dark(first)),
            _ => Ok(sampling),
        }
    }

    /// Spots without light leave their share to the others.
    fn share_of_light(&mut self) {
        let weights = || self.colors.iter().flat_map(|color| &color.weights);
        let lit: f64 = weights().sum();
        if lit > 0.0 {
            let all = self.colors.iter_mut().flat_map(|color| &mut color.weights);
            all.for_each(|weight| *weight /= lit);
        }
    }

    pub(super) fn sampled(&self) -> Vec<Sampled> {
        self.sampled.clone()
    }

    /// Whether no light of a field gets through at any wavelength.
    pub(super) fn is_dark(&self, field: usize) -> bool {
        self.colors.iter().all(|color| color.range(field).is_empty())
    }

    pub(super) fn chiefs(&self) -> usize {
        self.chief.len()
    }
}

fn dark(place: &Sampled) -> MeritError {
    MeritError::NoLight { field: place.field, zoom: place.zoom, um: place.um }
}

/// The ray through the centre of the pupil.
fn chief(launch: &Launch<'_>) -> Option<Ray<f64>> {
    launch.ray([0.0, 0.0])
}

impl Color {
    /// Adds the rays of one field with a share of the whole; none where no light gets through.
    fn add(&mut self, launch: Launch<'_>, share: f64, tolerance: f64, place: Sampled) -> Sampled {
        let region = Region::new(launch);
        let accuracy = Accuracy { tolerance, ..Accuracy::default() };
        let mut kept = Nodes::default();
        let spot = |nodes: &Nodes| {
            kept.clone_from(nodes);
            mean_square(&region, nodes).map(|square| [square.sqrt()])
        };
        let Some(found) = converged(&region, accuracy, spot, |values| *values) else {
            return place;
        };
        let before = self.weights.len();
        let landed = region.trace::<Points<f64>>(&kept);
        let arrived: Vec<_> = landed.arrived().collect();
        let lit: f64 = arrived.iter().map(|(_, weight)| weight).sum();
        let started = kept.points.iter().filter_map(|p| region.launch.ray(*p));
        let rays: Vec<_> = started.collect();
        for (i, weight) in arrived {
            self.rays.push(rays[i]);
            self.weights.push(share * weight / lit);
        }
        let radius = found.values[0].max(f64::MIN_POSITIVE);
        let error = found.errors[0] / radius;
        let light = lit / std::f64::consts::PI;
        Sampled { rays: self.weights.len() - before, error, light, ..place }
    }
}

/// The mean square radius of a spot about its centroid.
fn mean_square(region: &Region<'_>, nodes: &Nodes) -> Option<f64> {
    let landed = region.trace::<Points<f64>>(nodes);
    let (mut sum, mut x, mut y) = (0.0, 0.0, 0.0);
    for (i, w) in landed.arrived() {
        sum += w;
        x += if nodes.mirrored { 0.0 } else { w * landed.sink.x[i] };
        y += w * landed.sink.y[i];
    }
    if !(sum > 0.0) {
        return None;
    }
    let (x, y) = (x / sum, y / sum);
    let square = |i: usize| (landed.sink.x[i] - x).powi(2) + (landed.sink.y[i] - y).powi(2);
    Some(landed.arrived().map(|(i, w)| w * square(i)).sum::<f64>() / sum)
}
