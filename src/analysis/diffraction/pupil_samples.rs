//! The light of a pupil on the reference sphere, at the nodes of a quadrature.

use super::Interruption;
use super::pupil_traces::TracedLight;
use crate::analysis::AnalysisError;
use crate::analysis::reference_sphere::ReferenceSphere;
use crate::pupil::{Accuracy, ConvergedList, Nodes, Region, converge_resolved};
use std::f64::consts::{PI, TAU};

/// The light of a pupil at some of its points.
#[derive(Debug, Clone, Default)]
pub struct PupilSamples {
    /// The direction cosines across the axis from the sphere to its centre.
    pub cosines: Vec<[f64; 2]>,
    /// The pupil point of each; empty for a pupil that is given by a formula.
    pub points: Vec<[f64; 2]>,
    /// The path difference at each point, in wavelengths.
    pub waves: Vec<f64>,
    /// The integrals of the amplitude over the cosines around each point.
    pub amplitudes: Vec<f64>,
    /// The energy of each point: the area of its beam.
    pub energies: Vec<f64>,
    /// True if every point stands for its mirror image `(−α, β)` as well; amplitudes and energies
    /// count both.
    pub mirrored: bool,
    /// The wavelength in the image space, in mm.
    pub wavelength: f64,
}

/// The order of quadrature of few rays.
const FEW: usize = 2;
/// The nodes along a radius for each turn of the phase from which on Gauss rules converge: sums over fewer are
/// as small as those of a dark place, and agree with each other.
pub(super) const NODES_PER_TURN: f64 = PI;

/// A complex number as its real and imaginary part.
pub(super) type Complex = [f64; 2];

impl PupilSamples {
    /// Numbers of the light of a pupil, of so many nodes that the tolerance is kept; errors are absolute.
    /// With the largest distance in mm from the centre of the sphere of the points that they belong to, the
    /// first order resolves the phase of the light there. `interrupted` is asked before every order.
    ///
    /// # Errors
    /// The pupil is dark or folds, or the computation was interrupted.
    pub(super) fn converge(
        region: &Region<'_>,
        sphere: &ReferenceSphere,
        reach: Option<f64>,
        accuracy: Accuracy,
        interrupted: &Interruption<'_>,
        numbers: impl FnMut(&Self) -> Result<Vec<f64>, AnalysisError>,
    ) -> Result<ConvergedList, AnalysisError> {
        let least = |few: &Self| {
            let turns = reach.map_or(0.0, |reach| few.turns(reach));
            (NODES_PER_TURN * turns).ceil() as usize
        };
        Self::converge_from(region, sphere, least, accuracy, interrupted, numbers)
    }

    /// The same from the order on that has a number of nodes along a radius, which may depend on the light of few
    /// rays.
    ///
    /// # Errors
    /// The same.
    pub(super) fn converge_from(
        region: &Region<'_>,
        sphere: &ReferenceSphere,
        least: impl FnOnce(&Self) -> usize,
        accuracy: Accuracy,
        interrupted: &Interruption<'_>,
        mut numbers: impl FnMut(&Self) -> Result<Vec<f64>, AnalysisError>,
    ) -> Result<ConvergedList, AnalysisError> {
        // A pupil that folds does so for few rays already.
        let few = Self::of_nodes(region, sphere, &region.nodes(FEW))?;
        let mut refused = None;
        let mut of_order = |nodes: &Nodes| {
            if interrupted() {
                return Err(AnalysisError::Interrupted);
            }
            numbers(&Self::of_nodes(region, sphere, nodes)?)
        };
        let at_nodes = |nodes: &Nodes| match of_order(nodes) {
            Ok(values) => Some(values),
            Err(why) => {
                refused = Some(why);
                None
            }
        };
        let least = least(&few);
        let ones = |list: &[f64]| vec![1.0; list.len()];
        let found = converge_resolved(region, accuracy, least, at_nodes, ones);
        match refused.filter(|why| *why != AnalysisError::NoLight) {
            Some(why) => Err(why),
            None => found.ok_or(AnalysisError::NoLight),
        }
    }

    /// The turns of the phase over a radius of the pupil, in the light towards a point of the image at a
    /// distance from the centre of the sphere in mm: those of the path differences and those of the way.
    pub(super) fn turns(&self, reach: f64) -> f64 {
        let most = self.waves.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let least = self.waves.iter().copied().fold(f64::INFINITY, f64::min);
        most - least + self.spread() * reach / self.wavelength
    }

    /// The radius of the pupil about its middle, in direction cosines.
    pub(super) fn spread(&self) -> f64 {
        let sum = self.cosines.iter().fold([0.0; 2], |s, c| [s[0] + c[0], s[1] + c[1]]);
        let [x, y] = sum.map(|sum| sum / self.cosines.len() as f64);
        // The middle of both halves lies on the line of symmetry.
        let x = if self.mirrored { 0.0 } else { x };
        self.cosines.iter().map(|[a, b]| (a - x).hypot(b - y)).fold(0.0, f64::max)
    }

    /// The light of a pupil at some nodes.
    ///
    /// # Errors
    /// The cosines are no coordinates of the pupil, since it folds there; or no ray arrives.
    pub(in crate::analysis) fn of_nodes(
        region: &Region<'_>,
        sphere: &ReferenceSphere,
        nodes: &Nodes,
    ) -> Result<Self, AnalysisError> {
        TracedLight::new(region, nodes).on(sphere)
    }

    /// The integral of the squared amplitude over the cosines.
    pub fn energy(&self) -> f64 {
        self.energies.iter().sum()
    }

    /// The integral of the amplitude over the cosines: the field at the centre without aberrations.
    pub fn peak(&self) -> f64 {
        self.amplitudes.iter().sum()
    }

    /// The field at a point of the image, x and y in mm from the centre of the sphere.
    pub(super) fn field(&self, [x, y]: [f64; 2]) -> Complex {
        let (kx, ky) = (x / self.wavelength, y / self.wavelength);
        let (mut re, mut im) = (0.0, 0.0);
        for ((cosines, waves), amplitude) in
            self.cosines.iter().zip(&self.waves).zip(&self.amplitudes)
        {
            let across = kx * cosines[0];
            let (phase, factor) = if self.mirrored {
                (ky * cosines[1] - waves, (TAU * across).cos())
            } else {
                (ky * cosines[1] - waves + across, 1.0)
            };
            let (sin, cos) = (TAU * phase).sin_cos();
            re += amplitude * factor * cos;
            im += amplitude * factor * sin;
        }
        [re, im]
    }

    /// The intensity at a point of the image over that of the same pupil without aberrations at its
    /// peak; x and y in mm from the centre of the sphere.
    pub fn intensity(&self, point: [f64; 2]) -> f64 {
        let [re, im] = self.field(point);
        (re * re + im * im) / self.peak().powi(2)
    }
}
