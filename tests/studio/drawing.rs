//! The scene drawn by the graphics card against the same scene drawn by the processor.

use aplanat::studio::draw::{Camera, RgbaImage, Scene, gpu, software};
use glam::DVec2;

/// The card counts positions in 1/256 pixel, fuses multiplications and rounds its blending in its
/// own way: a step of 1 in 255 a shape. Crossing rays add such steps up, so a few pixels may be
/// further off; a shape shifted by a quarter of a pixel moves every pixel on its rim by 60.
const TOLERANCE: u8 = 4;
/// The share of pixels that may be further off than that, and how far they may be.
const OUTLIERS: (f64, u8) = (1e-3, 24);

const SIZE: [u32; 2] = [800, 400];

/// A lens-like scene: two glasses, a stop, and 20,000 ray segments in three colours.
fn lens_scene() -> Scene {
    let mut scene = Scene::on([24, 26, 30, 255]);
    for (z, curvature) in [(0.0, 0.02), (14.0, -0.015)] {
        let surface = |z: f64, curvature: f64| -> Vec<DVec2> {
            (-20..=20).map(f64::from).map(|y| DVec2::new(z + 0.5 * curvature * y * y, y)).collect()
        };
        let (front, back) = (surface(z, curvature), surface(z + 8.0, -0.5 * curvature));
        scene.strip(&front, &back, [90, 150, 210, 90]);
        scene.outline(&[front, back.into_iter().rev().collect()].concat(), 1.5, [200; 4]);
    }
    rays(&mut scene);
    for side in [-1.0, 1.0] {
        let tip = DVec2::new(11.0, side * 6.0);
        scene.line(tip, tip + side * 9.0 * DVec2::Y, 2.5, [255, 255, 255, 255]);
    }
    scene.dot(DVec2::new(60.0, 0.0), 7.0, [230, 80, 60, 200]);
    scene
}

fn rays(scene: &mut Scene) {
    let colours = [[80, 140, 255, 160], [70, 200, 120, 160], [240, 110, 80, 160]];
    for ray in 0..4000_u32 {
        let height = 12.0 * (2.0 * (0.618_033_99 * f64::from(ray)).fract() - 1.0);
        let field = f64::from(ray % 3) - 1.0;
        let points: Vec<DVec2> = [-15.0, 2.0, 9.0, 15.0, 21.0, 62.0]
            .into_iter()
            .map(|z| DVec2::new(z, height * (1.0 - z / 60.0) + 0.1 * field * z + 1e-3 * z * z))
            .collect();
        scene.polyline(&points, 1.0, colours[ray as usize % 3]);
    }
}

fn camera() -> Camera {
    Camera { center: DVec2::new(22.3, 0.7), scale: 9.7 }
}

/// The largest difference of each pixel of two images over its four channels.
fn distances(a: &RgbaImage, b: &RgbaImage) -> Vec<u8> {
    let pixels = a.rgba.chunks_exact(4).zip(b.rgba.chunks_exact(4));
    pixels.map(|(p, q)| p.iter().zip(q).map(|(x, y)| x.abs_diff(*y)).max().unwrap()).collect()
}

#[test]
#[ignore = "needs a GPU or a software Vulkan driver"]
fn the_gpu_draws_the_same_as_the_software_renderer() {
    let device = pollster::block_on(gpu::headless_device()).unwrap();
    let scene = lens_scene();
    assert_eq!(scene.segments.len(), 20_000 + 2 * 82 + 3);
    let fast = gpu::render_image(&device, &scene, camera(), SIZE).unwrap();
    let slow = software::draw(&scene, camera(), SIZE);
    let distances = distances(&fast, &slow);
    let worst = distances.iter().max().unwrap();
    let outliers = distances.iter().filter(|&&d| d > TOLERANCE).count();
    let share = outliers as f64 / distances.len() as f64;
    println!("worst {worst}, {outliers} pixels beyond {TOLERANCE}");
    assert!(share <= OUTLIERS.0 && *worst <= OUTLIERS.1, "worst {worst}, share {share:.2e}");
}

#[test]
#[ignore = "needs a GPU or a software Vulkan driver"]
fn the_gpu_draws_an_empty_scene() {
    let device = pollster::block_on(gpu::headless_device()).unwrap();
    let scene = Scene::on([10, 20, 30, 255]);
    let picture = gpu::render_image(&device, &scene, camera(), [33, 7]).unwrap();
    assert_eq!(picture, software::draw(&scene, camera(), [33, 7]));
}
