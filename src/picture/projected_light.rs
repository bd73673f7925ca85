//! Images by rays forwards: a beam through a gradient-index field onto a screen.
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
use crate::grin::{GrinFateCounts, GrinRay, GrinSetup, GrinTracer, IndexField, RayExit};
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

/// A beam in front of a field, and the screen behind it, ready to be sampled.
pub struct LightProjection<'a> {
    tracer: GrinTracer<'a, f64, dyn IndexField<f64> + 'a>,
    beam: SquareBeam,
    frame: ImageFrame,
    is_far: bool,
}

impl std::fmt::Debug for LightProjection<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LightProjection")
            .field("beam", &self.beam)
            .field("frame", &self.frame)
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
    check_pixels([pixels; 2])?;
    check_positive("half the side of the image", half)?;
    let pitch = 2.0 * half / pixels as f64;
    Ok(ImageFrame { pixels: [pixels; 2], pitch, center: [0.0; 2], inverted: false })
}

fn size_error(what: &'static str, found: f64, expected: &'static str) -> ProjectionError {
    ProjectionError::Size { what, found, expected }
}

fn check_pixels([columns, rows]: [usize; 2]) -> Result<(), ProjectionError> {
    let all = columns.saturating_mul(rows);
    if all == 0 || all > MAX_PIXELS {
        return Err(size_error("the number of pixels", all as f64, "from 1 to 4194304"));
    }
    Ok(())
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

impl<'a> LightProjection<'a> {
    /// A beam whose rays are traced through a field onto the plane at the end of the setup, or into their directions
    /// if it has none. The frame is across the direction of the beam: x along its first axis, y along its second.
    ///
    /// # Errors
    /// A beam or a frame without a size, no pixels or too many, or a domain without extent.
    pub fn new(
        field: &'a (dyn IndexField<f64> + 'a),
        setup: GrinSetup<f64>,
        beam: SquareBeam,
        frame: ImageFrame,
    ) -> Result<Self, ProjectionError> {
        check_beam(&beam)?;
        check_pixels(frame.pixels)?;
        check_positive("the side of a pixel", frame.pitch)?;
        let is_far = setup.screen.is_none();
        Ok(Self { tracer: GrinTracer::new(field, setup)?, beam, frame, is_far })
    }

    /// The image. Once the work is ended early it is as far as it is, and says so.
    ///
    /// An image on which not one ray of the first pass lands is left black.
    ///
    /// # Errors
    /// Fewer rays than replicates.
    pub fn render(
        &self,
        settings: &ProjectionSettings,
        progress: ProjectionProgress<'_>,
    ) -> Result<ProjectedImage, ProjectionError> {
        let mut work = self.begin(settings)?;
        let of_count = REPLICATES * work.cells * work.cells;
        let most = (settings.max_rays / of_count).clamp(1, LONGEST);
        let (mut count, mut done) = (FIRST.min(most), 0.0_f64);
        loop {
            let completed = self.sample(&mut work, count, done, &mut *progress);
            let mut image = work.image(self.frame);
            image.complete = completed;
            let error = image.rms_error();
            let reached = error.is_some_and(|error| error <= settings.tolerance);
            if !completed || reached || error.is_none() || count == most {
                image.reached = completed && reached;
                return Ok(image);
            }
            let spent = count as f64 / most as f64;
            done = done.max(spent).max(expected_share(error, settings.tolerance));
            count = (2 * count).min(most);
        }
    }

    fn begin(&self, settings: &ProjectionSettings) -> Result<ProjectionWork, ProjectionError> {
        let rays = settings.max_rays;
        if rays < REPLICATES {
            return Err(size_error("the largest number of rays", rays as f64, "4 or more"));
        }
        let [columns, rows] = self.frame.pixels;
        // About as many cells as pixels: rays of a cell land in few of them.
        let [few, many] = CELLS;
        let cells = columns.max(rows).clamp(few, many).min((rays / REPLICATES).isqrt());
        let sets = (0..cells * cells * REPLICATES).map(|set| set_seed(set, settings.seed));
        Ok(ProjectionWork {
            points: SamplePoints::new(&sets.collect::<Vec<_>>(), &[]),
            cells,
            count: 0,
            landed: vec![0; REPLICATES * columns * rows],
            fates: GrinFateCounts::default(),
            beside: 0,
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
            let sets = exits.iter().enumerate();
            sets.for_each(|(set, exit)| self.gather(work, set % REPLICATES, exit));
            work.count += 1;
        }
        true
    }

    /// Adds a ray of a replicate to its pixel.
    fn gather(&self, work: &mut ProjectionWork, replicate: usize, exit: &RayExit<f64>) {
        work.fates.add(exit.fate);
        if !exit.fate.has_arrived() {
            return;
        }
        let [columns, rows] = self.frame.pixels;
        match self.pixel(exit) {
            Some([column, row]) => {
                work.landed[(replicate * rows + row) * columns + column] += 1;
            }
            None => work.beside += 1,
        }
    }

    /// Column and row of the pixel in which a ray lands; `None` beside the image.
    fn pixel(&self, exit: &RayExit<f64>) -> Option<[usize; 2]> {
        let along = exit.v.dot(self.beam.direction);
        if !(along > 0.0) {
            return None;
        }
        let place = self
            .beam
            .axes
            .map(|axis| if self.is_far { axis.dot(exit.v) / along } else { axis.dot(exit.x) });
        let [right, down] = self.frame.place(place);
        let [columns, rows] = self.frame.pixels;
        let number = |share: f64, count: usize| {
            let is_inside = (0.0..1.0).contains(&share);
            is_inside.then(|| ((share * count as f64) as usize).min(count - 1))
        };
        Some([number(right, columns)?, number(down, rows)?])
    }
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

    /// The image so far.
    fn image(&self, frame: ImageFrame) -> ProjectedImage {
        let pixels = frame.pixels[0] * frame.pixels[1];
        let rays = self.count * self.cells * self.cells;
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
