//! The diffraction image of a point: intensities, Strehl ratios and encircled energy.

use super::{AnalysisRun, AtField, SelectedField, TextLines, estimate_text, not_reached_text};
use crate::analysis::{
    ContrastLimit, Estimate, PointSpread, ReferenceForm, Strehl, encircled_energy, point_spread,
    strehl,
};
use crate::cli::error::CliError;
use crate::cli::output::{ShortNumber, counted, without_rounding};
use crate::measure::time_ms;
use crate::plot::{ChartCurve, CurveChart};
use crate::pupil::{Accuracy, PupilPattern, pattern_points};
use serde::Serialize;

/// The diffraction image of a field.
#[derive(Serialize)]
pub(super) struct PointSpreadJson {
    strehl: Estimate,
    best_strehl: Estimate,
    best_at: [f64; 3],
    best_is_global: bool,
    center: [f64; 2],
    reference: ReferenceForm,
    reached: bool,
    /// The cause of errors above the tolerance; `None` if it was reached.
    limit: Option<ContrastLimit>,
    points: Vec<IntensityJson>,
    /// The rounding error of a length, in mm.
    #[serde(skip)]
    rounding: f64,
    /// The intensities along x and along y, if they are drawn.
    #[serde(skip)]
    profiles: Profiles,
}

/// The intensity at a point, in mm from the image point of the chief ray.
#[derive(Serialize)]
struct IntensityJson {
    x: f64,
    y: f64,
    intensity: Estimate,
}

/// The largest number of rays of an image: a phase that turns a hundred times over the pupil takes many.
const MOST_RAYS: usize = 1_000_000;
/// The points of a profile on each side of its centre.
const PROFILE: i32 = 10;

/// The size of the diffraction image, λF in mm.
fn unit(run: &AnalysisRun) -> f64 {
    run.primary_um() * 1e-3 * run.model.first_order.working_f_number.unwrap_or(1.0).abs()
}

pub(super) fn point_spreads(run: &AnalysisRun) -> Vec<AtField<PointSpreadJson>> {
    let step = 0.5 * unit(run);
    let along = |axis: usize| {
        let point = move |i: i32| {
            let v = f64::from(i) * step;
            if axis == 0 { [v, 0.0] } else { [0.0, v] }
        };
        (-PROFILE..=PROFILE).map(point)
    };
    let points: Vec<[f64; 2]> =
        if run.points.is_empty() { along(0).chain(along(1)).collect() } else { run.points.clone() };
    let at = |field: &SelectedField| {
        let (model, w) = (&run.model, run.model.primary);
        let (found, ms) = time_ms(|| {
            let accuracy = Accuracy { max_rays: MOST_RAYS, ..run.accuracy };
            let spread = point_spread(model, field.traced, w, &points, accuracy)?;
            Ok((spread, strehl(model, field.traced, w, run.accuracy)?))
        });
        let keys = found.map(|(spread, strehl)| PointSpreadJson {
            rounding: run.rounding(),
            profiles: if run.is_drawn { profiles(run, field) } else { Profiles::default() },
            ..keys(&spread, strehl, &points, ms)
        });
        AtField::new(field, keys)
    };
    run.fields.iter().map(at).collect()
}

/// Intensities that are drawn.
#[derive(Debug, Default)]
struct Profiles {
    /// Along x and along y through the image point of the chief ray, over the distance in micrometres.
    curves: [Vec<[f64; 2]>; 2],
    /// The largest error, and the rays.
    error: f64,
    rays: usize,
}

/// The points of a drawn profile for each λF, and their least and largest number on each side of its centre.
const DRAWN: f64 = 8.0;
const DRAWN_POINTS: [f64; 2] = [40.0, 200.0];
/// The least distance that a drawn profile reaches, in λF: the circle holds 96 % of a perfect image.
const LEAST_REACH: f64 = 5.0;
/// The share of the rays within the distance that a drawn profile reaches, and the rays over the pupil.
const DRAWN_SHARE: f64 = 0.99;
const SPREAD_SIDE: usize = 32;
/// The rays of the drawn profiles.
const DRAWN_RAYS: usize = 100_000;

/// The radius in mm of the circle about the image point of the chief ray that holds 99 % of the rays; `None`
/// without light.
fn circle_of_rays(run: &AnalysisRun, field: &SelectedField) -> Option<f64> {
    let (model, primary) = (&run.model, run.model.primary);
    let launch = model.launch(field.traced, primary).ok()?;
    let landing = |point: [f64; 2]| {
        let traced = model.channels[primary].tracer.trace(launch.ray(point)?);
        traced.fate.is_imaged().then_some(traced.ray.point)
    };
    let chief = landing([0.0; 2])?;
    let grid = pattern_points(PupilPattern::Square(SPREAD_SIDE));
    let landed = grid.into_iter().filter_map(landing);
    let mut distances: Vec<f64> =
        landed.map(|point| (point.x - chief.x).hypot(point.y - chief.y)).collect();
    distances.sort_by(f64::total_cmp);
    let inside = (DRAWN_SHARE * distances.len() as f64).ceil() as usize;
    distances.get(inside.saturating_sub(1)).copied().filter(|radius| radius.is_finite())
}

/// The profiles of a field; none where its image is not known.
fn profiles(run: &AnalysisRun, field: &SelectedField) -> Profiles {
    let reach = run
        .reach
        .unwrap_or_else(|| circle_of_rays(run, field).unwrap_or(0.0).max(LEAST_REACH * unit(run)));
    let [least, most] = DRAWN_POINTS;
    let count = (DRAWN * reach / unit(run)).ceil().clamp(least, most) as i32;
    let place = |i: i32| f64::from(i) / f64::from(count) * reach;
    let along_x = (-count..=count).map(|i| [place(i), 0.0]);
    let along_y = (-count..=count).map(|i| [0.0, place(i)]);
    let points: Vec<[f64; 2]> = along_x.chain(along_y).collect();
    let accuracy = Accuracy { max_rays: DRAWN_RAYS, ..run.accuracy };
    let found = point_spread(&run.model, field.traced, run.model.primary, &points, accuracy);
    let Ok(found) = found else { return Profiles::default() };
    let drawn = points.iter().zip(&found.intensities);
    let drawn: Vec<_> = drawn.map(|(at, e)| [1e3 * (at[0] + at[1]), e.value]).collect();
    let (x, y) = drawn.split_at(drawn.len() / 2);
    let error = found.intensities.iter().map(|intensity| intensity.error).fold(0.0, f64::max);
    Profiles { curves: [x.to_vec(), y.to_vec()], error, rays: found.strehl.rays }
}

fn keys(spread: &PointSpread, strehl: Strehl, points: &[[f64; 2]], ms: f64) -> PointSpreadJson {
    let timed = |e| Estimate { milliseconds: Some(ms), ..e };
    let point =
        |([x, y], e): (&[f64; 2], &Estimate)| IntensityJson { x: *x, y: *y, intensity: timed(*e) };
    PointSpreadJson {
        // That of the image holds for its points too, however far away they are.
        strehl: timed(strehl.at_chief),
        best_strehl: timed(strehl.best),
        best_at: strehl.best_at,
        best_is_global: strehl.is_brightest,
        center: spread.center,
        reference: spread.reference,
        reached: spread.reached && strehl.reached,
        limit: limit_of(spread, strehl),
        points: points.iter().zip(&spread.intensities).map(point).collect(),
        rounding: 0.0,
        profiles: Profiles::default(),
    }
}

/// The largest error of the parts that did not reach the tolerance, which more rays would make smaller.
fn limit_of(spread: &PointSpread, strehl: Strehl) -> Option<ContrastLimit> {
    let image = spread.intensities.iter().map(|e| e.error);
    let of_image = (!spread.reached).then(|| image.fold(0.0, f64::max));
    let of_strehl = (!strehl.reached).then(|| strehl.at_chief.error.max(strehl.best.error));
    of_image.into_iter().chain(of_strehl).reduce(f64::max).map(ContrastLimit::Nodes)
}

impl PointSpreadJson {
    /// The head of the points: their number, what they cost, and whether they keep the tolerance.
    fn points_head(&self) -> String {
        let cost = self.points.first().map_or_else(String::new, |point| {
            let Estimate { rays, milliseconds, .. } = point.intensity;
            let ms = milliseconds.map(|ms| format!(", {ms:.3} ms")).unwrap_or_default();
            format!(": {}{ms}", counted(rays, "ray"))
        });
        let points = counted(self.points.len(), "point");
        format!("{points}{cost}{}", not_reached_text(self.limit))
    }
}

impl TextLines for PointSpreadJson {
    const TITLE: &'static str = "diffraction image of a point at the primary wavelength, relative to \
         the peak without aberrations; x and y in mm from the image point of the chief ray";

    fn error_unit(_key: &str) -> &'static str {
        ""
    }

    fn lines(&self) -> Vec<String> {
        let [x, y, z] = self.best_at.map(|v| ShortNumber(without_rounding(v, self.rounding)));
        let mut lines = vec![
            estimate_text("Strehl at the chief ray", &self.strehl),
            estimate_text("best Strehl", &self.best_strehl),
            format!("found at x {x}, y {y}, along the axis {z} mm"),
        ];
        if !self.best_is_global {
            lines.push("a local maximum: the blur is too large to be searched".to_owned());
        }
        lines.push(self.points_head());
        lines.push(format!("{:>12}  {:>12}  intensity", "x, mm", "y, mm"));
        lines.extend(self.points.iter().map(|point| {
            let IntensityJson { x, y, intensity } = point;
            let [x, y] = [x, y].map(|v| ShortNumber(*v));
            format!("{x:>12}  {y:>12}  {:.6} ± {:.0e}", intensity.value, intensity.error)
        }));
        lines
    }

    /// The profiles, linear and logarithmic.
    fn charts(&self) -> Vec<CurveChart> {
        let chart = |title: &str, axis: &'static str, number: fn(f64) -> Option<f64>| {
            let curve = |(i, name): (usize, &str)| {
                let points =
                    self.profiles.curves[i].iter().map(|[at, value]| (*at, number(*value)));
                ChartCurve::new(name, i, points)
            };
            let curves = ["along x", "along y"].into_iter().enumerate().map(curve).collect();
            let Profiles { error, rays, .. } = &self.profiles;
            let title = format!("{title}, curves ± {error:.0e} by {}", counted(*rays, "ray"));
            CurveChart::new(title, ["distance, um", axis], curves)
        };
        let logarithm = |value: f64| (value > DARK).then(|| value.log10());
        vec![
            chart("diffraction image", "intensity", Some),
            chart("its logarithm", "lg intensity", logarithm),
        ]
    }
}

/// Intensities below this are not drawn on a logarithmic scale.
const DARK: f64 = 1e-6;

/// The encircled energy of a field.
#[derive(Serialize)]
pub(super) struct EncircledJson {
    reached: bool,
    /// The cause of errors above the tolerance; `None` if it was reached.
    limit: Option<ContrastLimit>,
    circles: Vec<CircleJson>,
}

#[derive(Serialize)]
struct CircleJson {
    radius: f64,
    energy: Estimate,
}

/// The radii of the circles, in λF.
const RADII: [f64; 10] = [0.25, 0.5, 0.75, 1.0, 1.22, 1.5, 2.0, 3.0, 4.0, 6.0];

/// The largest radius of a circle in λF: beyond, no affordable nodes resolve the fringes.
const LARGEST_RADIUS: f64 = 200.0;

/// Refuses circles that are too large.
pub(super) fn check_radii(run: &AnalysisRun, asked: &[f64]) -> Result<(), CliError> {
    let most = LARGEST_RADIUS * unit(run);
    match asked.iter().find(|radius| **radius > most) {
        Some(found) => {
            let most = ShortNumber(most);
            let text = format!(
                "--radii: found {found}; expected mm, at most {most}, {LARGEST_RADIUS} lambda F"
            );
            Err(CliError::Input(text))
        }
        None => Ok(()),
    }
}

pub(super) fn encircled(run: &AnalysisRun, asked: &[f64]) -> Vec<AtField<EncircledJson>> {
    let usual = || RADII.iter().map(|r| r * unit(run)).collect();
    let radii: Vec<f64> = if asked.is_empty() { usual() } else { asked.to_vec() };
    let at = |field: &SelectedField| {
        let (found, ms) = time_ms(|| {
            let (model, w) = (&run.model, run.model.primary);
            encircled_energy(model, field.traced, w, [0.0; 2], &radii, run.accuracy)
        });
        let circle = |(radius, energy): (&f64, Estimate)| CircleJson {
            radius: *radius,
            energy: Estimate { milliseconds: Some(ms), ..energy },
        };
        let keys = found.map(|list| {
            let largest = list.iter().map(|energy| energy.error).fold(0.0, f64::max);
            let reached = largest <= run.accuracy.tolerance;
            EncircledJson {
                reached,
                limit: (!reached).then_some(ContrastLimit::Nodes(largest)),
                circles: radii.iter().zip(list).map(circle).collect(),
            }
        });
        AtField::new(field, keys)
    };
    run.fields.iter().map(at).collect()
}

impl TextLines for EncircledJson {
    const TITLE: &'static str = "encircled energy by diffraction at the primary wavelength: share of \
         the light within circles about the image point of the chief ray, radii in mm";

    fn error_unit(_key: &str) -> &'static str {
        ""
    }

    fn lines(&self) -> Vec<String> {
        let line = |circle: &CircleJson| {
            estimate_text(&ShortNumber(circle.radius).to_string(), &circle.energy)
        };
        let head = format!("{:<22} {:>13}{}", "radius, mm", "share", not_reached_text(self.limit));
        std::iter::once(head).chain(self.circles.iter().map(line)).collect()
    }

    fn charts(&self) -> Vec<CurveChart> {
        let circles = self.circles.iter().map(|circle| (circle.radius, Some(circle.energy.value)));
        let points = std::iter::once((0.0, Some(0.0))).chain(circles);
        let curve = ChartCurve::new("diffraction", 0, points);
        let axes = ["radius, mm", "share of the light"];
        vec![CurveChart::new("encircled energy", axes, vec![curve])]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image of two points whose largest error is 0.02.
    fn image(reached: bool) -> PointSpreadJson {
        let spread = PointSpread {
            intensities: vec![Estimate::new(0.5, 0.001, 900), Estimate::new(0.25, 0.02, 900)],
            strehl: Estimate::new(0.5, 0.001, 900),
            center: [0.0; 2],
            reached,
            reference: ReferenceForm::Plane,
        };
        let strehl = Strehl {
            at_chief: spread.strehl,
            best: Estimate::new(0.6, 0.5, 400),
            is_brightest: true,
            best_at: [0.0; 3],
            reached: true,
        };
        keys(&spread, strehl, &[[0.0; 2], [0.01, 0.0]], 2.0)
    }

    #[test]
    fn an_image_says_where_its_tolerance_was_not_reached() {
        let head = |image: &PointSpreadJson| {
            image.lines().into_iter().find(|line| line.starts_with("2 points")).unwrap()
        };
        let (kept, missed) = (image(true), image(false));
        assert_eq!(head(&kept), "2 points: 900 rays, 2.000 ms");
        assert_eq!(
            head(&missed),
            "2 points: 900 rays, 2.000 ms, tolerance not reached: limited by the number of rays: 2.0e-2"
        );
        assert!(kept.limit.is_none() && kept.reached);
        assert_eq!(missed.limit, Some(ContrastLimit::Nodes(0.02)));
    }
}
