//! Pictures by the graphics card against the same pictures by the processor.

use aplanat::lens::Lens;
use aplanat::picture::{
    BuiltInScene, Coloring, ExactRenderer, ImageFrame, QuickRenderer, field_diagonal, focused,
    picture_model,
};
use aplanat::studio::draw::PicturePass;

use crate::harness::double_gauss;

/// The largest difference of a pixel over the brightest one. Both sum in 32 bits in the same order; the card
/// fuses multiplications, which moves places by 2^-24 of up to 4096 texels, a 4000th of a texel, over which
/// an edge of the sharpest level changes by as much. Software Vulkan differs by 4e-7.
const TOLERANCE: f64 = 3e-4;

/// The largest difference of both pictures of a scene over the brightest pixel.
fn difference(pass: &PicturePass, lens: &Lens, scene: BuiltInScene, coloring: Coloring) -> f64 {
    let near = scene.has_depth().then_some(1000.0);
    let lens = near.map_or_else(|| lens.clone(), |near| focused(lens, 0, near).unwrap());
    let (model, bands) = picture_model(&lens, 0, coloring).unwrap();
    let diagonal = field_diagonal(&model).unwrap();
    // No multiple of the sides of blocks.
    let frame = ImageFrame::new(&model, [301, 203], diagonal).unwrap();
    let scene = scene.build(&model, &frame, near).unwrap();
    let exact = ExactRenderer::new(&model, &bands, &scene, frame).unwrap();
    let quick = QuickRenderer::new(&model, &bands, &exact).unwrap();
    let (slow, fast) = (quick.render(), quick.render_on(pass).unwrap());
    assert_eq!(slow.frame, fast.frame);
    let pairs = || slow.values.iter().flatten().zip(fast.values.iter().flatten());
    let brightest = pairs().map(|(slow, _)| *slow).fold(0.0, f64::max);
    assert!(brightest > 0.0);
    pairs().map(|(slow, fast)| (slow - fast).abs()).fold(0.0, f64::max) / brightest
}

#[test]
#[ignore = "needs a GPU or a software Vulkan driver"]
fn the_gpu_makes_the_pictures_of_the_processor() {
    let pass = pollster::block_on(PicturePass::headless()).unwrap();
    let lens = double_gauss();
    let scenes = [
        (BuiltInScene::Star, Coloring::Rgb(1)),
        (BuiltInScene::Edge, Coloring::Gray),
        (BuiltInScene::White, Coloring::Rgb(1)),
        (BuiltInScene::StillLife, Coloring::Rgb(1)),
    ];
    for (scene, coloring) in scenes {
        let found = difference(&pass, &lens, scene, coloring);
        assert!(found < TOLERANCE, "{}: {found:.1e}", scene.name());
    }
}
