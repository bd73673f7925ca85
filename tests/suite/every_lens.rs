//! What holds for any lens, checked on every lens of the library: the light that is found is the
//! light that gets through, mirrored fields have mirrored images, lengths that double double the
//! spots, derivatives are those of the numbers, what a plan leaves out is within the stated errors.

use aplanat::analysis::{
    AnalysisError, Estimate, Spot, distortion, field_curvature, geometric_mtf, illumination, pupil,
    spot, wavefront,
};
use aplanat::effects::{self, EffectOverrides, TracePurpose};
use aplanat::files::library_lenses;
use aplanat::lens::{
    Aperture, Edit, FieldKind, FieldPoint, Lens, Object, Parameter, Quantity, Surface, apply_edit,
    at_zoom,
};
use aplanat::math::Vec3;
use aplanat::pupil::{
    Accuracy, Launch, QuadraticIntegrand, RayModel, Region, choose_estimator, differentiate,
};
use aplanat::trace::{Ray, SurfaceGradient, SystemGradient, TraceSink};
use rayon::prelude::*;

const ACCURACY: Accuracy = Accuracy { tolerance: 1e-3, max_rays: 200_000 };

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
        let spot = spot(model, field, ACCURACY).map_err(text)?;
        let foci = field_curvature(model, field, model.primary).map_err(text)?;
        let frequency = 0.1 / spot.rms.value.max(1e-9);
        let contrast =
            geometric_mtf(model, field, model.primary, &[frequency], ACCURACY).map_err(text)?;
        Ok(Self {
            spot,
            distortion: distortion(model, field, model.primary).map_err(text)?.distortion,
            foci: [foci.tangential, foci.sagittal],
            wavefront: wavefront(model, field, model.primary, ACCURACY).map_err(text)?.rms,
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
        let left = Read::new(model, FieldPoint { x: -field.y, y: 0.0, ..field })?;
        let [_, y] = up.spot.centroid;
        for (name, read, [across, along], sign) in [
            ("down", &down, [0, 1], -1.0),
            ("right", &right, [1, 0], 1.0),
            ("left", &left, [1, 0], -1.0),
        ] {
            let at = |what: &str| format!("{name}, {what}");
            alike(&at("radius"), up.spot.rms, read.spot.rms)?;
            alike(&at("light"), up.spot.light, read.spot.light)?;
            // The largest radius is that of a sample of rays.
            let [a, b] = [&up, read].map(|read| read.spot.radius.value);
            near(&at("largest radius"), b / a, 1.0, 0.02)?;
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

/// Lengths that double are the same design: spots double, angles and ratios stay. Doubling is exact
/// in binary, so that every number agrees to rounding.
#[test]
fn doubled_lengths_double_the_spots() {
    check_every_lens(|lens, model| {
        let large = apply_edit(lens, &Edit::Scale(2.0)).map_err(|error| error.to_string())?;
        let large = RayModel::from_lens(&large, 0).unwrap();
        let [a, b] = [model, &large].map(|model| model.first_order.working_f_number.unwrap());
        near("f-number", b / a, 1.0, 1e-12)?;
        for (field, twice) in model.fields.iter().zip(&large.fields) {
            let at = |what: &str| format!("{what} at {}", field.y);
            let [a, b] = [spot(model, *field, ACCURACY), spot(&large, *twice, ACCURACY)];
            let (a, b) = (a.map_err(text)?, b.map_err(text)?);
            near(&at("radius"), b.rms.value / a.rms.value, 2.0, 2e-6)?;
            near(&at("largest radius"), b.radius.value / a.radius.value, 2.0, 2e-6)?;
            near(&at("light"), b.light.value / a.light.value, 4.0, 1e-9)?;
            let [a, b] = [(model, field), (&large, twice)]
                .map(|(model, field)| distortion(model, *field, model.primary));
            let (a, b) = (a.map_err(text)?, b.map_err(text)?);
            near(&at("height"), b.height, 2.0 * a.height, 1e-9 * (1.0 + a.height.abs()))?;
            let [a, b] = [(model, field), (&large, twice)].map(|(model, field)| {
                wavefront(model, *field, model.primary, ACCURACY).map(|wave| wave.rms)
            });
            let (a, b) = (a.map_err(text)?, b.map_err(text)?);
            let error = a.error + b.error;
            near(&at("wavefront"), b.value, 2.0 * a.value, 1e-6 * a.value + 2.0 * error)?;
        }
        let [a, b] = [model, &large].map(|model| illumination(model, model.primary, ACCURACY));
        for (a, b) in a.iter().zip(&b) {
            near("illumination", b.cone.value, a.cone.value, 1e-9 * a.cone.value)?;
        }
        Ok(())
    });
}

/// What a plan leaves out, the search of the chief ray among it, is in the stated errors.
#[test]
fn stated_errors_hold_what_a_plan_leaves_out() {
    check_every_lens(|lens, model| {
        let measured = effects::measure_effects(lens, 0).map_err(|error| error.to_string())?;
        for tolerance in [1e-2] {
            let purpose = TracePurpose::Spot(tolerance);
            let plan = effects::plan(&measured, purpose, &EffectOverrides::default());
            let planned = effects::build_ray_model(lens, 0, &plan).unwrap();
            for field in [model.fields[0], edge(model)] {
                let accuracy = ACCURACY;
                let both = [model, &planned].map(|model| spot(model, field, accuracy));
                let [exact, found] = both;
                let (exact, found) = (exact.map_err(text)?, found.map_err(text)?);
                let at = |what: &str| format!("{what} at {} for {tolerance}", field.y);
                alike(&at("radius"), exact.rms, found.rms)?;
                alike(&at("light"), exact.light, found.light)?;
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

/// The derivative by the curvature of one surface, and the thickness behind it, against the
/// difference of two lenses.
#[test]
fn derivatives_are_differences() {
    check_every_lens(|lens, model| {
        let field = edge(model);
        let surface = lens.surfaces.len() / 2;
        let region = Region::new(model.launch(field, model.primary).unwrap());
        let light = region.trace_pupil(9).moments;
        let accuracy = Accuracy { tolerance: 1e-4, ..ACCURACY };
        let cost = QuadraticIntegrand::spread(light.centroid);
        let (estimator, _) = choose_estimator(&region, accuracy).map_err(|e| e.to_string())?;
        let found = differentiate(&region, &cost, estimator, accuracy);
        let by = found.map_err(|error| error.to_string())?.gradient.surfaces[surface];
        let length = model.first_order.efl.unwrap().abs();
        for (quantity, by, step) in [
            (Quantity::Curvature, by.curvature, 1e-4 / length),
            (Quantity::Thickness, by.thickness, 1e-4 * length),
        ] {
            let at = |sign: f64| {
                let parameter = Parameter::new(surface, quantity);
                let mut moved = fixed_stop(lens, model);
                moved.set(parameter, moved.get(parameter).unwrap() + sign * step);
                let model = RayModel::from_lens(&moved, 0).unwrap();
                let region = Region::new(model.launch(field, model.primary).unwrap());
                cost.integrate(&region.trace_pupil(9).moments)
            };
            // Where two rims begin to share an edge, the differences to both sides differ, and a
            // derivative is one of them or between them.
            let (up, middle, down) = (at(1.0), at(0.0), at(-1.0));
            let sides = [(up - middle) / step, (middle - down) / step];
            let [low, high] = [sides[0].min(sides[1]), sides[0].max(sides[1])];
            let scale = cost.integrate(&light) / length;
            let what = format!("{quantity:?} of surface {}, {sides:?}", surface + 1);
            near(&what, by, by.clamp(low, high), 2e-2 * by.abs() + 1e-3 * scale)?;
        }
        Ok(())
    });
}

/// The lens whose stop is as large as its aperture makes it, and stays so when the lens changes.
fn fixed_stop(lens: &Lens, model: &RayModel) -> Lens {
    let aperture = Aperture::StopSemiDiameter(model.stop_radius());
    Lens { aperture, ..lens.clone() }
}
