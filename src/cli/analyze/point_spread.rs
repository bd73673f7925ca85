//! The diffraction image of a point: intensities and Strehl ratios.

use super::{
    AnalysisRun, AtField, SelectedField, TextLines, dark_text, estimate_text, not_reached_text,
};
use crate::analysis::{
    ContrastLimit, Estimate, ImageLight, PointSpread, ReferenceForm, Strehl, point_spread_unless,
    strehl_unless,
};
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
    /// The share of the weight of wavelengths without light.
    dark_share: f64,
    points: Vec<IntensityJson>,
    /// True if the light is that of all wavelengths.
    #[serde(skip)]
    in_all_light: bool,
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
pub(super) fn unit(run: &AnalysisRun) -> f64 {
    run.light_um() * 1e-3 * run.model.first_order.working_f_number.unwrap_or(1.0).abs()
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
        let (model, light) = (&run.model, run.image_light);
        let (found, ms) = time_ms(|| {
            let accuracy = Accuracy { max_rays: MOST_RAYS, ..run.accuracy };
            let image = (light, points.as_slice());
            let spread = point_spread_unless(model, field.traced, image, accuracy, &|| false)?;
            let strehl = strehl_unless(model, field.traced, light, run.accuracy, &|| false)?;
            Ok((spread, strehl))
        });
        let keys = found.map(|(spread, strehl)| PointSpreadJson {
            in_all_light: light == ImageLight::All,
            rounding: run.rounding(),
            profiles: if run.is_drawn { profiles(run, field) } else { Profiles::default() },
            ..keys(&spread, strehl, &points, ms)
        });
        AtField::new(field, keys)
    };
    run.at_each_field(at)
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

/// The radius in mm of the circle about the image point of the chief ray that holds a share of the rays of all
/// wavelengths of the image; `None` without light.
pub(super) fn circle_of_rays(run: &AnalysisRun, field: &SelectedField, share: f64) -> Option<f64> {
    let (model, colors) = (&run.model, run.colors());
    let landings = |wavelength: usize, points: &[[f64; 2]]| -> Vec<[f64; 2]> {
        let Ok(launch) = model.launch(field.traced, wavelength) else { return Vec::new() };
        let landing = |point: &[f64; 2]| {
            let traced = model.channels[wavelength].tracer.trace(launch.ray(*point)?);
            traced.fate.is_imaged().then_some([traced.ray.point.x, traced.ray.point.y])
        };
        points.iter().filter_map(landing).collect()
    };
    let first = if colors.contains(&model.primary) { model.primary } else { *colors.first()? };
    let chief = *landings(first, &[[0.0; 2]]).first()?;
    let grid = pattern_points(PupilPattern::Square(SPREAD_SIDE));
    let landed = colors.iter().flat_map(|wavelength| landings(*wavelength, &grid));
    let mut distances: Vec<f64> = landed.map(|[x, y]| (x - chief[0]).hypot(y - chief[1])).collect();
    distances.sort_by(f64::total_cmp);
    let inside = (share * distances.len() as f64).ceil() as usize;
    distances.get(inside.saturating_sub(1)).copied().filter(|radius| radius.is_finite())
}

/// The profiles of a field; none where its image is not known.
fn profiles(run: &AnalysisRun, field: &SelectedField) -> Profiles {
    let reach = run.reach.unwrap_or_else(|| {
        circle_of_rays(run, field, DRAWN_SHARE).unwrap_or(0.0).max(LEAST_REACH * unit(run))
    });
    let [least, most] = DRAWN_POINTS;
    let count = (DRAWN * reach / unit(run)).ceil().clamp(least, most) as i32;
    let place = |i: i32| f64::from(i) / f64::from(count) * reach;
    let along_x = (-count..=count).map(|i| [place(i), 0.0]);
    let along_y = (-count..=count).map(|i| [0.0, place(i)]);
    let points: Vec<[f64; 2]> = along_x.chain(along_y).collect();
    let accuracy = Accuracy { max_rays: DRAWN_RAYS, ..run.accuracy };
    let image = (run.image_light, points.as_slice());
    let found = point_spread_unless(&run.model, field.traced, image, accuracy, &|| false);
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
        dark_share: spread.dark_share,
        in_all_light: false,
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
    const TITLE: &'static str = "diffraction image of a point, relative to the peak without aberrations; x and y \
         in mm from the image point of the chief ray";

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
        if self.in_all_light {
            lines.push("the brightest point near those of the single wavelengths".to_owned());
        } else if !self.best_is_global {
            lines.push("a local maximum: the blur is too large to be searched".to_owned());
        }
        lines.extend(dark_text(self.dark_share));
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
            dark_share: 0.0,
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
