//! Integrals over clear and clipped pupils, chief rays and illumination against `lenses.json`.

use crate::reference::{Reference, Worst, count, lenses, number, numbers};
use aplanat::analysis::{
    AnalysisError, Estimate, ImageQuality, PupilShape, distortion, fan, field_curvature,
    geometric_mtf, illumination, image_quality, path_differences, pupil, spot, spots, wavefront,
};
use aplanat::lens::{FieldKind, FieldPoint};
use aplanat::paraxial::{Beam, first_order, seidel};
use aplanat::pupil::{Accuracy, RayModel};
use aplanat::trace::{Fate, Tracer};

const ACCURACY: Accuracy = Accuracy { tolerance: 1e-11, max_rays: 400_000 };

#[test]
fn reference_integrals() {
    let mut compared = 0;
    for lens in lenses() {
        let (model, mut worst) = (lens.open_model(), Worst::default());
        for exact in lens.data["integrals"].as_array().unwrap() {
            let field = model.fields[count(&exact["f"])];
            let got = spot(&model, field, ACCURACY).unwrap();
            for exact in exact["per_wavelength"].as_array().unwrap() {
                let w = count(&exact["w"]);
                let color = got.channels[w].unwrap();
                let mtf = geometric_mtf(&model, field, w, &[10.0, 30.0], ACCURACY).unwrap().points;
                for (got, name) in [
                    (color.rms, "rms"),
                    (color.centroid[0], "centroid_x"),
                    (color.centroid[1], "centroid_y"),
                    (mtf[0].tangential.modulus, "gmtf_t10"),
                    (mtf[0].sagittal.modulus, "gmtf_s10"),
                    (mtf[1].tangential.modulus, "gmtf_t30"),
                    (mtf[1].sagittal.modulus, "gmtf_s30"),
                ] {
                    let tolerance = (10.0 * number(&exact["err"][name])).max(1e-9);
                    let place = format!("{name} f {} w {w}: {got:?}", field.y);
                    worst.note(got.value, number(&exact[name]), tolerance, place);
                }
            }
        }
        compared += worst.check(&format!("integrals {}", lens.id()), 1.0);
    }
    assert_eq!(compared, 532);
}

#[test]
fn reference_vignetted() {
    let mut compared = 0;
    for lens in lenses() {
        let (model, mut worst) = (lens.clipped_model(), Worst::default());
        let w = lens.primary();
        let light = illumination(&model, w, ACCURACY);
        let pupil = model.first_order.entrance_pupil.diameter.unwrap();
        let scale = (pupil / number(&lens.data["aperture"]["epd"])).powi(2);
        for exact in lens.data["vignetted"]["fields"].as_array().unwrap() {
            let f = count(&exact["f"]);
            let field = model.fields[f];
            if exact["no_light"].as_bool() == Some(true) {
                assert!(light[f].error.is_some() && light[f].cone.value == 0.0, "{}", lens.id());
                continue;
            }
            let mut note = |name: &str, got: Estimate, factor: f64| {
                if exact[name].is_null() {
                    return;
                }
                // The file states no error for the contrast, and where a spot is wide against
                // the grating its own quadrature shows: on the axis of the aspheric singlet a
                // round pupil is integrated to 2e-7 there, while eight of our orders agree.
                let least = if name == "gmtf_t30" { 1e-5 } else { 1e-6 };
                let tolerance = (10.0 * exact["err"][name].as_f64().unwrap_or(0.0)).max(least);
                let place = format!("{name} f {}: {got:?} {}", field.y, exact[name]);
                worst.note(got.value * factor, number(&exact[name]), tolerance, place);
            };
            note("relative_illumination", light[f].relative_cone.unwrap(), 1.0);
            note("solid_angle_projected", light[f].cone, 1.0);
            let got = spot(&model, field, ACCURACY).unwrap().channels[w].unwrap();
            note("ep_area_unit_disc", got.area, scale);
            note("unvignetted_fraction", got.area, scale / std::f64::consts::PI);
            note("rms", got.rms, 1.0);
            note("centroid_y", got.centroid[1], 1.0);
            let mtf = geometric_mtf(&model, field, w, &[30.0], ACCURACY).unwrap().points;
            note("gmtf_t30", mtf[0].tangential.modulus, 1.0);
        }
        compared += worst.check(&format!("vignetted {}", lens.id()), 1.0);
    }
    assert_eq!(compared, 181);
}

/// Sixteen times the rounding of the path along the axis, in wavelengths: long systems have no
/// better path differences.
fn path_rounding(model: &RayModel, wavelength: usize) -> f64 {
    let color = &model.channels[wavelength];
    let gap = |s: &aplanat::lens::Surface<f64>| s.index * s.thickness.abs();
    let path: f64 = color.system.surfaces.iter().map(gap).sum();
    16.0 * 0.5 * f64::EPSILON * path / (color.um * 1e-3)
}

#[test]
fn reference_path_differences() {
    let mut compared = 0;
    for lens in lenses() {
        let (model, mut worst) = (lens.open_model(), Worst::default());
        for ray in lens.data["rays"].as_array().unwrap() {
            if ray["opd_waves"].is_null() {
                continue;
            }
            let (f, w) = (count(&ray["f"]), count(&ray["w"]));
            let pupil = numbers(&ray["pupil"]);
            let points = [[pupil[0], pupil[1]]];
            let got = path_differences(&model, model.fields[f], w, &points).unwrap()[0].unwrap();
            let tolerance = path_rounding(&model, w).max(1e-8);
            worst.note(got, number(&ray["opd_waves"]), tolerance, format!("{f} {w} {pupil:?}"));
        }
        for exact in lens.data["integrals"].as_array().unwrap() {
            let field = model.fields[count(&exact["f"])];
            for exact in exact["per_wavelength"].as_array().unwrap() {
                let w = count(&exact["w"]);
                let got = wavefront(&model, field, w, ACCURACY).unwrap().rms;
                let err = 10.0 * number(&exact["err"]["rms_opd_waves"]);
                let tolerance = err.max(path_rounding(&model, w)).max(1e-9);
                let name = format!("rms f {} w {w}", field.y);
                worst.note(got.value, number(&exact["rms_opd_waves"]), tolerance, name);
            }
        }
        compared += worst.check(&format!("path differences {}", lens.id()), 1.0);
    }
    assert_eq!(compared, 836);
}

#[test]
fn reference_chief_rays() {
    let mut compared = 0;
    for lens in lenses() {
        let (model, mut worst) = (lens.open_model(), Worst::default());
        for exact in lens.data["chief"].as_array().unwrap() {
            let got = distortion(&model, model.fields[count(&exact["f"])], lens.primary()).unwrap();
            let size = number(&exact["y_gauss"]).abs();
            worst.note(got.height, number(&exact["y_chief"]), size, "y_chief");
            worst.note(got.ideal, number(&exact["y_gauss"]), size, "y_gauss");
            worst.note(got.distortion.unwrap(), number(&exact["distortion"]), 1.0, "distortion");
            let f_theta = &exact["distortion_ftheta"];
            assert_eq!(got.f_theta.is_none(), f_theta.is_null());
            if let Some(got) = got.f_theta {
                worst.note(got, number(f_theta), 1.0, "f theta");
            }
        }
        compared += worst.check(&format!("chief rays {}", lens.id()), 1e-11);
    }
    assert_eq!(compared, 70);
}

/// Every analysis of a field, for a lens that lets nothing of it through.
fn all_dark(model: &RayModel, field: FieldPoint) {
    let accuracy = Accuracy::default();
    assert!(spot(model, field, accuracy).is_err());
    assert!(geometric_mtf(model, field, 0, &[10.0], accuracy).is_err());
    assert!(wavefront(model, field, 0, accuracy).is_err());
    let light = illumination(&RayModel { fields: vec![field], ..model.clone() }, 0, accuracy);
    assert_eq!((light[0].cone.value, light[0].irradiance.value), (0.0, 0.0));
    assert!(light[0].error.is_some() && light[0].relative.is_none());
    if let Ok(fans) = fan(model, field, 11) {
        assert!(fans.iter().all(|f| f.tangential.iter().all(|point| point.error.is_none())));
    }
    if let Ok(found) = distortion(model, field, 0) {
        assert!(found.height.is_finite() && found.ideal.is_finite());
    }
    if let Ok(found) = field_curvature(model, field, 0) {
        assert!([found.tangential, found.sagittal].iter().flatten().all(|z| z.is_finite()));
    }
}

#[test]
fn a_field_without_light_says_so_in_every_analysis() {
    // Where the stop comes first, a hole in it is still a pupil.
    let behind = |lens: &&Reference| lens.open(0).stop != Some(0);
    let angles = |lens: &&Reference| lens.field_kind() == FieldKind::Angle;
    for lens in lenses().iter().filter(angles).filter(behind) {
        for angle in [75.0, 90.0, -150.0] {
            let field = FieldPoint { x: 0.0, y: angle, weight: 1.0 };
            let mut model = lens.clipped_model();
            for color in &mut model.channels {
                color.system.surfaces[0].semi_diameter = 1e-9;
                color.tracer = Tracer::new(&color.system).unwrap();
            }
            all_dark(&model, field);
        }
    }
}

#[test]
fn a_spot_out_of_focus_is_the_spot_of_the_moved_image_plane() {
    let lens = lenses().into_iter().find(|lens| lens.id() == "cooke_triplet").unwrap();
    let at = |defocus: f64| {
        let mut model = lens.open_model();
        for color in &mut model.channels {
            let last = color.system.surfaces.len() - 2;
            color.system.surfaces[last].thickness += defocus;
            color.tracer = Tracer::new(&color.system).unwrap();
        }
        spot(&model, model.fields[2], ACCURACY).unwrap()
    };
    let focused = at(0.0);
    for defocus in [-0.3, 0.1, 0.4] {
        let moved = at(defocus);
        assert!((focused.rms_at(defocus) / moved.rms.value - 1.0).abs() < 1e-9, "{defocus}");
        let (color, moved) = (focused.channels[1].unwrap(), moved.channels[1].unwrap());
        assert!((color.rms_at(defocus) / moved.rms.value - 1.0).abs() < 1e-9, "{defocus}");
    }
    let best = focused.best_focus().unwrap();
    assert!(at(best).best_focus().unwrap().abs() < 1e-6);
    let best = focused.channels[1].unwrap().best_focus().unwrap();
    assert!(at(best).channels[1].unwrap().best_focus().unwrap().abs() < 1e-6);
}

#[test]
fn field_curvature_near_the_axis_follows_the_seidel_sums() {
    let lens = lenses().into_iter().find(|lens| lens.id() == "cooke_triplet").unwrap();
    let model = lens.open_model();
    let system = &model.channels[model.primary].system;
    let beam = Beam { edge: 0.1, ..model.beam };
    let first = first_order(system, &beam).unwrap();
    let sums = seidel(system, &first, None).unwrap().total;
    let at = |y: f64| {
        field_curvature(&model, FieldPoint { x: 0.0, y, weight: 1.0 }, model.primary).unwrap()
    };
    let (axis, edge) = (at(0.0), at(0.1));
    // Longitudinal shifts −(S3 + S4)/(2 n' u'²) and −(3 S3 + S4)/(2 n' u'²); Welford 8.
    let na2 = first.marginal.slopes.last().unwrap().powi(2);
    for (found, sum) in [
        (edge.sagittal.unwrap() - axis.sagittal.unwrap(), sums.s3 + sums.s4),
        (edge.tangential.unwrap() - axis.tangential.unwrap(), 3.0 * sums.s3 + sums.s4),
    ] {
        let exact = -sum / (2.0 * na2);
        assert!((found / exact - 1.0).abs() < 1e-3, "{found:e} {exact:e}");
    }
}

#[test]
fn an_error_estimate_covers_the_error() {
    let (mut worst, mut count) = (0.0f64, 0);
    let lenses = lenses();
    let models = lenses.iter().flat_map(|lens| [lens.open_model(), lens.clipped_model()]);
    for model in models {
        for field in &model.fields {
            let Ok(exact) = spot(&model, *field, ACCURACY) else { continue };
            for tolerance in [1e-1, 1e-2, 1e-3, 1e-5] {
                let accuracy = Accuracy { tolerance, ..ACCURACY };
                let rough = spot(&model, *field, accuracy).unwrap();
                let error = (rough.rms.value - exact.rms.value).abs();
                worst = worst.max(error / (rough.rms.error + exact.rms.error));
                count += 1;
            }
        }
    }
    println!("largest error over its estimate: {worst:.2} in {count} spots");
    assert!(worst < 1.0);
}

fn bundled(name: &str) -> aplanat::lens::Lens {
    aplanat::files::open(format!("lenses/{name}.json")).unwrap().lens
}

#[test]
fn the_pupil_of_a_dark_field_tells_which_surface_ends_most_rays() {
    let mut lens = bundled("double_gauss_rudolph_50");
    let field = FieldPoint { x: 0.0, y: 40.0, weight: 1.0 };
    lens.fields.values.push(field);
    let model = RayModel::from_lens(&lens, 0).unwrap();
    let dark = pupil(&model, field, model.primary, Accuracy::default());
    let PupilShape::Dark(loss) = dark.shape else { panic!("{:?}", dark.shape) };
    assert_eq!(
        (loss.main_fate, loss.rays, loss.includes_chief),
        (Some(Fate::Clipped(0)), 127, true)
    );
    let whole = pupil(&model, FieldPoint { y: 0.0, ..field }, model.primary, Accuracy::default());
    let share = dark.share_of(whole.extent.unwrap().area).unwrap();
    assert_eq!(share.value, 0.0);
    assert!(dark.extent.is_none());
}

#[test]
fn wide_pupils_are_compared_across_the_beam() {
    let model = RayModel::from_lens(&bundled("fisheye_minolta_16_f28"), 0).unwrap();
    let seen = |y: f64| {
        let field = FieldPoint { x: 0.0, y, weight: 1.0 };
        pupil(&model, field, model.primary, Accuracy::default())
    };
    let axis = seen(0.0).extent.unwrap().area;
    // The aperture is f/2.8 at 16 mm, and no surface clips on the axis.
    let exact =
        std::f64::consts::PI * (model.first_order.entrance_pupil.diameter.unwrap() / 2.0).powi(2);
    assert!((axis.value / exact - 1.0).abs() < 1e-12);
    let mut before = 1.0 + 1e-9;
    for angle in [20.0, 45.0, 80.0, 92.0] {
        let pupil = seen(angle);
        let share = pupil.share_of(axis).unwrap();
        println!("{angle} degrees: {:.4} of the pupil on the axis", share.value);
        assert!(pupil.across_beam && share.value < before && share.value > 0.1);
        before = share.value;
    }
}

#[test]
fn the_quality_of_a_lens_is_the_mean_of_its_spots() {
    let mut lens = bundled("double_gauss_rudolph_50");
    let model = RayModel::from_lens(&lens, 0).unwrap();
    let accuracy = Accuracy { tolerance: 1e-4, ..Accuracy::default() };
    let (mut total, mut square, mut area) = (0.0, 0.0, 0.0);
    for (field, spot) in model.fields.iter().zip(spots(&model, accuracy)) {
        let spot = spot.unwrap();
        total += field.weight;
        square += field.weight * spot.rms.value.powi(2);
        area += field.weight * spot.light.value;
    }
    let quality = image_quality(&lens, 1e-4).unwrap();
    assert!((quality.spot.unwrap().value / (square / total).sqrt() - 1.0).abs() < 1e-12);
    assert!((quality.light.value / (area / total) - 1.0).abs() < 1e-12 && quality.is_fully_lit);
    lens.surfaces[0].semi_diameter = Some(0.0);
    let dark = image_quality(&lens, 1e-4).unwrap();
    assert_eq!((dark.spot, dark.light.value), (Err(AnalysisError::NoLight), 0.0));
    assert!(!dark.is_fully_lit);
}

/// Parts that are alike have together what each of them has, by any weights, error and light included.
#[test]
fn the_quality_of_equal_parts_is_that_of_each() {
    let part = ImageQuality {
        spot: Ok(Estimate::new(0.02, 3e-4, 100)),
        light: Estimate::new(50.0, 0.4, 100),
        is_fully_lit: true,
    };
    let all = ImageQuality::mean(&[(0.5, part), (3.0, part), (1.25, part)]);
    let (spot, one) = (all.spot.unwrap(), part.spot.unwrap());
    assert!((spot.value - one.value).abs() < 1e-15 && (spot.error - one.error).abs() < 1e-15);
    assert!((all.light.value - 50.0).abs() < 1e-12 && (all.light.error - 0.4).abs() < 1e-12);
    assert!(all.is_fully_lit && all.spot.unwrap().rays == 300);
}
