//! Images of beams by light that is followed forwards: against exact ones, with errors that cover what is missing,
//! and in cases where there is little or nothing to see.

use aplanat::grin::field::{Luneburg, Parabolic, ProfileField};
use aplanat::grin::{
    EndCondition, Face, GrinFate, GrinRegion, GrinSetup, IndexField, Integrator, LastStep,
    LaunchMode,
};
use aplanat::grin_design::{
    self, GrinField, GrinOptimizer, GrinTask, InitialField, LightGoal, LightSource,
    RefinementLevel, SquareBeam,
};
use aplanat::math::Vec3;
use aplanat::picture::{
    ImageFrame, LightProjection, LightScreen, ProjectedImage, ProjectionError, ProjectionSettings,
    project_views, screen_frame,
};
use rayon::ThreadPoolBuilder;
use std::ops::ControlFlow;

const Z: Vec3<f64> = Vec3 { x: 0.0, y: 0.0, z: 1.0 };

/// Light that ends on the boundary of a region, or on a plane behind it.
fn setup(region: GrinRegion<f64>, screen: Option<f64>) -> GrinSetup<f64> {
    GrinSetup {
        integrator: Integrator::BlanesMoan,
        step: 0.1,
        launch: LaunchMode::AsGiven,
        end: EndCondition::Boundary { region, last: LastStep::Fractional, limit: 1000 },
        screen: screen.map(|z| Face::plane(Z, z)),
    }
}

/// A built-in task with few rays and pixels, of a few steps with a coarse field.
fn quick(name: &str, steps: usize) -> GrinTask {
    let mut task = grin_design::find_builtin(name).unwrap().task().unwrap();
    task.levels = vec![RefinementLevel { nodes: 5, steps }];
    for view in &mut task.views {
        if let LightSource::Beam { rays, .. } = &mut view.source {
            *rays = 32;
        }
        if let LightGoal::Image { pixels, .. } = &mut view.goal {
            *pixels = 16;
        }
    }
    task
}

fn solved(task: &GrinTask) -> GrinField {
    let mut runner = GrinOptimizer::new(task).unwrap();
    while !runner.step().unwrap().finished {}
    runner.current().clone()
}

fn air() -> GrinField {
    let task = GrinTask { start: InitialField::Uniform(1.0), ..quick("display", 1) };
    GrinOptimizer::new(&task).unwrap().best().clone()
}

fn luneburg() -> ProfileField<Luneburg<f64>> {
    ProfileField::sphere(Luneburg::new(1.0))
}

/// As many rays as there may be.
fn all(max_rays: usize, seed: u32) -> ProjectionSettings {
    ProjectionSettings { tolerance: -1.0, max_rays, seed }
}

fn render(projection: &LightProjection<'_>, settings: &ProjectionSettings) -> ProjectedImage {
    projection.render(settings, &mut |_| ControlFlow::Continue(())).unwrap().remove(0)
}

/// One screen at the end of a setup.
fn on(setup: &GrinSetup<f64>, frame: ImageFrame) -> Vec<LightScreen> {
    vec![LightScreen { face: setup.screen, frame }]
}

/// A beam of half a side along z through a field, on a frame of half a side.
fn along_z(
    field: &dyn IndexField<f64>,
    setup: GrinSetup<f64>,
    half: f64,
    (frame, pixels): (f64, usize),
) -> LightProjection<'_> {
    let frame = screen_frame(frame, pixels).unwrap();
    let screens = on(&setup, frame);
    LightProjection::new(field, setup, SquareBeam::new(Z, half, 2.0), screens).unwrap()
}

/// The root mean square difference from an exact image over what the errors of an image allow.
fn off(image: &ProjectedImage, exact: &[f64]) -> f64 {
    let found: f64 = image.values.iter().zip(exact).map(|(a, b)| (a - b).powi(2)).sum();
    let allowed: f64 = image.errors.iter().map(|error| error * error).sum();
    if found > 1e-20 { (found / allowed).sqrt() } else { 0.0 }
}

/// The share of a pixel that a beam covers along one axis, each from minus to plus half a side.
fn covered(pixel: usize, (frame, pixels): (f64, usize), beam: f64) -> f64 {
    let pitch = 2.0 * frame / pixels as f64;
    let from = pixel as f64 * pitch - frame;
    ((from + pitch).min(beam) - from.max(-beam)).max(0.0) / pitch
}

#[test]
fn air_leaves_the_beam_as_it_is() {
    let field = air();
    for (half, pixels) in [(0.9, 7), (0.9, 9), (1.3, 13), (1.0, 1), (0.5, 5)] {
        let setup = setup(GrinRegion::cube(1.0), Some(1.5));
        let projection = along_z(field.index_field(), setup, 0.9, (half, pixels));
        let image = render(&projection, &all(1 << 14, 0));
        let density = (half / 0.9).powi(2);
        let at = |i: usize| {
            let along = |k: usize| covered(k, (half, pixels), 0.9);
            density * along(i % pixels) * along(i / pixels)
        };
        let exact: Vec<f64> = (0..pixels * pixels).map(at).collect();
        let error = image.rms_error().unwrap();
        let mean = image.mean();
        for (value, exact) in image.values.iter().zip(&exact) {
            // Four replicates of one pixel may agree by chance, those of all pixels do not.
            let allowed = 6.0 * error * exact.max(mean) + 1e-12;
            assert!((value - exact).abs() <= allowed, "{value} ± {error}: {exact}");
        }
        println!("{half} {pixels}: error {error:.1e}, off {:.2}", off(&image, &exact));
        assert!(error < 0.02 && off(&image, &exact) < 1.5, "{half} {pixels}: {error}");
        let light = (half / 0.9).min(1.0).powi(2);
        assert!((image.light().value - light).abs() <= 8.0 * image.light().error + 1e-12);
    }
    // A frame that the beam fills gets all of it in equal parts, without any error.
    let projection =
        along_z(field.index_field(), setup(GrinRegion::cube(1.0), Some(1.5)), 0.9, (0.9, 8));
    let image = render(&projection, &ProjectionSettings::default());
    assert!(image.values.iter().all(|value| (value - 1.0).abs() < 1e-12), "{:?}", image.values);
    assert_eq!((image.rms_error(), image.reached), (Some(0.0), true));
}

/// The square of light of Luneburg's lens at infinity: a ray at height `h` leaves at the angle whose sine is `h`, so
/// that the irradiance over tangents `t` falls as `1/(1 + t²)²`.
fn luneburg_at_infinity(frame: f64, pixels: usize, beam: f64) -> Vec<f64> {
    pixel_means(frame, pixels, |t| (frame / beam).powi(2) * (1.0 + t * t).powi(-2))
}

/// Means over pixels of an irradiance by the distance from the axis, by many points of each.
fn pixel_means(frame: f64, pixels: usize, irradiance: impl Fn(f64) -> f64) -> Vec<f64> {
    const FINE: usize = 16;
    let at = |i: usize, k: usize| {
        frame * (2.0 * (i as f64 + (k as f64 + 0.5) / FINE as f64) / pixels as f64 - 1.0)
    };
    let density = |u: f64, v: f64| irradiance(u.hypot(v));
    let mean = |n: usize| {
        let points =
            (0..FINE * FINE).map(|k| density(at(n % pixels, k % FINE), at(n / pixels, k / FINE)));
        points.sum::<f64>() / (FINE * FINE) as f64
    };
    (0..pixels * pixels).map(mean).collect()
}

#[test]
fn a_luneburg_lens_forms_its_exact_image_at_infinity() {
    let field = luneburg();
    // The corners of the frame are at heights of 0.41 in the beam.
    let (frame, pixels, beam) = (0.5, 9, 0.69);
    let exact = luneburg_at_infinity(frame, pixels, beam);
    let projection = along_z(&field, setup(GrinRegion::ball(1.0), None), beam, (frame, pixels));
    let settings = ProjectionSettings { tolerance: 0.01, ..ProjectionSettings::default() };
    let image = render(&projection, &settings);
    let error = image.rms_error().unwrap();
    println!("{} rays, error {error:.4}, off {:.2}", image.rays, off(&image, &exact));
    assert!(image.reached && error <= 0.01 && image.rays < 1 << 22, "{error} {}", image.rays);
    assert!(off(&image, &exact) < 1.4, "{}", off(&image, &exact));
    // All of it arrives, and the exact share of it beside the frame.
    assert_eq!(image.fates.count_of(GrinFate::Left), image.rays);
    let inside = exact.iter().sum::<f64>() / exact.len() as f64;
    let beside = image.beside as f64 / image.rays as f64;
    let allowed = 6.0 * image.light().error;
    assert!((inside + beside - 1.0).abs() < allowed, "{inside} {beside} {allowed}");
}

/// In a fibre with `η² = n² (1 - g² r²)` a ray that starts along the axis at `r` is at `r cos(n g z/η(r))`, and goes on
/// straight behind it. The irradiance is that of the beam over the change of area.
#[test]
fn a_parabolic_fibre_forms_its_exact_image_behind_it() {
    let (axis, g, length, distance) = (1.5, 0.5_f64, 1.0, 0.5);
    let field = ProfileField::cylinder(Parabolic::new(axis, g));
    let (frame, pixels, beam) = (0.45_f64, 9, 0.8);
    let setup = GrinSetup {
        launch: LaunchMode::Scaled,
        ..setup(GrinRegion::rod(1.2, 0.0, length), Some(length + distance))
    };
    let image_of = |r: f64| {
        let index = axis * (1.0 - (g * r).powi(2)).sqrt();
        let phase = axis * g * length / index;
        r * (phase.cos() - distance * axis * g / index * phase.sin())
    };
    let start_of = |image: f64| {
        let (mut low, mut high) = (0.0, 1.2);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            *(if image_of(middle) < image { &mut low } else { &mut high }) = middle;
        }
        0.5 * (low + high)
    };
    let irradiance = |image: f64| {
        let r = start_of(image);
        let slope = (image_of(r + 1e-5) - image_of(r - 1e-5)) / 2e-5;
        (frame / beam).powi(2) * r / (image * slope)
    };
    // Pixels on the axis have no point there.
    let exact = pixel_means(frame, pixels, irradiance);
    let projection = along_z(&field, setup, beam, (frame, pixels));
    let settings = ProjectionSettings { tolerance: 0.01, ..ProjectionSettings::default() };
    let image = render(&projection, &settings);
    println!("{} rays, off {:.2}, {:?}", image.rays, off(&image, &exact), exact[40]);
    assert!(image.reached && off(&image, &exact) < 1.4, "{}", off(&image, &exact));
    assert!(exact[0] > 1.2 * exact[40], "an image that is not even: {exact:?}");
}

/// Several screens of one beam have the same images as each by itself, one that the light misses among them.
#[test]
fn screens_of_one_beam_share_its_rays() {
    let field = luneburg();
    let frame = |half: f64, pixels| screen_frame(half, pixels).unwrap();
    let plane = |z: f64| Some(Face::plane(Z, z));
    let screens = [
        LightScreen { face: plane(1.5), frame: frame(0.5, 8) },
        LightScreen { face: None, frame: frame(0.5, 16) },
        LightScreen { face: plane(-5.0), frame: frame(0.5, 4) },
    ];
    let beam = SquareBeam::new(Z, 0.69, 2.0);
    let images = |screens: &[LightScreen]| {
        let setup = setup(GrinRegion::ball(1.0), None);
        let projection = LightProjection::new(&field, setup, beam, screens.to_vec()).unwrap();
        projection.render(&all(1 << 14, 5), &mut |_| ControlFlow::Continue(())).unwrap()
    };
    let together = images(&screens);
    for (screen, image) in screens[..2].iter().zip(&together) {
        assert_eq!(images(&[*screen]), std::slice::from_ref(image));
    }
    // By itself it is left black after the first pass.
    let alone = &images(&screens[2..])[0];
    assert!(alone.values == together[2].values && alone.rays < together[2].rays, "{alone:?}");
    assert_eq!(together[2].fates.count_of(GrinFate::MissedScreen), together[2].rays);
    assert!(together[0].mean() > 0.1 && together[1].mean() > 0.1);
}

/// The errors are those that repeated seeds have: neither too small nor far too large.
#[test]
fn stated_errors_cover_the_true_ones() {
    const SEEDS: u32 = 24;
    let field = luneburg();
    let (frame, pixels, beam) = (0.5, 7, 0.69);
    let exact = luneburg_at_infinity(frame, pixels, beam);
    let light = exact.iter().sum::<f64>() / exact.len() as f64;
    let projection = along_z(&field, setup(GrinRegion::ball(1.0), None), beam, (frame, pixels));
    let (mut squares, mut shares, mut pairs, mut stopped) = (0.0, 0.0, 0.0, 0.0);
    let mut last: Option<ProjectedImage> = None;
    for seed in 0..SEEDS {
        let image = render(&projection, &all(4096, seed));
        squares += off(&image, &exact).powi(2);
        let found = image.light();
        shares += ((found.value - light) / found.error).powi(2);
        let settings = ProjectionSettings { tolerance: 0.03, seed, ..Default::default() };
        stopped += off(&render(&projection, &settings), &exact).powi(2);
        if let Some(last) = &last {
            pairs += image.difference(last);
        }
        last = Some(image);
    }
    let [rms, shares, stopped] =
        [squares, shares, stopped].map(|sum| (sum / f64::from(SEEDS)).sqrt());
    let pairs = pairs / f64::from(SEEDS - 1);
    println!(
        "true over stated {rms:.3}, between seeds {pairs:.3}, light {shares:.3}, until a tolerance {stopped:.3}"
    );
    assert!((0.8..1.2).contains(&rms), "{rms}");
    assert!((0.8..1.2).contains(&pairs), "{pairs}");
    // Images end where their error happens to look small.
    assert!((0.8..1.3).contains(&stopped), "{stopped}");
    // The error of one number by four replicates has Student's distribution, whose deviation is 1.7.
    assert!((0.6..3.0).contains(&shares), "{shares}");
}

#[test]
fn more_rays_are_taken_until_the_tolerance_or_their_largest_number() {
    let field = luneburg();
    let projection = along_z(&field, setup(GrinRegion::ball(1.0), None), 0.69, (0.5, 7));
    let render = |tolerance: f64, max_rays: usize| {
        render(&projection, &ProjectionSettings { tolerance, max_rays, seed: 3 })
    };
    let [coarse, fine] = [0.1, 0.02].map(|tolerance| render(tolerance, 1 << 24));
    assert!(coarse.reached && fine.reached && fine.rays > coarse.rays);
    assert!(coarse.rms_error().unwrap() <= 0.1 && fine.rms_error().unwrap() <= 0.02);
    let few = render(1e-6, 5000);
    assert!(!few.reached && few.complete && few.rays <= 5000, "{}", few.rays);
    assert!(few.rms_error().unwrap() > 1e-6);
}

#[test]
fn light_that_lands_nowhere_is_counted_and_makes_a_black_image() {
    let field = air();
    let dark = |setup: GrinSetup<f64>, beam: SquareBeam, fate: GrinFate| {
        let frame = screen_frame(1.0, 4).unwrap();
        let screens = on(&setup, frame);
        let projection = LightProjection::new(field.index_field(), setup, beam, screens).unwrap();
        let image = render(&projection, &ProjectionSettings::default());
        assert_eq!(image.fates.count_of(fate), image.rays, "{:?}", image.fates);
        assert!(image.rays >= 4096 && image.values.iter().all(|value| *value == 0.0));
        assert_eq!((image.rms_error(), image.reached, image.complete), (None, false, true));
        let light = image.light();
        assert!(light.value == 0.0 && light.error > 0.0 && light.error < 1e-3, "{light:?}");
        image
    };
    let beam = SquareBeam::new(Z, 0.5, 5.0);
    // A screen that the light has passed before it starts, and a beam beside the domain.
    let passed = dark(setup(GrinRegion::cube(1.0), Some(-9.0)), beam, GrinFate::MissedScreen);
    assert_eq!(passed.lost_share(), 1.0);
    let across = SquareBeam::new(Vec3::new(1.0, 0.0, 0.0), 0.5, 5.0);
    dark(setup(GrinRegion::rod(0.4, 3.0, 4.0), Some(5.0)), across, GrinFate::NeverEntered);
    // Light on the plane of the screen, but beside a frame far from it.
    let far = ImageFrame { center: [9.0, 0.0], ..screen_frame(1.0, 4).unwrap() };
    let setup = setup(GrinRegion::cube(1.0), Some(1.5));
    let screens = on(&setup, far);
    let projection = LightProjection::new(field.index_field(), setup, beam, screens).unwrap();
    let image = render(&projection, &ProjectionSettings::default());
    assert!(image.beside == image.rays && image.lost_share() == 0.0 && image.rms_error().is_none());
}

/// A beam of which one ray in four thousand lands: replicates that agree on black pixels do not make it known.
#[test]
fn an_image_of_few_rays_is_not_reached() {
    let field = air();
    let setup = setup(GrinRegion::cube(1.0), Some(1.5));
    let projection = along_z(field.index_field(), setup, 0.64, (0.01, 64));
    let settings = ProjectionSettings { max_rays: 1 << 18, ..Default::default() };
    let image = render(&projection, &settings);
    assert!(image.mean() > 0.0 && !image.reached, "{:?}", image.rms_error());
    assert!(image.rms_error() > Some(1.0), "{:?}", image.rms_error());
}

/// Half of the light is kept inside for more steps than it may take, or does not meet the domain.
#[test]
fn rays_that_never_leave_are_a_fate() {
    let field = air();
    let mut slow = setup(GrinRegion::cube(1.0), Some(1.5));
    if let EndCondition::Boundary { limit, .. } = &mut slow.end {
        *limit = 3;
    }
    let projection = along_z(field.index_field(), slow, 0.5, (1.0, 4));
    let image = render(&projection, &ProjectionSettings::default());
    assert_eq!(image.fates.count_of(GrinFate::Trapped), image.rays);
    assert!(image.lost_share() == 1.0 && image.rms_error().is_none());
    let partly = setup(GrinRegion::rod(0.4, -1.0, 1.0), Some(1.5));
    let image = render(&along_z(field.index_field(), partly, 0.8, (1.0, 8)), &all(1 << 15, 0));
    let inside = std::f64::consts::PI * 0.16 / 2.56;
    let light = image.light();
    assert!((light.value - inside).abs() < 8.0 * light.error, "{light:?} {inside}");
    assert!((image.lost_share() - (1.0 - light.value)).abs() < 1e-3);
}

#[test]
fn what_cannot_be_followed_is_refused_by_name() {
    let field = air();
    let refused = |setup: GrinSetup<f64>, beam: SquareBeam, pixels: usize| {
        let frame = screen_frame(1.0, pixels)?;
        let screens = on(&setup, frame);
        LightProjection::new(field.index_field(), setup, beam, screens).map(|_| ())
    };
    let good = || setup(GrinRegion::cube(1.0), Some(1.5));
    let beam = SquareBeam::new(Z, 0.5, 5.0);
    let says = |found: Result<(), ProjectionError>, word: &str| {
        let found = found.unwrap_err().to_string();
        assert!(found.contains(word), "`{found}`: no `{word}`");
    };
    says(refused(good(), beam, 0), "number of pixels is 0");
    says(refused(good(), beam, usize::MAX), "number of pixels");
    for half in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        says(refused(good(), SquareBeam { half, ..beam }, 4), "half the side of the beam");
        says(screen_frame(half, 4).map(|_| ()), "half the side of the image");
    }
    says(refused(good(), SquareBeam::new(Vec3::default(), 0.5, 5.0), 4), "direction");
    says(refused(good(), SquareBeam { back: f64::NAN, ..beam }, 4), "distance of the beam");
    says(refused(setup(GrinRegion::cube(0.0), Some(1.5)), beam, 4), "empty");
    let none = LightProjection::new(field.index_field(), good(), beam, Vec::new());
    says(none.map(|_| ()), "number of screens");
    let projection = along_z(field.index_field(), good(), 0.5, (1.0, 4));
    let few = projection.render(&all(3, 0), &mut |_| ControlFlow::Continue(()));
    says(few.map(|_| ()), "number of rays is 3");
    // The fewest rays that there can be.
    let image = render(&projection, &all(4, 0));
    assert!(image.rays == 4 && image.rms_error().is_some_and(f64::is_finite), "{image:?}");
}

/// A task with a field that bends light.
fn display() -> (GrinTask, GrinField) {
    let task = quick("display", 25);
    let field = solved(&task);
    (task, field)
}

#[test]
fn images_do_not_depend_on_the_number_of_threads() {
    let (task, field) = display();
    let settings = ProjectionSettings { tolerance: 0.1, ..ProjectionSettings::default() };
    let on = |threads: usize| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut go_on = |_| ControlFlow::Continue(());
        pool.install(|| project_views(&task, &field, &settings, &mut go_on).unwrap())
    };
    assert_eq!(on(1), on(3));
}

/// The root mean square difference of two square images inside their outermost pixels, the first one smoothed: the
/// footprint of a ray in the loss is wider than a pixel, by a variance of a sixth of its square along each side.
fn unlike(sharp: &[f64], smooth: &[f64], pixels: usize) -> f64 {
    let weight = |k: usize| if k == 1 { 10.0 / 12.0 } else { 1.0 / 12.0 };
    let smoothed = |row: usize, column: usize| {
        let at = |k: usize| sharp[(row + k / 3 - 1) * pixels + column + k % 3 - 1];
        (0..9).map(|k| weight(k / 3) * weight(k % 3) * at(k)).sum::<f64>()
    };
    let inside = 1..pixels - 1;
    let places = inside.clone().flat_map(|row| inside.clone().map(move |column| (row, column)));
    let squares =
        places.map(|(row, column)| (smoothed(row, column) - smooth[row * pixels + column]).powi(2));
    (squares.sum::<f64>() / ((pixels - 2) * (pixels - 2)) as f64).sqrt()
}

/// The image of a view is that of its loss, neither turned nor mirrored, with sharper pixels.
#[test]
fn views_are_rendered_as_their_loss_sees_them() {
    let (task, field) = display();
    let settings = ProjectionSettings { tolerance: 0.05, ..ProjectionSettings::default() };
    let rendered =
        project_views(&task, &field, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
    let mut fine = task.clone();
    for view in &mut fine.views {
        if let LightSource::Beam { rays, .. } = &mut view.source {
            *rays = 160;
        }
    }
    let reports = fine.report_views(&field).unwrap();
    assert_eq!(rendered.len(), 2);
    for (view, report) in rendered.iter().zip(&reports) {
        let (view, loss) = (view.as_ref().unwrap(), report.image.as_ref().unwrap());
        assert!(view.light.reached && view.image.target == loss.target);
        let light = view.light.light();
        assert!((light.value - loss.light_share()).abs() < 0.02, "{light:?}");
        let made = &view.image.formed;
        let same = unlike(made, &loss.formed, 16);
        let mirrored: Vec<f64> =
            made.chunks(16).flat_map(|row| row.iter().rev()).copied().collect();
        let upside_down: Vec<f64> = made.chunks(16).rev().flatten().copied().collect();
        let others = [mirrored, upside_down].map(|other| unlike(&other, &loss.formed, 16));
        println!("unlike {same:.3}, mirrored {others:.3?}");
        assert!(same < 0.05, "{same}");
        // Faces and letters are about the same in a mirror.
        assert!(others[1] > 2.0 * same && others[0] > same, "{others:?} {same}");
        assert!(view.quality().error < 0.5 && view.correlation().error < 0.05);
    }
}

#[test]
fn goals_without_an_image_have_none() {
    let task = quick("caustic", 1);
    let field = solved(&task);
    let settings = ProjectionSettings::default();
    let views = project_views(&task, &field, &settings, &mut |_| ControlFlow::Continue(()));
    assert_eq!(views.unwrap(), [None]);
}

#[test]
fn an_image_that_is_stopped_is_as_far_as_it_is_and_says_so() {
    let field = luneburg();
    let projection = along_z(&field, setup(GrinRegion::ball(1.0), None), 0.69, (0.5, 7));
    for passes in [0, 3, 6] {
        let (mut asked, mut last) = (0, 0.0);
        let image = projection
            .render(&ProjectionSettings { tolerance: 1e-3, ..Default::default() }, &mut |done| {
                assert!((0.0..=1.0).contains(&done) && done >= last, "{done} after {last}");
                (asked, last) = (asked + 1, done);
                if asked > passes { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            })
            .unwrap()
            .remove(0);
        assert!(!image.complete && !image.reached);
        assert_eq!(image.rays, passes * 4 * 16 * 16);
        assert!(image.values.iter().chain(&image.errors).all(|value| value.is_finite()));
        assert_eq!(image.rms_error().is_some(), passes > 0);
        assert!(image.light().error.is_finite());
    }
}
