//! Images by rays forwards: a beam through a gradient-index field onto screens.
//!
//! The value of a pixel is the irradiance averaged over its area, as that of an [`ExactRenderer`], but light is
//! followed from its source: all rays of a beam of even density carry the same light, and a pixel gathers those
//! that land in it. The beam is divided into cells, which are sampled as the pixels of a picture are: by
//! Owen-scrambled Sobol points in [`REPLICATES`] sets that are independent of each other, whose spread is the
//! error of their mean. All sets are continued in passes of twice the points until that error is small enough.
//!
//! Rays that do not arrive, or that arrive beside the image, are counted with their fates. Pixels hold whole
//! numbers of rays, so that an image does not depend on the number of threads.
//!
//! [`ExactRenderer`]: super::ExactRenderer

use super::exact::REPLICATES;
use super::projected_image::ProjectedImage;
use super::sample_points::{LONGEST, SamplePoints};
use super::tile_sampler::set_seed;
use super::{ImageFrame, ProjectionError};
use crate::grin::{
    Face, GrinFate, GrinFateCounts, GrinRay, GrinSetup, GrinTracer, IndexField, RayExit,
};
use crate::grin_design::SquareBeam;
use std::ops::ControlFlow;

/// The smallest and the largest number of cells along a side of the beam.
const CELLS: [usize; 2] = [16, 64];
/// The points of a cell of each replicate in the first pass: at least a thousand for a replicate, so that its error is
/// not taken for nothing because no ray met what there is.
const FIRST: usize = 4;
/// The largest number of pixels of an image.
const MAX_PIXELS: usize = 1 << 22;
/// The power of the number of rays with which the error falls, about: a pixel is a region of the beam with an edge,
/// which even points find more accurately than independent ones.
const FALL: f64 = 0.75;

/// The accuracy of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProjectionSettings {
    /// The error that is asked for: root mean square over the pixels, as a share of the mean of the image, or of the
    /// pixel where that is brighter; a negative one takes all rays.
    pub tolerance: f64,
    /// The largest number of rays.
    pub max_rays: usize,
    /// The seed of the samples.
    pub seed: u32,
}

impl Default for ProjectionSettings {
    fn default() -> Self {
        Self { tolerance: 0.02, max_rays: 1 << 24, seed: 0 }
    }
}

/// Told the share of the work that is done, about; ends it early.
pub type ProjectionProgress<'a> = &'a mut dyn FnMut(f64) -> ControlFlow<()>;

/// A part of a plane behind a field, or of all directions, in which light is counted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightScreen {
    /// The plane; `None` for one at infinity, where a direction has a place.
    pub face: Option<Face<f64>>,
    /// The pixels across the direction of the beam: x along its first axis, y along its second, in mm, or in tangents
    /// of angles at infinity.
    pub frame: ImageFrame,
}

/// A beam in front of a field, and screens behind it, ready to be sampled.
pub struct LightProjection<'a> {
    tracer: GrinTracer<'a, f64, dyn IndexField<f64> + 'a>,
    /// The step of a ray, in mm.
    step: f64,
    beam: SquareBeam,
    screens: Vec<LightScreen>,
}

impl std::fmt::Debug for LightProjection<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LightProjection")
            .field("beam", &self.beam)
            .field("screens", &self.screens)
            .finish_non_exhaustive()
    }
}

/// The rays that have been followed so far.
struct ProjectionWork {
    points: SamplePoints,
    /// The cells along a side of the beam.
    cells: usize,
    /// The points of each cell of each replicate.
    count: usize,
    /// By screen.
    gathered: Vec<GatheredLight>,
}

/// The rays that have reached a screen, or not.
struct GatheredLight {
    /// The rays that landed, by replicate and pixel.
    landed: Vec<u32>,
    fates: GrinFateCounts,
    beside: usize,
}

/// The square about the axis of a beam that an image shows, half its side in mm on a screen or as the tangent of an
/// angle at infinity, divided into pixels.
///
/// # Errors
/// No pixels, too many, or a square without a size.
pub fn screen_frame(half: f64, pixels: usize) -> Result<ImageFrame, ProjectionError> {
    check_positive("half the side of the image", half)?;
    let pitch = 2.0 * half / pixels.max(1) as f64;
    let frame = ImageFrame { pixels: [pixels; 2], pitch, center: [0.0; 2], inverted: false };
    check_frame(&frame).map(|()| frame)
}

fn size_error(what: &'static str, found: f64, expected: &'static str) -> ProjectionError {
    ProjectionError::Size { what, found, expected }
}

fn check_positive(what: &'static str, found: f64) -> Result<(), ProjectionError> {
    if !(found > 0.0 && found.is_finite()) {
        return Err(size_error(what, found, "a number above 0"));
    }
    Ok(())
}

fn check_beam(beam: &SquareBeam) -> Result<(), ProjectionError> {
    check_positive("half the side of the beam", beam.half)?;
    let length = beam.direction.dot(beam.direction);
    if !((length - 1.0).abs() < 1e-9) {
        return Err(size_error("the length of the direction of the beam", length.sqrt(), "1"));
    }
    if !beam.back.is_finite() {
        return Err(size_error("the distance of the beam", beam.back, "a finite number"));
    }
    Ok(())
}

fn check_frame(frame: &ImageFrame) -> Result<(), ProjectionError> {
    let all = frame.pixels[0].saturating_mul(frame.pixels[1]);
    if all == 0 || all > MAX_PIXELS {
        return Err(size_error("the number of pixels", all as f64, "from 1 to 4194304"));
    }
    check_positive("the side of a pixel", frame.pitch)
}

impl<'a> LightProjection<'a> {
    /// A beam whose rays are traced through a field, and go on straight to every screen behind it.
    ///
    /// # Errors
    /// A beam or a frame without a size, no pixels or too many, no screen, or a domain without extent.
    pub fn new(
        field: &'a (dyn IndexField<f64> + 'a),
        setup: GrinSetup<f64>,
        beam: SquareBeam,
        screens: Vec<LightScreen>,
    ) -> Result<Self, ProjectionError> {
        check_beam(&beam)?;
        screens.iter().try_for_each(|screen| check_frame(&screen.frame))?;
        if screens.is_empty() {
            return Err(size_error("the number of screens", 0.0, "1 or more"));
        }
        let setup = GrinSetup { screen: None, ..setup };
        let step = setup.step;
        Ok(Self { tracer: GrinTracer::new(field, setup)?, step, beam, screens })
    }

    /// The image on every screen, by the same rays: as many as the one with the largest error needs. Once the work is
    /// ended early they are as far as they are, and say so.
    ///
    /// An image on which not one ray of the first pass lands is left black.
    ///
    /// # Errors
    /// Fewer rays than replicates.
    pub fn render(
        &self,
        settings: &ProjectionSettings,
        progress: ProjectionProgress<'_>,
    ) -> Result<Vec<ProjectedImage>, ProjectionError> {
        let mut work = self.begin(settings)?;
        let of_count = REPLICATES * work.cells * work.cells;
        let most = (settings.max_rays / of_count).clamp(1, LONGEST);
        let (mut count, mut done) = (FIRST.min(most), 0.0_f64);
        loop {
            let completed = self.sample(&mut work, count, done, &mut *progress);
            let images = self.images(&work, completed, settings.tolerance);
            let error = images.iter().filter_map(ProjectedImage::rms_error).reduce(f64::max);
            let reached = error.is_none_or(|error| error <= settings.tolerance);
            if !completed || reached || count == most {
                return Ok(images);
            }
            let spent = count as f64 / most as f64;
            done = done.max(spent).max(expected_share(error, settings.tolerance));
            count = (2 * count).min(most);
        }
    }

    fn images(&self, work: &ProjectionWork, complete: bool, tolerance: f64) -> Vec<ProjectedImage> {
        let rays = work.count * work.cells * work.cells;
        let image = |(screen, light): (&LightScreen, &GatheredLight)| {
            let mut image = light.image(screen.frame, rays);
            image.complete = complete;
            image.reached = complete && image.rms_error().is_some_and(|error| error <= tolerance);
            image
        };
        self.screens.iter().zip(&work.gathered).map(image).collect()
    }

    fn begin(&self, settings: &ProjectionSettings) -> Result<ProjectionWork, ProjectionError> {
        let rays = settings.max_rays;
        if rays < REPLICATES {
            return Err(size_error("the largest number of rays", rays as f64, "4 or more"));
        }
        let pixels = self.screens.iter().map(|screen| screen.frame.pixels);
        let side = pixels.flatten().max().unwrap_or(1);
        // About as many cells as pixels: rays of a cell land in few of them.
        let [few, many] = CELLS;
        let cells = side.clamp(few, many).min((rays / REPLICATES).isqrt());
        let sets = (0..cells * cells * REPLICATES).map(|set| set_seed(set, settings.seed));
        Ok(ProjectionWork {
            points: SamplePoints::new(&sets.collect::<Vec<_>>(), &[]),
            cells,
            count: 0,
            gathered: self.screens.iter().map(GatheredLight::none).collect(),
        })
    }

    /// Follows rays until every cell of every replicate has had `count`; false if that was stopped, after the last
    /// number that all have.
    fn sample(
        &self,
        work: &mut ProjectionWork,
        count: usize,
        done: f64,
        progress: ProjectionProgress<'_>,
    ) -> bool {
        while work.count < count {
            if progress(done).is_break() {
                return false;
            }
            work.points.go_to(work.count, [false, false]);
            let rays = work.rays(&self.beam);
            let exits = self.tracer.trace_batch(&rays);
            for (screen, light) in self.screens.iter().zip(&mut work.gathered) {
                let sets = exits.iter().enumerate();
                sets.for_each(|(set, exit)| self.gather(light, screen, (set % REPLICATES, exit)));
            }
            work.count += 1;
        }
        true
    }

    /// Adds a ray of a replicate to its pixel of a screen.
    fn gather(
        &self,
        light: &mut GatheredLight,
        screen: &LightScreen,
        (replicate, exit): (usize, &RayExit<f64>),
    ) {
        let place = match screen.face {
            _ if !exit.fate.has_arrived() => return light.fates.add(exit.fate),
            None => self.direction(exit),
            Some(face) => {
                let Some(flight) = exit.flight_to(&face, self.step) else {
                    return light.fates.add(GrinFate::MissedScreen);
                };
                let there = exit.x + exit.v * flight;
                Some(self.beam.axes.map(|axis| axis.dot(there)))
            }
        };
        light.fates.add(exit.fate);
        match place.and_then(|place| pixel(&screen.frame, place)) {
            Some([column, row]) => {
                let [columns, rows] = screen.frame.pixels;
                light.landed[(replicate * rows + row) * columns + column] += 1;
            }
            None => light.beside += 1,
        }
    }

    /// The tangents of the direction of a ray along both axes; `None` if it goes back.
    fn direction(&self, exit: &RayExit<f64>) -> Option<[f64; 2]> {
        let along = exit.v.dot(self.beam.direction);
        (along > 0.0).then(|| self.beam.axes.map(|axis| axis.dot(exit.v) / along))
    }
}

/// Column and row of the pixel at a place; `None` beside the frame.
fn pixel(frame: &ImageFrame, place: [f64; 2]) -> Option<[usize; 2]> {
    let [right, down] = frame.place(place);
    let [columns, rows] = frame.pixels;
    let number = |share: f64, count: usize| {
        let is_inside = (0.0..1.0).contains(&share);
        is_inside.then(|| ((share * count as f64) as usize).min(count - 1))
    };
    Some([number(right, columns)?, number(down, rows)?])
}

/// The share of the rays of a tolerance that an error is expected to have taken.
fn expected_share(error: Option<f64>, tolerance: f64) -> f64 {
    let share = error.map_or(0.0, |error| (tolerance.max(0.0) / error).powf(FALL.recip()));
    share.clamp(0.0, 1.0)
}

impl ProjectionWork {
    /// The rays of a point of every set: those of all replicates of a cell are beside each other.
    fn rays(&self, beam: &SquareBeam) -> Vec<GrinRay<f64>> {
        let [right, up, ..] = self.points.columns();
        let share = |cell: usize, part: f64| (cell as f64 + part) / self.cells as f64;
        let ray = |(set, (right, up)): (usize, (&f64, &f64))| {
            let cell = set / REPLICATES;
            beam.ray([share(cell % self.cells, *right), share(cell / self.cells, *up)])
        };
        right.iter().zip(up).enumerate().map(ray).collect()
    }
}

impl GatheredLight {
    fn none(screen: &LightScreen) -> Self {
        let [columns, rows] = screen.frame.pixels;
        Self {
            landed: vec![0; REPLICATES * columns * rows],
            fates: GrinFateCounts::default(),
            beside: 0,
        }
    }

    /// The image by so many rays of each replicate.
    fn image(&self, frame: ImageFrame, rays: usize) -> ProjectedImage {
        let pixels = frame.pixels[0] * frame.pixels[1];
        // The mean is 1 where all light arrives.
        let unit = pixels as f64 / rays.max(1) as f64;
        let replicate = |r: usize| {
            let landed = &self.landed[r * pixels..][..pixels];
            landed.iter().map(|count| unit * f64::from(*count)).collect()
        };
        let replicates = std::array::from_fn(replicate);
        ProjectedImage::new(frame, replicates, (self.fates, self.beside))
    }
}
