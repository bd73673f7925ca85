//! Hard case 11 of images: the height decreases again within the field, where the solid angle of an element of the image
//! is infinite and two fields arrive at the same points.
//!
//! A lens of 100 mm behind a stop of 4 mm, and an aspheric plate in front of its image that bends the chief rays of
//! large fields back to the axis: 9.437 mm at 8 degrees, 7.866 mm at 10 degrees, back to 4.173 mm at 11 degrees.

use aplanat::analysis::{
    AnalysisError, ImageFold, energy_irradiance, illumination, irradiance, spot,
};
use aplanat::lens::{Aperture, FieldKind, FieldPoint, Fields, Lens, Medium, Object, Row, blank};
use aplanat::picture::{
    BuiltInScene, Coloring, ExactRenderer, ImageFrame, PictureError, field_diagonal, picture_model,
};
use aplanat::pupil::{Accuracy, RayModel};

const ACCURACY: Accuracy = Accuracy { tolerance: 1e-3, max_rays: 200_000 };

/// The lens, listing fields up to this one in degrees.
fn folded(edge: f64) -> Lens {
    let mut lens = blank();
    lens.object = Object::Infinity;
    lens.aperture = Aperture::EntrancePupilDiameter(4.0);
    let field = |y: f64| FieldPoint { x: 0.0, y, weight: 1.0 };
    lens.fields = Fields {
        kind: FieldKind::Angle,
        values: [0.0, 0.4, 0.8, 1.0].map(|part| field(part * edge)).into(),
    };
    let row = |thickness: f64| Row { thickness, semi_diameter: Some(40.0), ..Row::default() };
    let glass = |thickness: f64| Row { medium: Medium::Index(1.5), ..row(thickness) };
    lens.surfaces = vec![
        Row { stop: true, semi_diameter: Some(2.0), ..row(0.5) },
        Row { curvature: 0.01, ..glass(3.0) },
        Row { curvature: -0.01, ..row(76.0) },
        glass(2.0),
        Row { asphere: vec![-8e-5], ..row(20.0) },
    ];
    lens
}

fn model(edge: f64) -> RayModel {
    RayModel::from_lens(&folded(edge), 0).unwrap()
}

/// Before the turn light of one field arrives, and its irradiance is that of the energy of its element.
#[test]
fn up_to_the_turn_irradiance_is_a_number() {
    let model = model(6.0);
    assert_eq!(ImageFold::find(&model, 0), None);
    for light in illumination(&model, 0, ACCURACY) {
        assert_eq!(light.error, None);
        assert!(light.irradiance.value > 1.2e-3 && light.irradiance.error < 1e-5, "{light:?}");
    }
}

/// Twelve million rays of a uniform scene within 10 degrees give 6.049e-3 ± 7e-6 at 8.5 mm, and 1.739e-3 ± 5e-6 at
/// 6 mm. The directions about one chief ray have 3.340e-3 of it at 8.5 mm, which is refused by name. So are pictures
/// whose frame holds such points.
#[test]
fn beyond_the_turn_the_light_of_one_field_is_no_irradiance() {
    let model = model(10.0);
    let [least, most] = ImageFold::find(&model, 0).unwrap().radii;
    assert!(least > 6.0 && least < 7.866 && (most - 9.437).abs() < 0.02, "{least} {most}");
    let at = |height: f64| irradiance(&model, 0, [0.0, height], ACCURACY);
    assert_eq!(at(8.5).unwrap_err(), AnalysisError::FoldedImage);
    assert_eq!(at(-8.5).unwrap_err(), AnalysisError::FoldedImage);
    let inside = at(6.0).unwrap();
    assert!((inside.value - 1.739e-3).abs() < 1.5e-5 && inside.error < 1e-6, "{inside:?}");
    let lights = illumination(&model, 0, ACCURACY);
    let last = lights.last().unwrap();
    assert_eq!(last.error, Some(AnalysisError::FoldedImage));
    assert!(last.irradiance.error.is_infinite() && last.relative.is_none(), "{last:?}");
    // What needs no ray backwards is known all the same.
    assert!(last.cone.value > 0.0 && (last.point[1] - 7.866).abs() < 0.1, "{last:?}");
    assert!(last.relative_cone.is_some());

    let lens = folded(10.0);
    let (model, bands) = picture_model(&lens, 0, Coloring::Gray).unwrap();
    let diagonal = field_diagonal(&model).unwrap();
    let frame = ImageFrame::new(&model, [24, 16], diagonal).unwrap();
    let scene = BuiltInScene::White.build(&model, &frame, None).unwrap();
    let refused = ExactRenderer::new(&model, &bands, &scene, frame).unwrap_err();
    let is_named = matches!(
        refused,
        PictureError::Directions { source: AnalysisError::FoldedImage, radius } if radius == least
    );
    assert!(is_named, "{refused:?}");
    // A frame that ends before the fold has a picture.
    let frame = ImageFrame::new(&model, [24, 16], 2.0 * 6.0).unwrap();
    let scene = BuiltInScene::White.build(&model, &frame, None).unwrap();
    assert!(ExactRenderer::new(&model, &bands, &scene, frame).is_ok());
}

/// At the turn itself spots have a size, and the energy of an element of the field has no area to fall on, which is
/// refused by name; so is that of a field whose image another one shares.
#[test]
fn at_the_turn_spots_have_numbers_and_an_element_has_no_area() {
    let model = model(10.0);
    let (mut low, mut high) = (7.0, 9.0);
    let height = |y: f64| {
        let field = FieldPoint { x: 0.0, y, weight: 1.0 };
        let launch = model.launch(field, 0).unwrap();
        launch.unclipped_landing([0.0; 2]).unwrap().ray.point.value().y
    };
    for _ in 0..60 {
        let [a, b] = [low + (high - low) / 3.0, high - (high - low) / 3.0];
        if height(a) < height(b) { low = a } else { high = b }
    }
    let turn = FieldPoint { x: 0.0, y: low, weight: 1.0 };
    // Just below the largest height two fields arrive, which no sampled field need have.
    let [_, most] = ImageFold::find(&model, 0).unwrap().radii;
    assert!((most - height(turn.y)).abs() < 1e-9, "{most}");
    let refused = irradiance(&model, 0, [0.0, height(turn.y) - 1e-6], ACCURACY).unwrap_err();
    assert_eq!(refused, AnalysisError::FoldedImage);
    let found = spot(&model, turn, ACCURACY).unwrap();
    assert!(found.rms.value > 0.1 && found.rms.error < 1e-3 * found.rms.value, "{:?}", found.rms);
    for y in [turn.y, 9.0, 6.5] {
        let field = FieldPoint { y, ..turn };
        let refused = energy_irradiance(&model, field, 0, ACCURACY).unwrap_err();
        assert_eq!(refused, AnalysisError::FoldedImage, "{y}");
    }
    let field = FieldPoint { y: 3.0, ..turn };
    assert!(energy_irradiance(&model, field, 0, ACCURACY).unwrap().error < 1e-5);
}

/// A turn between the last two compared fields is found; one beyond the last field is none.
#[test]
fn a_turn_just_before_the_farthest_field_is_found() {
    let most = |edge: f64| ImageFold::find(&model(edge), 0).map(|fold| fold.radii[1]);
    let top = most(10.0).unwrap();
    let mut edge = 7.5;
    while most(edge).is_none() {
        edge += 0.02;
    }
    assert!((most(edge).unwrap() - top).abs() < 1e-6, "{edge}: {:?} {top}", most(edge));
    let (below, past) = (edge - 0.02, edge + 1.0);
    assert_eq!((most(below), most(past).map(|v| (v - top).abs() < 1e-6)), (None, Some(true)));
}
