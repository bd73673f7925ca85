//! Images behind a field: near and at infinity, custom targets, targets without light, beams that
//! miss the domain, and the same result on any number of threads.

use aplanat::grin::GrinFate;
use aplanat::grin_design::{
    self, Domain, GrinField, GrinOptimizer, GrinTask, LightGoal, LightSource, RefinementLevel,
    TargetImage, ViewImage,
};
use image::{GrayImage, Luma};
use rayon::ThreadPoolBuilder;
use std::path::PathBuf;

/// A task that comes with the program, with so many steps of its first level, quick to work on.
fn quick(name: &str, steps: usize) -> GrinTask {
    let mut task = grin_design::find_builtin(name).unwrap().task().unwrap();
    task.levels = vec![RefinementLevel { nodes: 5, steps }];
    for view in &mut task.views {
        if let LightSource::Beam { rays, .. } = &mut view.source {
            *rays = 32;
        }
        if let LightGoal::Image { pixels, .. } | LightGoal::Far { pixels, .. } = &mut view.goal {
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

fn images(task: &GrinTask, medium: &GrinField) -> Vec<ViewImage> {
    task.report_views(medium).unwrap().into_iter().filter_map(|seen| seen.image).collect()
}

/// A file that is gone after the test.
struct Scrap(PathBuf);

impl Scrap {
    fn new(name: &str, bytes: &[u8]) -> Self {
        let path = std::env::temp_dir().join(format!("aplanat-{}-{name}", std::process::id()));
        std::fs::write(&path, bytes).unwrap();
        Self(path)
    }

    /// A grey picture.
    fn picture(name: &str, [width, height]: [u32; 2], grey: impl Fn(u32, u32) -> u8) -> Self {
        let scrap = Self::new(name, &[]);
        let picture = GrayImage::from_fn(width, height, |x, y| Luma([grey(x, y)]));
        picture.save(&scrap.0).unwrap();
        scrap
    }

    fn drawing(&self) -> TargetImage {
        TargetImage::File(self.0.clone().into())
    }
}

impl Drop for Scrap {
    fn drop(&mut self) {
        drop(std::fs::remove_file(&self.0));
    }
}

/// A task whose picture is this one.
fn of_picture(wanted: TargetImage) -> GrinTask {
    let mut task = quick("caustic-near", 10);
    let LightGoal::Image { drawing, .. } = &mut task.views[0].goal else { panic!("no image") };
    *drawing = wanted;
    task
}

/// The pixels of an image file.
fn pixels(image: &TargetImage) -> Vec<f64> {
    of_picture(image.clone()).read_files().unwrap();
    image.render(8).unwrap()
}

/// The error of a task with this target image.
fn refused(drawing: TargetImage) -> String {
    let task = of_picture(drawing);
    task.check().and_then(|()| task.read_files()).unwrap_err().to_string()
}

#[test]
fn a_distant_screen_equals_one_at_infinity() {
    let far = quick("caustic-far", 15);
    let medium = solved(&far);
    let LightGoal::Far { drawing, angle, pixels } = far.views[0].goal.clone() else {
        panic!("not far")
    };
    let at = |distance: f64| {
        let mut near = far.clone();
        let half = distance * angle.to_radians().tan();
        near.views[0].goal = LightGoal::Image { drawing: drawing.clone(), half, distance, pixels };
        images(&near, &medium).remove(0)
    };
    let wanted = images(&far, &medium).remove(0);
    let off = |image: &ViewImage| {
        let pairs = image.formed.iter().zip(&wanted.formed);
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let [near, farther, farthest] = [1e2, 1e4, 1e6].map(|distance| off(&at(distance)));
    println!("off the image at infinity: {near:.1e}, {farther:.1e}, {farthest:.1e}");
    assert!(wanted.light_share() > 0.5 && near > 1e-3);
    assert!(farther < 0.05 * near && farthest < 1e-3 * near, "{near} {farther} {farthest}");
}

#[test]
fn images_are_the_same_bits_on_one_thread_and_on_two() {
    for name in ["multifocal", "caustic-near", "caustic-far", "caustic"] {
        let task = quick(name, 6);
        let on = |threads: usize| {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let medium = solved(&task);
                let bits: Vec<u64> =
                    medium.index_field().parameters().iter().map(|v| v.to_bits()).collect();
                (bits, images(&task, &medium))
            })
        };
        assert_eq!(on(1), on(2), "{name}");
    }
}

#[test]
fn every_beam_goal_is_approached() {
    for name in ["multifocal", "caustic-near", "caustic-far", "caustic"] {
        let mut runner = GrinOptimizer::new(&quick(name, 25)).unwrap();
        let before = runner.score(runner.best()).unwrap();
        while !runner.step().unwrap().finished {}
        let after = runner.score(runner.best()).unwrap();
        println!("{name}: {:.3e} to {:.3e}", before.loss, after.loss);
        assert!(after.loss < 0.9 * before.loss, "{name}: {} {}", before.loss, after.loss);
        assert!(after.views.iter().all(|view| view.retrace_error < 1e-9));
    }
}

#[test]
fn target_images_of_any_size_are_accepted() {
    // A white disc in the upper half of a tall picture.
    let disc = |x: u32, y: u32| {
        let r = (f64::from(x) - 18.0).hypot(f64::from(y) - 18.0);
        if r < 9.0 { 255 } else { 60 }
    };
    let scrap = Scrap::picture("own.png", [37, 53], disc);
    let task = of_picture(scrap.drawing());
    let text = serde_json::to_string(&task).unwrap();
    assert!(text.contains("{\"file\":\""), "{text}");
    assert_eq!(grin_design::read_task(&text, "a file").unwrap(), task);
    task.read_files().unwrap();
    let [even, found] = [GrinOptimizer::new(&task).unwrap().best().clone(), solved(&task)]
        .map(|m| images(&task, &m).remove(0));
    let rows = |image: &ViewImage, from: usize| {
        image.target[16 * from..16 * (from + 8)].iter().sum::<f64>() / 128.0
    };
    // Its middle square is what counts, rows from the bottom: the disc is above the middle.
    assert!((even.target.iter().sum::<f64>() / 256.0 - 1.0).abs() < 1e-12);
    assert!(rows(&even, 8) > 1.2 * rows(&even, 0), "{} {}", rows(&even, 8), rows(&even, 0));
    println!("own picture: correlation {:.2} to {:.2}", even.correlation(), found.correlation());
    assert!(found.correlation() > even.correlation() + 0.3);
}

#[test]
fn small_and_transparent_images_are_read() {
    let one = Scrap::picture("one.png", [1, 1], |_, _| 7);
    let wanted = pixels(&one.drawing());
    assert!(wanted.iter().all(|value| (value - 1.0).abs() < 1e-12));
    let scrap = Scrap::new("half.png", &[]);
    let half = |x: u32, _: u32| image::LumaA([200_u8, if x < 4 { 255 } else { 0 }]);
    image::GrayAlphaImage::from_fn(8, 8, half).save(&scrap.0).unwrap();
    let wanted = pixels(&scrap.drawing());
    assert!(
        wanted
            .iter()
            .enumerate()
            .all(|(n, value)| (*value - if n % 8 < 4 { 2.0 } else { 0.0 }).abs() < 1e-9)
    );
}

#[test]
fn invalid_images_are_refused_with_their_file() {
    let says = |found: String, words: &[&str]| {
        words.iter().for_each(|word| assert!(found.contains(word), "`{found}`: no `{word}`"));
    };
    let missing = TargetImage::File(PathBuf::from("there is none.png").into());
    says(
        refused(missing),
        &["views, number 0, goal, drawing", "there is none.png", "cannot be read"],
    );
    let empty = Scrap::new("empty.png", &[]);
    says(refused(empty.drawing()), &["empty.png", "an empty file", "PNG"]);
    let text = Scrap::new("text.png", b"this is no picture");
    says(refused(text.drawing()), &["text.png", "expected an image"]);
    let black = Scrap::picture("black.png", [5, 5], |_, _| 0);
    says(refused(black.drawing()), &["black.png", "a black image", "not black"]);
    let rim = Scrap::picture("rim.png", [30, 10], |x, _| if x < 5 { 255 } else { 0 });
    says(refused(rim.drawing()), &["rim.png", "middle", "no light"]);
    let huge = Scrap::picture("huge.png", [20_000, 1], |_, _| 255);
    says(refused(huge.drawing()), &["huge.png", "20000 x 1", "16384"]);
    let whole = Scrap::picture("whole.png", [64, 64], |x, y| (x * y % 251) as u8);
    let bytes = std::fs::read(&whole.0).unwrap();
    let torn = Scrap::new("torn.png", &bytes[..bytes.len() / 2]);
    says(refused(torn.drawing()), &["torn.png", "image"]);
    says(refused(TargetImage::Scene(f64::NAN)), &["goal, drawing, scene", "NaN"]);
}

#[test]
fn wrong_goals_across_a_beam_are_refused_by_name() {
    let refused = |name: &str, change: &dyn Fn(&mut LightGoal)| {
        let mut task = quick(name, 1);
        change(&mut task.views[0].goal);
        GrinOptimizer::new(&task).map(|_| ()).unwrap_err().to_string()
    };
    let says = |found: String, word: &str| assert!(found.contains(word), "`{found}`: no `{word}`");
    let flat = |goal: &mut LightGoal| {
        if let LightGoal::Far { angle, .. } | LightGoal::Ring { angle, .. } = goal {
            *angle = 90.0;
        }
    };
    says(refused("caustic-far", &flat), "goal, angle");
    says(refused("caustic", &flat), "goal, angle");
    let empty = |goal: &mut LightGoal| {
        if let LightGoal::Ring { radius, .. } = goal {
            *radius = 0.0;
        }
    };
    says(refused("caustic", &empty), "goal, radius");
    let coarse = |goal: &mut LightGoal| {
        if let LightGoal::Far { pixels, .. } = goal {
            *pixels = 1;
        }
    };
    says(refused("caustic-far", &coarse), "goal, pixels");
    let mut task = quick("caustic", 1);
    task.views[0].source = LightSource::Fan { height: 0.5, z: -2.0, rays: 5 };
    says(GrinOptimizer::new(&task).map(|_| ()).unwrap_err().to_string(), "beam");
}

#[test]
fn a_beam_that_misses_the_domain_is_reported_and_changes_nothing() {
    for name in ["caustic-near", "caustic-far", "caustic"] {
        let mut task = quick(name, 3);
        task.views[0].space = Some(Domain::Rod { radius: 0.2, from: -0.5, to: 0.5 });
        if let LightSource::Beam { direction, half, .. } = &mut task.views[0].source {
            (*direction, *half) = ([0.0, 0.0, 1.0], 0.5);
        }
        let partly = GrinOptimizer::new(&task).unwrap();
        let counts = partly.score(partly.best()).unwrap().views[0].counts;
        let missed = counts.fates.count_of(GrinFate::NeverEntered);
        assert!(
            missed > 500 && counts.valid() > 0 && counts.valid() + missed == 1024,
            "{counts:?}"
        );
        // A rod far up the axis, and a beam across it: no ray meets it.
        task.views[0].space = Some(Domain::Rod { radius: 0.2, from: 5.0, to: 6.0 });
        if let LightSource::Beam { direction, .. } = &mut task.views[0].source {
            *direction = [1.0, 0.0, 0.0];
        }
        let mut runner = GrinOptimizer::new(&task).unwrap();
        let before = runner.current().clone();
        while !runner.step().unwrap().finished {}
        let judged = runner.score(runner.current()).unwrap();
        let excluded: Vec<_> = judged.views[0].counts.excluded().collect();
        assert_eq!(excluded, [("never_entered", 1024)], "{name}");
        assert!(judged.loss.is_finite() && *runner.current() == before, "{name}: {judged:?}");
    }
}
