//! Integrals over clear and clipped pupils, chief rays and illumination against `lenses.json`.

use crate::reference::{Worst, count, lenses, number};
use aplanat::analysis::{contrast, distortion, illumination, spot};
use aplanat::pupil::Accuracy;

const ACCURACY: Accuracy = Accuracy { tolerance: 1e-11, most_rays: 400_000 };

#[test]
fn reference_integrals() {
    for lens in lenses() {
        let (bench, mut worst) = (lens.open_bench(), Worst::default());
        for exact in lens.data["integrals"].as_array().unwrap() {
            let field = bench.fields[count(&exact["f"])];
            let got = spot(&bench, field, ACCURACY).unwrap();
            for exact in exact["per_wavelength"].as_array().unwrap() {
                let w = count(&exact["w"]);
                let color = got.colors[w].unwrap();
                let mtf = contrast(&bench, field, w, &[10.0, 30.0], ACCURACY).unwrap();
                for (got, name) in [
                    (color.rms, "rms"),
                    (color.centroid[0], "centroid_x"),
                    (color.centroid[1], "centroid_y"),
                    (mtf[0].tangential, "gmtf_t10"),
                    (mtf[0].sagittal, "gmtf_s10"),
                    (mtf[1].tangential, "gmtf_t30"),
                    (mtf[1].sagittal, "gmtf_s30"),
                ] {
                    let tolerance = (10.0 * number(&exact["err"][name])).max(1e-9);
                    let place = format!("{name} f {} w {w}: {got:?}", field.y);
                    worst.note(got.value, number(&exact[name]), tolerance, place);
                }
            }
        }
        worst.check(&format!("integrals {}", lens.id()), 1.0);
    }
}

#[test]
fn reference_vignetted() {
    for lens in lenses() {
        let (bench, mut worst) = (lens.clipped_bench(), Worst::default());
        let w = lens.primary();
        let light = illumination(&bench, w, ACCURACY);
        let pupil = bench.first.entrance_pupil.diameter.unwrap();
        let scale = (pupil / number(&lens.data["aperture"]["epd"])).powi(2);
        for exact in lens.data["vignetted"]["fields"].as_array().unwrap() {
            let f = count(&exact["f"]);
            let field = bench.fields[f];
            if exact["no_light"].as_bool() == Some(true) {
                assert!(light[f].dark.is_some() && light[f].cone.value == 0.0, "{}", lens.id());
                continue;
            }
            let mut note = |name: &str, got: aplanat::analysis::Estimate, factor: f64| {
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
            note("relative_illumination", light[f].relative.unwrap(), 1.0);
            note("solid_angle_projected", light[f].cone, 1.0);
            let got = spot(&bench, field, ACCURACY).unwrap().colors[w].unwrap();
            note("ep_area_unit_disc", got.area, scale);
            note("unvignetted_fraction", got.area, scale / std::f64::consts::PI);
            note("rms", got.rms, 1.0);
            note("centroid_y", got.centroid[1], 1.0);
            let mtf = contrast(&bench, field, w, &[30.0], ACCURACY).unwrap();
            note("gmtf_t30", mtf[0].tangential, 1.0);
        }
        worst.check(&format!("vignetted {}", lens.id()), 1.0);
    }
}

#[test]
fn reference_chief_rays() {
    for lens in lenses() {
        let (bench, mut worst) = (lens.open_bench(), Worst::default());
        for exact in lens.data["chief"].as_array().unwrap() {
            let got = distortion(&bench, bench.fields[count(&exact["f"])], lens.primary()).unwrap();
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
        worst.check(&format!("chief rays {}", lens.id()), 1e-11);
    }
}
