//! The light that is found is the light that gets through, and brightness is conserved.

use super::{ACCURACY, check_every_lens, edge, ensure, near, text};
use aplanat::analysis::{pupil, spot};
use aplanat::math::Vec3;
use aplanat::pupil::{Launch, RayModel, Region};
use aplanat::trace::{Ray, TraceSink};

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
