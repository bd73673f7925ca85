//! Vignetting factors of foreign files: the part of the entrance pupil that the beam of each field fills.
//!
//! A lens here has no factors: its rims clip. Factors are either left out, so that the rims of the file
//! alone clip, or every surface becomes as wide as the beams with factors need it. The rims then clip what
//! the factors cut where the beam of that field alone decides the width of a surface, as a mechanical
//! design does; the report names the difference of each field.

use super::probe_rays::ProbeLaunch;
use super::report::{ConversionOutcome, ConversionReport};
use crate::lens::{Aperture, FieldPoint, Lens, LensError, Quantity, SurfaceNumber};
use crate::trace::Tracer;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use std::ops::Range;

/// The treatment of the vignetting factors of a foreign file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VignettingChoice {
    /// The apertures of the file clip, and its factors are left out.
    #[default]
    Rims,
    /// Every surface is as wide as the rays at the edges of the factors need it.
    Factors,
}

impl VignettingChoice {
    /// Both choices.
    pub const ALL: [Self; 2] = [Self::Rims, Self::Factors];

    /// The name of the choice.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rims => "rims",
            Self::Factors => "factors",
        }
    }
}

/// The vignetting factors of every field, at every zoom position; empty without factors.
pub(super) type ZoomedFactors = Vec<Vec<PupilFactors>>;

/// True if some of the factors leave a part of the pupil dark, and all of them a part that is lit.
pub(super) fn are_usable(factors: &ZoomedFactors) -> bool {
    let all = || factors.iter().flatten();
    all().any(|own| *own != PupilFactors::default()) && all().all(PupilFactors::is_possible)
}

/// The factors of a field at a zoom position.
fn of_field(factors: &ZoomedFactors, zoom: usize, field: usize) -> PupilFactors {
    factors.get(zoom).and_then(|own| own.get(field)).copied().unwrap_or_default()
}

/// The vignetting factors of a field: the ellipse of the unit pupil that its beam fills.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct PupilFactors {
    /// The displacement of the centre (VDX, VDY).
    pub(super) decenter: [f64; 2],
    /// The reduction of the semi-axes (VCX, VCY).
    pub(super) compression: [f64; 2],
    /// The turn of the ellipse about the axis, in degrees (VAN).
    pub(super) angle: f64,
}

impl PupilFactors {
    /// The factors of an upper and a lower edge in one direction: displacement and reduction.
    pub(super) const fn of_edges(upper: f64, lower: f64) -> [f64; 2] {
        [0.5 * (lower - upper), 0.5 * (lower + upper)]
    }

    /// True if the beam fills a part of the pupil that has an area.
    pub(super) fn is_possible(&self) -> bool {
        self.compression.iter().all(|reduction| *reduction < 1.0)
    }

    /// The point of the pupil for a point of the unit disc.
    fn point(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let ([dx, dy], [cx, cy]) = (self.decenter, self.compression);
        let (u, v) = (dx + x * (1.0 - cx), dy + y * (1.0 - cy));
        let (sin, cos) = self.angle.to_radians().sin_cos();
        [u * cos - v * sin, u * sin + v * cos]
    }

    /// True for a point of the pupil that the beam fills.
    fn has_point(&self, [x, y]: [f64; 2]) -> bool {
        let (sin, cos) = self.angle.to_radians().sin_cos();
        let (u, v) = (x * cos + y * sin, y * cos - x * sin);
        let ([dx, dy], [cx, cy]) = (self.decenter, self.compression);
        ((u - dx) / (1.0 - cx)).hypot((v - dy) / (1.0 - cy)) <= 1.0
    }
}

/// The note on factors that are left out.
pub(super) const LEFT_OUT: &str =
    "vignetting factors are left out: the rims clip; the choice `factors` sets the rims by them";
/// The number of rays at the edge of a pupil.
const EDGE_RAYS: usize = 64;
/// The number of rays over a pupil that tell factors and rims apart.
const PUPIL_RAYS: usize = 2000;
/// The part by which a rim is wider than its outermost ray, so that rounding clips no ray of the edge.
const MARGIN: f64 = 1e-6;

/// The largest distance in mm from the vertex at which rays at the edge of a beam with these factors meet
/// each surface: over all fields and wavelengths, and some zoom positions. `None` for a surface that a ray of
/// the edge does not reach. Rims do not clip these rays.
///
/// # Errors
/// A lens that cannot be resolved.
pub(super) fn beam_reach(
    lens: &Lens,
    factors: &ZoomedFactors,
    zooms: Range<usize>,
) -> Result<Vec<Option<f64>>, LensError> {
    let mut reach = vec![Some(0.0_f64); lens.surfaces.len()];
    for zoom in zooms {
        let launch = ProbeLaunch::new(lens, zoom)?;
        for wave in &lens.wavelengths {
            let tracer = Tracer::new(&lens.resolve(zoom, wave.um)?)?.without_rims();
            for (i, field) in lens.fields_at(zoom).values.iter().enumerate() {
                widen(&mut reach, &tracer, &launch, (*field, of_field(factors, zoom, i)));
            }
        }
    }
    Ok(reach)
}

/// Widens the reach to the edge of the beam of a field.
fn widen(
    reach: &mut [Option<f64>],
    tracer: &Tracer<f64>,
    launch: &ProbeLaunch,
    (field, factors): (FieldPoint, PupilFactors),
) {
    let edge = (0..EDGE_RAYS).map(|i| {
        let (sin, cos) = (TAU * i as f64 / EDGE_RAYS as f64).sin_cos();
        factors.point([cos, sin])
    });
    for ray in launch.rays_through(field, edge) {
        let mut met = 0;
        tracer.visit(ray, |surface, point| {
            met = surface + 1;
            let height = point.x.hypot(point.y);
            if let Some(Some(widest)) = reach.get_mut(surface) {
                *widest = widest.max(height);
            }
        });
        reach.iter_mut().skip(met).for_each(|surface| *surface = None);
    }
}

/// Makes every surface as wide as the beams with the factors of the file need it, but no wider than an
/// aperture of the file that clips there too (`clips`, for each surface).
///
/// # Errors
/// A lens that cannot be resolved; it stays as it is.
pub(super) fn apply_factors(
    lens: &mut Lens,
    factors: &ZoomedFactors,
    clips: &[bool],
    report: &mut ConversionReport,
) -> Result<(), LensError> {
    let reach = beam_reach(lens, factors, 0..lens.zoom_positions())?;
    for (i, reach) in reach.into_iter().enumerate() {
        let what = format!("semi-diameter of surface {}", SurfaceNumber::new(i));
        let is_aperture = matches!(lens.aperture, Aperture::StopSemiDiameter(_));
        if is_aperture && lens.surfaces[i].stop || lens.is_zoomed(i, Quantity::SemiDiameter) {
            continue;
        }
        let Some(reach) = reach.filter(|reach| *reach > 0.0) else {
            let note = "a ray at the edge of the factors does not reach it: it is that of the file";
            report.add(ConversionOutcome::Approximated, &what, note);
            continue;
        };
        let given = lens.surfaces[i].semi_diameter;
        let needed = reach * (1.0 + MARGIN);
        let kept = given.filter(|own| *own <= needed && clips.get(i) == Some(&true));
        if let Some(own) = kept {
            let note =
                format!("the aperture of the file, {own} mm: the factors need {reach:.6} mm");
            report.add(ConversionOutcome::Used, &what, note);
            continue;
        }
        let file = given.map_or_else(|| "none".to_owned(), |own| format!("{own} mm"));
        let note = format!("{reach:.6} mm by the vignetting factors, in the file {file}");
        report.add(ConversionOutcome::Approximated, &what, note);
        lens.surfaces[i].semi_diameter = Some(needed);
    }
    amend_lines(report);
    report_differences(lens, factors, report)
}

/// Changes the outcome of the lines with factors.
fn amend_lines(report: &mut ConversionReport) {
    let lines = report
        .rows
        .iter_mut()
        .filter(|row| row.outcome == ConversionOutcome::Dropped && row.note == LEFT_OUT);
    for row in lines {
        row.outcome = ConversionOutcome::Approximated;
        "the rims are as wide as the rays at the edges of the factors".clone_into(&mut row.note);
    }
}

/// Reports, for each field with factors at each zoom position, the part of the paraxial entrance pupil that
/// they fill and the one that gets through the rims.
fn report_differences(
    lens: &Lens,
    factors: &ZoomedFactors,
    report: &mut ConversionReport,
) -> Result<(), LensError> {
    for zoom in 0..lens.zoom_positions() {
        let launch = ProbeLaunch::new(lens, zoom)?;
        let tracer = Tracer::new(&lens.resolve(zoom, lens.wavelengths[lens.primary()].um)?)?;
        for (i, field) in lens.fields_at(zoom).values.iter().enumerate() {
            let own = of_field(factors, zoom, i);
            if own == PupilFactors::default() {
                continue;
            }
            let at = if lens.zoom.len() > 1 {
                format!(" at zoom position {}", zoom + 1)
            } else {
                String::new()
            };
            let what = format!("vignetting of field {}{at}", i + 1);
            let note = difference(&launch, &tracer, *field, own);
            report.add(ConversionOutcome::Approximated, &what, note);
        }
    }
    Ok(())
}

/// The parts of the pupil of a field that its factors fill and that gets through the rims, as a text.
fn difference(
    launch: &ProbeLaunch,
    tracer: &Tracer<f64>,
    field: FieldPoint,
    own: PupilFactors,
) -> String {
    let [mut inside, mut through, mut differ] = [0_u32; 3];
    for (point, ray) in launch.points_and_rays(field, PUPIL_RAYS) {
        let (wanted, passes) = (own.has_point(point), tracer.trace(ray).fate.is_imaged());
        inside += u32::from(wanted);
        through += u32::from(passes);
        differ += u32::from(wanted != passes);
    }
    let [inside, through, differ] =
        [inside, through, differ].map(|rays| 100.0 * f64::from(rays) / PUPIL_RAYS as f64);
    format!(
        "{inside:.1} % of the entrance pupil by the factors, {through:.1} % through the rims; \
         {differ:.1} % of the rays have another fate"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_and_factors_describe_the_same_ellipse() {
        let ([dx, cx], [dy, cy]) =
            (PupilFactors::of_edges(0.1, 0.3), PupilFactors::of_edges(0.4, 0.0));
        let factors =
            PupilFactors { decenter: [dx, dy], compression: [cx, cy], ..PupilFactors::default() };
        // The upper edge at 1 - VU, the lower one at -(1 - VL).
        let ends = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]].map(|end| factors.point(end));
        let expected = [[0.9, dy], [-0.7, dy], [dx, 0.6], [dx, -1.0]];
        for (end, expected) in ends.iter().flatten().zip(expected.iter().flatten()) {
            assert!((end - expected).abs() < 1e-15, "{ends:?}");
        }
    }

    #[test]
    fn a_turned_ellipse_has_the_points_of_its_disc() {
        let factors = PupilFactors { decenter: [0.1, -0.2], compression: [0.5, 0.2], angle: 30.0 };
        for (radius, inside) in [(0.999, true), (1.001, false)] {
            for i in 0..12 {
                let (sin, cos) = f64::from(i).sin_cos();
                let point = factors.point([radius * cos, radius * sin]);
                assert_eq!(factors.has_point(point), inside, "{point:?}");
            }
        }
    }
}
