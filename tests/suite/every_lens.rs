//! What holds for any lens, checked on every lens of the library: brightness is conserved, and
//! derivatives by all lengths add up to the degree of the integral.

use aplanat::analysis::pupil;
use aplanat::files::library_lenses;
use aplanat::lens::{FieldKind, FieldPoint, Lens, Object, Surface, at_zoom};
use aplanat::math::Vec3;
use aplanat::pupil::{
    Accuracy, QuadraticIntegrand, RayModel, Region, choose_estimator, differentiate,
};
use aplanat::trace::{Ray, SurfaceGradient, SystemGradient};
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

fn near(what: &str, a: f64, b: f64, error: f64) -> Verdict {
    ensure((a - b).abs() <= error, || format!("{what}: {a} and {b}, {:e}", a - b))
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
