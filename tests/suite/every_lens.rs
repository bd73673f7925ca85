//! What holds for any lens, checked on every lens of the library: the light that is found is the
//! light that gets through, what a higher order changes is in the stated errors, brightness is
//! conserved, turned fields have turned images, derivatives by all lengths add up.

use aplanat::analysis::{
    AnalysisError, Estimate, Spot, distortion, field_curvature, geometric_mtf, pupil,
    rounding_error, spot, wavefront,
};
use aplanat::files::library_lenses;
use aplanat::lens::{FieldKind, FieldPoint, Lens, Object, Surface, at_zoom};
use aplanat::math::Vec3;
use aplanat::pupil::{
    Accuracy, ConvergedValues, Launch, Nodes, QuadraticIntegrand, RayModel, Region,
    choose_estimator, converge, differentiate,
};
use aplanat::trace::{Ray, SurfaceGradient, SystemGradient, TraceSink};
use rayon::prelude::*;

const ACCURACY: Accuracy = Accuracy { tolerance: 1e-3, max_rays: 200_000 };
/// Enough for what is the same to rounding, or within its stated error, at any accuracy.
const ROUGH: Accuracy = Accuracy { tolerance: 1e-2, max_rays: 20_000 };

/// What a check of a lens found wrong.
type Verdict = Result<(), String>;

/// Checks every lens, as it is at its last zoom position, on all threads; tells everything that is
/// wrong.
fn check_every_lens(check: impl Fn(&Lens, &RayModel) -> Verdict + Sync) {
    let wrong: Vec<String> = library_lenses()
        .par_iter()
        .filter_map(|entry| {
            let lens = entry.open().unwrap();
            let lens = at_zoom(&lens, lens.zoom_positions() - 1);
            let mut model = RayModel::from_lens(&lens, 0).unwrap();
            let lit = |field: &FieldPoint| pupil(&model, *field, model.primary, ACCURACY).extent;
            let fields: Vec<_> =
                model.fields.iter().copied().filter(|f| lit(f).is_some()).collect();
            // The edge of the field of this lens is dark where it focuses on what is near.
            assert!(
                fields.len() == model.fields.len() || entry.name == "macro_micro_nikkor_105_f28"
            );
            model.fields = fields;
            check(&lens, &model).err().map(|why| format!("{}: {why}", entry.name))
        })
        .collect();
    assert_eq!(library_lenses().len(), 188);
    assert!(wrong.is_empty(), "{} lenses:\n{}", wrong.len(), wrong.join("\n"));
}

fn ensure(holds: bool, what: impl FnOnce() -> String) -> Verdict {
    if holds { Ok(()) } else { Err(what()) }
}

/// The edge of the field.
fn edge(model: &RayModel) -> FieldPoint {
    *model.fields.iter().max_by(|a, b| a.y.abs().total_cmp(&b.y.abs())).unwrap()
}

/// Two numbers that are the same within their stated errors.
fn alike(what: &str, a: Estimate, b: Estimate) -> Verdict {
    let error = a.error + b.error;
    let same = (a.value - b.value).abs() <= error;
    ensure(same, || format!("{what}: {} and {} ± {error:e}", a.value, b.value))
}

fn near(what: &str, a: f64, b: f64, error: f64) -> Verdict {
    ensure((a - b).abs() <= error, || format!("{what}: {a} and {b}, {:e}", a - b))
}

fn text(error: AnalysisError) -> String {
    error.to_string()
}

/// The number of cells along a side of the grid of rays that counts light.
const CELLS: usize = 90;

/// The light of a pupil in mm² by counting the rays of a square grid over a box around it.
fn counted_light(model: &RayModel, launch: &Launch<'_>, [low, high]: [[f64; 2]; 2]) -> f64 {
    let size = [high[0] - low[0], high[1] - low[1]];
    let at = |i: usize, k: usize| low[k] + size[k] * (i as f64 + 0.5) / CELLS as f64;
    let inside = |p: &[f64; 2]| !model.ends_at_disc() || p[0].hypot(p[1]) <= 1.0;
    let points = (0..CELLS * CELLS).map(|i| [at(i % CELLS, 0), at(i / CELLS, 1)]);
    let points: Vec<_> = points.filter(inside).collect();
    let (launched, landed) = launch.trace_points(&points);
    let lit = (0..launched.len()).filter(|ray| landed.fate(*ray).is_imaged()).count();
    lit as f64 * size[0] * size[1] / (CELLS * CELLS) as f64 * launch.area()
}

/// A box that contains the pupil.
fn pupil_box(region: &Region<'_>) -> [[f64; 2]; 2] {
    let nodes = region.nodes(region.orders() - 1).points;
    let mut limits = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    for p in nodes {
        // A pupil that is its own mirror image may be known by a half.
        for (k, x) in [(0, p[0]), (0, -p[0]), (1, p[1])] {
            limits[0][k] = limits[0][k].min(x);
            limits[1][k] = limits[1][k].max(x);
        }
    }
    let margin = [0, 1].map(|k| 0.1 * (limits[1][k] - limits[0][k]));
    [0, 1].map(|end| [0, 1].map(|k| limits[end][k] + [-1.0, 1.0][end] * margin[k]))
}

#[test]
fn the_light_is_that_of_the_rays_that_get_through() {
    check_every_lens(|_, model| {
        for field in [model.fields[0], edge(model)] {
            let launch = model.launch(field, model.primary).unwrap();
            let region = Region::new(launch);
            let spot = spot(model, field, ACCURACY).map_err(text)?;
            let light = spot.channels[model.primary].map_err(text)?.light.value;
            let counted = counted_light(model, &region.launch, pupil_box(&region));
            near(&format!("light at {}", field.y), light / counted, 1.0, 0.02)?;
            let extent = pupil(model, field, model.primary, ACCURACY).extent.ok_or("no light")?;
            if !region.launch.is_across_beam() {
                near("area of the pupil", extent.area.value / light, 1.0, 2e-3)?;
            }
        }
        Ok(())
    });
}

/// What a higher order changes is in the stated error of a lower one.
#[test]
fn stated_errors_hold_what_a_higher_order_changes() {
    check_every_lens(|_, model| {
        for field in [model.fields[0], edge(model)] {
            let region = Region::new(model.launch(field, model.primary).unwrap());
            let found = |tolerance| moments_of(&region, Accuracy { tolerance, ..ACCURACY });
            let (rough, exact) = (found(1e-3)?, found(1e-6)?);
            let rounding = rounding_error(model);
            for (k, what) in ["radius", "height", "area"].into_iter().enumerate() {
                let digits = rounding + 1e-12 * exact.values[k];
                let error = rough.errors[k] + exact.errors[k] + digits;
                near(&format!("{what} at {}", field.y), rough.values[k], exact.values[k], error)?;
            }
        }
        Ok(())
    });
}

/// The radius, the height and the area of the light of a pupil.
fn moments_of(region: &Region<'_>, accuracy: Accuracy) -> Result<ConvergedValues<3>, String> {
    let numbers = |nodes: &Nodes| {
        let light = region.moments(nodes);
        (light.area > 0.0).then(|| [light.rms_radius(), light.centroid[1], light.area])
    };
    let scales = |[radius, _, area]: &[f64; 3]| [*radius, *radius, *area];
    converge(region, accuracy, numbers, scales).ok_or_else(|| "no light".to_owned())
}

/// Brightness is conserved: the map of a ray's place and optical direction cosines, from the first
/// vertex plane to the image plane, keeps volumes.
#[test]
fn brightness_is_conserved() {
    check_every_lens(|_, model| {
        let channel = &model.channels[model.primary];
        let tracer = channel.tracer.clone().without_rims();
        let launch = model.launch(edge(model), model.primary).unwrap();
        let chief = launch.ray([0.0, 0.0]).ok_or("no chief ray")?;
        let [before, behind] = [
            channel.system.index_before,
            channel.system.surfaces[channel.system.surfaces.len() - 2].index,
        ];
        // Places across the chief ray, directions by their cosines there: a ray along y has a place
        // in no plane of constant z.
        let (p, d) = (chief.point, chief.direction);
        let across = [Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, d.z, -d.y)];
        let combine = |[a, b]: [f64; 2]| across[0] * a + across[1] * b;
        let end = |state: [f64; 4]| -> Result<[f64; 4], String> {
            let [l, m] = [state[2] / before, state[3] / before];
            let along = d * (1.0 - l * l - m * m).sqrt();
            let point = p + combine([state[0], state[1]]);
            let landing = tracer.trace(Ray { point, direction: along + combine([l, m]) });
            let Ray { point, direction } = landing.ray;
            ensure(landing.fate.is_imaged(), || format!("{:?}", landing.fate))?;
            Ok([point.x, point.y, behind * direction.x, behind * direction.y])
        };
        let state = [0.0; 4];
        let size = 1e-5 * model.first_order.entrance_pupil.diameter.unwrap_or(1.0);
        let mut matrix = [[0.0; 4]; 4];
        for k in 0..4 {
            let step = if k < 2 { size } else { 1e-6 };
            let moved = |sign: f64| {
                let mut state = state;
                state[k] += sign * step;
                end(state)
            };
            let (up, down) = (moved(1.0)?, moved(-1.0)?);
            for i in 0..4 {
                matrix[i][k] = (up[i] - down[i]) / (2.0 * step);
            }
        }
        near("determinant", determinant(matrix), 1.0, 1e-4)
    });
}

/// The determinant by elimination with pivots.
fn determinant(mut m: [[f64; 4]; 4]) -> f64 {
    let mut product = 1.0;
    for k in 0..4 {
        let pivot = (k..4).max_by(|a, b| m[*a][k].abs().total_cmp(&m[*b][k].abs())).unwrap();
        if pivot != k {
            m.swap(k, pivot);
            product = -product;
        }
        product *= m[k][k];
        for i in k + 1..4 {
            let factor = m[i][k] / m[k][k];
            let row = m[k];
            m[i].iter_mut().zip(row).skip(k).for_each(|(entry, above)| *entry -= factor * above);
        }
    }
    product
}

/// What is read off a field, for comparison with a mirrored one.
struct Read {
    spot: Spot,
    distortion: Option<f64>,
    foci: [Option<f64>; 2],
    wavefront: Estimate,
    contrast: [Estimate; 2],
}

impl Read {
    fn new(model: &RayModel, field: FieldPoint) -> Result<Self, String> {
        let spot = spot(model, field, ROUGH).map_err(text)?;
        let foci = field_curvature(model, field, model.primary).map_err(text)?;
        let frequency = 0.1 / spot.rms.value.max(1e-9);
        let contrast =
            geometric_mtf(model, field, model.primary, &[frequency], ACCURACY).map_err(text)?;
        Ok(Self {
            spot,
            distortion: distortion(model, field, model.primary).map_err(text)?.distortion,
            foci: [foci.tangential, foci.sagittal],
            wavefront: wavefront(model, field, model.primary, ROUGH).map_err(text)?.rms,
            contrast: [contrast.points[0].tangential, contrast.points[0].sagittal]
                .map(|v| v.modulus),
        })
    }
}

/// The same field to the other side and along x: a rotationally symmetric lens has the same image
/// there, turned.
#[test]
fn turned_fields_have_turned_images() {
    check_every_lens(|_, model| {
        let field = edge(model);
        let up = Read::new(model, field)?;
        let down = Read::new(model, FieldPoint { y: -field.y, ..field })?;
        let right = Read::new(model, FieldPoint { x: field.y, y: 0.0, ..field })?;
        let [_, y] = up.spot.centroid;
        for (name, read, [across, along], sign) in
            [("down", &down, [0, 1], -1.0), ("right", &right, [1, 0], 1.0)]
        {
            let at = |what: &str| format!("{name}, {what}");
            alike(&at("radius"), up.spot.rms, read.spot.rms)?;
            alike(&at("light"), up.spot.light, read.spot.light)?;
            alike(&at("largest radius"), up.spot.radius, read.spot.radius)?;
            alike(&at("wavefront"), up.wavefront, read.wavefront)?;
            let there = read.spot.centroid[along];
            alike(&at("centroid"), y, Estimate { value: sign * there.value, ..there })?;
            let aside = read.spot.centroid[across];
            near(&at("centroid aside"), aside.value, 0.0, aside.error.max(1e-12))?;
            for (a, b) in up.foci.iter().zip(read.foci) {
                let [a, b] = [a.unwrap_or(0.0), b.unwrap_or(0.0)];
                near(&at("focus"), a, b, 1e-7 * (1.0 + a.abs()))?;
            }
            let [a, b] = [up.distortion, read.distortion].map(Option::unwrap_or_default);
            near(&at("distortion"), a, b, 1e-9)?;
            let [tangential, sagittal] = read.contrast;
            let contrast = if along == 1 { [tangential, sagittal] } else { [sagittal, tangential] };
            for (a, b) in up.contrast.into_iter().zip(contrast) {
                alike(&at("contrast"), a, b)?;
            }
        }
        Ok(())
    });
}

/// The derivative of an integral by the logarithm of a factor of all lengths: that by each number,
/// times the number and the power of mm in its unit.
fn by_scale(model: &RayModel, by: &SystemGradient<f64>) -> f64 {
    let surfaces = &model.channels[model.primary].system.surfaces;
    let one = |(surface, by): (&Surface<f64>, &SurfaceGradient<f64>)| {
        let (curvature, _, terms) = surface.shape.numbers();
        let terms = terms.iter().zip(by.terms).enumerate();
        let asphere: f64 = terms.map(|(k, (a, by))| (2 * k + 3) as f64 * a * by).sum();
        // A surface without a rim has an infinite one, and no derivative by it.
        let rim = by.semi_diameter * surface.semi_diameter.min(f64::MAX);
        by.thickness * surface.thickness + rim - by.curvature * curvature - asphere
    };
    surfaces.iter().zip(&by.surfaces).map(one).sum()
}

/// Euler's theorem on homogeneous functions: the squared distances over the pupil grow with the
/// fourth power of all lengths, the light with the second.
#[test]
fn derivatives_by_all_lengths_add_up() {
    check_every_lens(|lens, model| {
        let depends_on_lengths_alone = lens.object == Object::Infinity
            && model.beam.field == FieldKind::Angle
            && !model.has_grin()
            && lens.surfaces.iter().all(|row| row.obstruction.is_none());
        if !depends_on_lengths_alone {
            return Ok(());
        }
        for field in [model.fields[0], edge(model)] {
            let region = Region::new(model.launch(field, model.primary).unwrap());
            let light = region.trace_pupil(9).moments;
            let accuracy = Accuracy { tolerance: 1e-4, ..ACCURACY };
            let spread = QuadraticIntegrand::spread(light.centroid);
            for (cost, power) in [(spread, 4.0), (QuadraticIntegrand::throughput(), 2.0)] {
                let (estimator, _) =
                    choose_estimator(&region, accuracy).map_err(|error| error.to_string())?;
                let found = differentiate(&region, &cost, estimator, accuracy);
                let found = found.map_err(|error| error.to_string())?;
                let sum = by_scale(model, &found.gradient);
                let exact = power * cost.integrate(&light);
                let what = format!("power {power} at {} by {estimator:?}", field.y);
                near(&what, sum, exact, 5e-3 * exact.abs())?;
            }
        }
        Ok(())
    });
}
