//! Point spread, contrast and Zernike sums by diffraction against `images.json`.

use crate::images::{ACCURACY, ImageLens, allowed, image_lenses};
use crate::reference::{Worst, number, numbers, read};
use aplanat::analysis::{
    AnalysisError, ContrastLimit, PupilCurve, PupilFunction, PupilSamples, TransferValue,
    ZernikeIndex, ZernikeMethod, ZernikeOrder, diffraction_gate, diffraction_mtf, encircled_energy,
    geometric_mtf, perfect_contrast, point_spread, polychromatic_diffraction_mtf, strehl,
    through_focus_mtf, zernike,
};
use aplanat::lens::FieldPoint;
use aplanat::pupil::Accuracy;
use serde_json::Value;
use std::f64::consts::PI;

#[test]
fn point_spread_of_lenses() {
    let mut compared = 0;
    for lens in image_lenses() {
        let mut worst = Worst::default();
        for (exact, model, field) in lens.fields() {
            let Some(list) = exact["psf"].as_array() else { continue };
            let points: Vec<_> = list.iter().map(|p| [number(&p["x"]), number(&p["y"])]).collect();
            let got = point_spread(&model, field, lens.primary(), &points, ACCURACY).unwrap();
            for (got, exact) in got.intensities.iter().zip(list) {
                let place = format!("{} {got:?}", field.y);
                worst.note(got.value, number(&exact["value"]), allowed(&exact["err"]), place);
            }
        }
        compared += worst.check(&format!("point spread {}", lens.id()), 1.0);
    }
    assert_eq!(compared, 40);
}

/// The contrast of every case of a lens that a choice takes, with an absolute error below
/// `least` or the one that the file allows.
fn contrast(
    lens: &ImageLens,
    tolerance: f64,
    least: f64,
    wanted: impl Fn(&Value) -> bool,
) -> usize {
    let accuracy = Accuracy { tolerance, ..ACCURACY };
    let mut worst = Worst::default();
    for (exact, model, field) in lens.fields() {
        for (list, poly) in [(&exact["mtf"], false), (&exact["poly"]["mtf"], true)] {
            for exact in list.as_array().into_iter().flatten().filter(|exact| wanted(exact)) {
                let nu = [number(&exact["frequency"])];
                let curve = if poly {
                    polychromatic_diffraction_mtf(&model, field, &nu, accuracy)
                } else {
                    diffraction_mtf(&model, field, lens.primary(), &nu, accuracy)
                };
                let point = curve.unwrap().points[0];
                let tangential = exact["lines"] == "tangential";
                let got = if tangential { point.tangential } else { point.sagittal };
                let place = format!("{} {nu:?} {got:?}", field.y);
                let allowed = allowed(&exact["err"]).max(least);
                worst.note(got.modulus.value, number(&exact["diffraction"]), allowed, &place);
                if !poly {
                    worst.note(got.re, number(&exact["re"]), allowed, &place);
                    worst.note(got.im, number(&exact["im"]), allowed, &place);
                }
            }
        }
    }
    worst.check(&format!("contrast {} to {least:e}", lens.id()), 1.0)
}

#[test]
fn diffraction_contrast_of_lenses() {
    let lenses = image_lenses();
    let compared: usize = lenses.iter().map(|lens| contrast(lens, 1e-4, 1e-4, |_| true)).sum();
    assert_eq!(compared, 87);
}

#[test]
fn diffraction_contrast_is_spectrally_accurate() {
    let lens = &image_lenses()[0];
    assert!(contrast(lens, 1e-10, 0.0, |exact| number(&exact["frequency"]) < 21.0) > 6);
}

#[test]
fn zernike_sums_of_lenses() {
    let mut compared = 0;
    for lens in image_lenses() {
        let mut worst = Worst::default();
        for (exact, model, field) in lens.fields() {
            let Some(list) = exact["zernike_noll"].as_array() else { continue };
            let order = (ZernikeOrder::Noll, list.len());
            let got = zernike(&model, field, lens.primary(), order, ACCURACY).unwrap();
            assert_eq!(got.method, ZernikeMethod::Projection);
            for (got, exact) in got.coefficients.iter().zip(list) {
                let place = format!("{} number {}", field.y, exact["j"]);
                worst.note(got.value, number(&exact["waves"]), 1e-8, place);
            }
        }
        compared += worst.check(&format!("Zernike {}", lens.id()), 1.0);
    }
    assert_eq!(compared, 148);
}

#[test]
fn zernike_orders() {
    let noll = ZernikeOrder::Noll.indices(11);
    let pairs: Vec<_> = noll.iter().map(|z| (z.degree, z.frequency)).collect();
    let expected = [
        (0, 0),
        (1, 1),
        (1, -1),
        (2, 0),
        (2, -2),
        (2, 2),
        (3, -1),
        (3, 1),
        (3, -3),
        (3, 3),
        (4, 0),
    ];
    assert_eq!(pairs, expected);
    let fringe = ZernikeOrder::Fringe.indices(9);
    let pairs: Vec<_> = fringe.iter().map(|z| (z.degree, z.frequency)).collect();
    let expected = [(0, 0), (1, 1), (1, -1), (2, 0), (2, 2), (2, -2), (3, 1), (3, -1), (4, 0)];
    assert_eq!(pairs, expected);
}

/// A pupil whose cosines are `−(px, py)/(2N)`, at f/2 and a wavelength of half a micrometre.
fn disc(waves: impl Fn([f64; 2]) -> f64) -> (PupilFunction, f64) {
    let (um, f_number) = (0.5, 2.0);
    let radius = 0.5 / f_number;
    let circle = PupilCurve::circle([0.0; 2], radius);
    let scaled = |c: [f64; 2]| waves(c.map(|v| -v / radius));
    (PupilFunction::uniform(vec![circle], um, scaled).unwrap(), um * 1e-3 * f_number)
}

/// The circles of energy that are integrated over, in λN: the cost grows as the fourth power.
const NEAR: f64 = 4.0;

#[test]
fn the_airy_disc_and_its_contrast() {
    for exact in read("images.json")["airy"].as_array().unwrap() {
        let (um, f_number) = (number(&exact["wavelength_um"]), number(&exact["f_number"]));
        let circle = PupilCurve::circle([0.0; 2], 0.5 / f_number);
        let pupil = PupilFunction::uniform(vec![circle], um, |_| 0.0).unwrap();
        let [light, far] = [5, 8].map(|order| pupil.samples(order));
        let unit = um * 1e-3 * f_number;
        for point in exact["points"].as_array().unwrap() {
            let r = number(&point["r_over_lambdaN"]) * unit;
            let value = far.intensity([0.6 * r, -0.8 * r]);
            assert!((value - number(&point["intensity"])).abs() < 1e-10, "{point}");
            if r < NEAR * unit {
                let share = light.encircled([0.0; 2], &[0.5 * r, r])[1];
                assert!((share - number(&point["encircled"])).abs() < 1e-7, "{share} {point}");
            }
        }
        for otf in exact["otf"].as_array().unwrap() {
            let nu = number(&otf["frequency"]);
            let got = pupil.transfer([0.8 * nu, 0.6 * nu], 0.0, 1e-11);
            assert!((got.re - number(&otf["value"])).abs() < 1e-9, "{got:?} {otf}");
        }
        let cutoff = number(&exact["cutoff_per_mm"]);
        assert_eq!(pupil.transfer([cutoff, 0.0], 0.0, 1e-9).modulus.value, 0.0);
        assert_eq!(pupil.transfer([0.0; 2], 0.0, 1e-9).modulus.value, 1.0);
        // A sliver: 16/(3 pi sqrt 2) * ((1 - s))^1.5 of the whole just below the cutoff.
        let rest: f64 = 1e-4;
        let got = pupil.transfer([cutoff * (1.0 - rest), 0.0], 0.0, 1e-14);
        let sliver = 8.0 * 2f64.sqrt() / (3.0 * PI) * rest.powf(1.5);
        assert!((got.re / sliver - 1.0).abs() < 1e-3, "{got:?} {sliver:e}");
    }
}

#[test]
fn a_ring_has_a_shadow() {
    for exact in read("images.json")["annular"].as_array().unwrap() {
        let inner = number(&exact["obscuration"]);
        let curves = [1.0, inner].map(|part| PupilCurve::circle([0.0; 2], 0.25 * part));
        let pupil = PupilFunction::ring(&curves, 0.5, |_| 0.0).unwrap();
        let [light, far] = [5, 8].map(|order| pupil.samples(order));
        let unit = 0.5e-3 * 2.0;
        for point in exact["points"].as_array().unwrap() {
            let r = number(&point["r_over_lambdaN"]) * unit;
            let value = far.intensity([r, 0.0]);
            assert!((value - number(&point["intensity"])).abs() < 1e-10, "{value} {point}");
            if r < NEAR * unit {
                let share = light.encircled([0.0; 2], &[r])[0];
                assert!((share - number(&point["encircled"])).abs() < 1e-7, "{share} {point}");
            }
        }
        for otf in exact["otf"].as_array().unwrap() {
            let nu = number(&otf["fraction_of_cutoff"]) / unit;
            let got = pupil.transfer([0.0, nu], 0.0, 1e-11);
            assert!((got.re - number(&otf["value"])).abs() < 1e-9, "{got:?} {otf}");
        }
    }
}

#[test]
fn defocus_reverses_contrast() {
    for exact in read("images.json")["defocus_otf"].as_array().unwrap() {
        let w20 = number(&exact["w20_waves"]);
        let (pupil, unit) = disc(|[x, y]| w20 * (x * x + y * y));
        for otf in exact["otf"].as_array().unwrap() {
            let nu = number(&otf["fraction_of_cutoff"]) / unit;
            let got = pupil.transfer([nu, 0.0], 0.0, 1e-11);
            assert!((got.re - number(&otf["value"])).abs() < 1e-9, "{got:?} {otf}");
            assert!(got.im.abs() < 1e-9);
        }
    }
}

#[test]
fn aberrated_discs() {
    for exact in read("images.json")["aberrated_disc"].as_array().unwrap() {
        let seidel = |name: &str| exact["seidel_waves"][name].as_f64().unwrap_or(0.0);
        let indices = ZernikeOrder::Noll.indices(40);
        let terms: Vec<(ZernikeIndex, f64)> = exact["noll_waves"]
            .as_object()
            .unwrap()
            .iter()
            .map(|(j, c)| (indices[j.parse::<usize>().unwrap() - 1], number(c)))
            .collect();
        let waves = |p: [f64; 2]| {
            let (x, y) = (p[0], p[1]);
            let square = x * x + y * y;
            let sum: f64 = terms.iter().map(|(z, c)| c * z.value(p)).sum();
            sum + seidel("W040") * square * square
                + seidel("W131") * square * y
                + seidel("W222") * y * y
                + seidel("W020") * square
                + seidel("W111") * y
        };
        let (pupil, unit) = disc(waves);
        let light = pupil.samples(8);
        for point in exact["psf"].as_array().unwrap() {
            let at = ["x_over_lambdaN", "y_over_lambdaN"].map(|key| number(&point[key]) * unit);
            let got = light.intensity(at);
            assert!((got - number(&point["value"])).abs() < 1e-9, "{got} {point}");
        }
        for otf in exact["otf"].as_array().unwrap() {
            let nu = ["fx_over_cutoff", "fy_over_cutoff"].map(|key| number(&otf[key]) / unit);
            let got = pupil.transfer(nu, 0.0, 1e-11);
            let off = (got.re - number(&otf["re"])).hypot(got.im - number(&otf["im"]));
            assert!(off < 1e-9, "{got:?} {otf}");
        }
    }
}

#[test]
fn pupils_of_other_shapes() {
    for exact in read("images.json")["other_pupils"].as_array().unwrap() {
        let um = number(&exact["wavelength_um"]);
        let pupil = PupilFunction::uniform(curves(exact), um, |_| 0.0).unwrap();
        let light = pupil.samples(5);
        for point in exact["psf"].as_array().unwrap() {
            let got = light.intensity([number(&point["x"]), number(&point["y"])]);
            assert!((got - number(&point["value"])).abs() < 1e-9, "{got} {point}");
        }
        for otf in exact["otf"].as_array().unwrap() {
            let nu = [number(&otf["nx"]), number(&otf["ny"])];
            let got = pupil.transfer(nu, 0.0, 1e-11);
            assert!((got.re - number(&otf["value"])).abs() < 1e-9, "{got:?} {otf}");
        }
    }
}

fn curves(exact: &Value) -> Vec<PupilCurve> {
    match exact["kind"].as_str().unwrap() {
        "discs" => {
            let discs = exact["discs"].as_array().unwrap().iter().map(numbers);
            discs.map(|d| PupilCurve::circle([d[0], d[1]], d[2])).collect()
        }
        "polygon" => {
            let (sides, radius) = (number(&exact["sides"]), number(&exact["circumradius"]));
            let first = number(&exact["first_vertex_deg"]).to_radians();
            let corner = |i: usize| {
                let (sin, cos) = (first + 2.0 * PI * i as f64 / sides).sin_cos();
                [radius * cos, radius * sin]
            };
            vec![PupilCurve::polygon(&(0..sides as usize).map(corner).collect::<Vec<_>>())]
        }
        // Two arcs from corner to corner.
        _ => {
            let radius = number(&exact["disc_radius"]);
            let up = numbers(&exact["centres"][0])[1];
            let half = (up / radius).acos();
            let arc = |sign: f64| {
                let point = |j: usize| {
                    let t = (0.5 * PI * j as f64 / 39.0).sin().powi(2);
                    let azimuth = half * (2.0 * t - 1.0);
                    let (sin, cos) = azimuth.sin_cos();
                    [sign * radius * sin, sign * (radius * cos - up)]
                };
                ((0..40).map(point).collect::<Vec<_>>(), true)
            };
            vec![PupilCurve::from_arcs(&[arc(1.0), arc(-1.0)])]
        }
    }
}

#[test]
fn a_folded_pupil_is_refused_by_name() {
    let lens = image_lenses().into_iter().find(|l| l.id() == "phone_us7558005_1").unwrap();
    let (_, model, field) = lens.fields().pop().unwrap();
    let accuracy = Accuracy::default();
    let got = diffraction_mtf(&model, field, lens.primary(), &[10.0], accuracy);
    assert_eq!(got.map(|_| ()), Err(AnalysisError::FoldedPupil));
    let got = point_spread(&model, field, lens.primary(), &[[0.0; 2]], accuracy);
    assert_eq!(got.map(|_| ()), Err(AnalysisError::FoldedPupil));
}

#[test]
fn the_gate_computes_what_the_bound_leaves_open() {
    // The achromat at f/4.4 on the axis: 0.728 by diffraction and 0.851 by rays at 50/mm.
    let lens = image_lenses().into_iter().next().unwrap();
    let (_, model, field) = lens.fields().remove(0);
    let gate = diffraction_gate(&model, field, lens.primary(), 50.0, 0.01).unwrap();
    assert!(gate.on && gate.bound > 0.01, "{gate:?}");
    let change = gate.change.unwrap();
    assert!((change.value - 0.123).abs() < 0.01, "{gate:?}");
    assert!(change.value <= gate.bound);
    let off = diffraction_gate(&model, field, lens.primary(), 1.0, 0.01).unwrap();
    assert!(!off.on && off.change.is_none(), "{off:?}");
}

#[test]
fn focus_and_the_best_strehl_need_no_new_rays() {
    let lens = image_lenses().into_iter().next().unwrap();
    let (_, model, field) = lens.fields().remove(0);
    let w = lens.primary();
    let accuracy = Accuracy { tolerance: 1e-7, ..ACCURACY };
    let found = strehl(&model, field, w, accuracy).unwrap();
    assert!((found.at_chief.value - 0.679_820_067).abs() < 1e-6, "{found:?}");
    assert!(found.best.value > 0.8 && found.best_at[2].abs() > 0.01, "{found:?}");
    let moved = {
        let mut model = model.clone();
        for channel in &mut model.channels {
            let last = channel.system.surfaces.len() - 2;
            channel.system.surfaces[last].thickness += found.best_at[2];
        }
        let systems = model.channels.iter().map(|c| (c.um, c.weight, c.system.clone())).collect();
        let aiming = aplanat::pupil::Aiming::Paraxial;
        aplanat::pupil::RayModel::from_systems(systems, w, model.beam, aiming).unwrap()
    };
    let there = strehl(&moved, field, w, accuracy).unwrap();
    assert!((there.at_chief.value - found.best.value).abs() < 1e-5, "{there:?} {found:?}");
    let curve = through_focus_mtf(&model, field, w, 50.0, &[0.0, found.best_at[2]], accuracy);
    let [here, best] = curve.unwrap()[..] else { panic!() };
    let exact = diffraction_mtf(&moved, field, w, &[50.0], accuracy).unwrap().points[0];
    assert!((here.tangential.modulus.value - 0.728_003_7).abs() < 1e-6);
    let off = best.tangential.modulus.value - exact.tangential.modulus.value;
    assert!(off.abs() < 1e-4, "{off:e}");
    let rings = encircled_energy(&model, field, w, [0.0; 2], &[0.002, 0.05], Accuracy::default());
    let rings = rings.unwrap();
    assert!(rings[0].value < rings[1].value && rings[1].value < 1.0 && rings[1].value > 0.9);
}

/// The Bessel function of order one, by the midpoints of its integral, which is spectrally exact.
fn bessel_one(x: f64) -> f64 {
    let count = 400;
    let at = |i: i32| PI * (f64::from(i) + 0.5) / f64::from(count);
    (0..count).map(|i| (at(i) - x * at(i).sin()).cos()).sum::<f64>() / f64::from(count)
}

#[test]
fn the_energy_of_two_beams_within_a_circle_follows_their_fringes() {
    // |U|² = 2 + 2 cos(K·x), K = 2 pi (2 a) / lambda, whose integral over a circle of radius R about c
    // is 2 pi R² (1 + cos(K·c) 2 J1(K R) / (K R)).
    let (wavelength, a, energy) = (0.5e-3, 0.1, 3.0);
    let beams = PupilSamples {
        cosines: vec![[a, 0.0], [-a, 0.0]],
        points: Vec::new(),
        waves: vec![0.0; 2],
        amplitudes: vec![1.0; 2],
        energies: vec![energy; 2],
        mirrored: false,
        wavelength,
    };
    let fringe = 2.0 * PI * 2.0 * a / wavelength;
    for center in [[0.0, 0.0], [0.4e-3, 7e-3]] {
        let radii = [2e-4, 0.01, 0.03];
        let found = beams.encircled(center, &radii);
        for (radius, share) in radii.into_iter().zip(found) {
            let q = fringe * radius;
            let contrast = (fringe * center[0]).cos() * 2.0 * bessel_one(q) / q;
            let light = 2.0 * PI * radius * radius * (1.0 + contrast);
            let exact = light / (wavelength * wavelength * 2.0 * energy);
            assert!((share / exact - 1.0).abs() < 1e-9, "{center:?} {radius}: {share} {exact}");
        }
    }
}

#[test]
fn the_contrast_of_a_perfect_lens_is_the_overlap_of_two_discs() {
    // Of unit discs whose centres are 2 f apart, by strips across the line between them.
    for f in [0.0f64, 0.05, 0.3, 0.5, 0.9, 0.99] {
        let count = 4000;
        // x = cos t takes the square root's end away.
        let end = f.acos();
        let strip = |i: i32| (end * (f64::from(i) + 0.5) / f64::from(count)).sin().powi(2);
        let half: f64 = (0..count).map(strip).sum::<f64>() * end / f64::from(count);
        let found = perfect_contrast(f);
        assert!((found - 4.0 * half / PI).abs() < 1e-6, "{f}: {found} {half}");
        assert_eq!(perfect_contrast(-f), found);
    }
    assert_eq!([1.0, 1.5].map(perfect_contrast), [0.0; 2]);
}

#[test]
fn a_contrast_states_what_the_polynomials_leave_and_no_more() {
    // An even polynomial of low degree is its own fit.
    let (smooth, unit) = disc(|[x, y]| 0.2 * (x * x + y * y));
    let exact = smooth.transfer([0.3 / unit, 0.0], 0.0, 1e-9);
    assert!(exact.modulus.error < 1e-6, "{exact:?}");
    // A ridge is not: twice the ridge leaves twice as much.
    let error = |height: f64| {
        let (ridge, unit) = disc(|[x, _]| height * x.abs());
        ridge.transfer([0.3 / unit, 0.0], 0.0, 1e-6).modulus.error
    };
    let (one, two) = (error(0.02), error(0.04));
    assert!(one > 1e-5 && one < 0.1, "{one}");
    assert!((two / one - 2.0).abs() < 0.1, "{one} {two}");
}

#[test]
fn a_contrast_is_reached_when_its_errors_are_within_the_tolerance() {
    let (lens, mut unreached) = (&image_lenses()[0], 0);
    for (_, model, field) in lens.fields().into_iter().take(1) {
        for tolerance in [1e-2, 1e-14] {
            let accuracy = Accuracy { tolerance, ..ACCURACY };
            let curve = diffraction_mtf(&model, field, lens.primary(), &[10.0], accuracy).unwrap();
            let point = curve.points[0];
            let within = |value: &TransferValue| value.modulus.error <= tolerance;
            let all = within(&point.tangential) && within(&point.sagittal);
            assert_eq!(curve.reached, all, "{} {tolerance}: {point:?}", field.y);
            unreached += usize::from(!curve.reached);
        }
    }
    assert!(unreached > 0);
}

/// A field along x has no plane of symmetry that halves its pupil, and the contrast of the same field along y.
#[test]
fn contrast_does_not_depend_on_the_direction_of_the_field() {
    for (lens, degrees) in image_lenses().iter().take(3).zip([1.0, 10.0, 10.0]) {
        for clipped in [false, true] {
            let model = lens.model(clipped);
            let accuracy = Accuracy { tolerance: 1e-4, ..ACCURACY };
            let at = |x: f64, y: f64| {
                let field = FieldPoint { x, y, weight: 1.0 };
                diffraction_mtf(&model, field, lens.primary(), &[5.0, 30.0], accuracy).unwrap()
            };
            let (up, across) = (at(0.0, degrees), at(degrees, 0.0));
            for (up, across) in up.points.iter().zip(&across.points) {
                let pairs = [(up.tangential, across.sagittal), (up.sagittal, across.tangential)];
                for (a, b) in pairs {
                    let off = (a.re - b.re).hypot(a.im - b.im);
                    let error = a.modulus.error + b.modulus.error;
                    assert!(off <= error, "{} {clipped}: {a:?} {b:?}", lens.id());
                }
            }
        }
    }
}

/// The tangential and sagittal contrast of a field: at 0 it is 1, beyond the cutoff 0, both exactly, and a chart of
/// many frequencies has the values of each alone.
#[test]
fn contrast_begins_at_one_ends_at_zero_and_is_that_of_each_frequency_alone() {
    let lens = &image_lenses()[0];
    let (_, model, field) = lens.fields().remove(1);
    let cutoff = 1e3 / (0.48 * 4.0);
    let nu: Vec<f64> = (0..12).map(|i| 9.5 * f64::from(i)).chain([3.7, 2.0 * cutoff]).collect();
    let accuracy = Accuracy { tolerance: 1e-4, ..ACCURACY };
    let waves = diffraction_mtf(&model, field, lens.primary(), &nu, accuracy).unwrap();
    let rays = geometric_mtf(&model, field, lens.primary(), &nu, accuracy).unwrap();
    for curve in [&waves, &rays] {
        for value in [curve.points[0].tangential, curve.points[0].sagittal] {
            assert_eq!([value.re, value.im, value.modulus.value], [1.0, 0.0, 1.0]);
        }
    }
    let last = &waves.points[13];
    assert_eq!([last.tangential.modulus.value, last.sagittal.modulus.value], [0.0; 2]);
    for (i, nu) in nu.iter().enumerate() {
        let alone = diffraction_mtf(&model, field, lens.primary(), &[*nu], accuracy).unwrap();
        let traced = geometric_mtf(&model, field, lens.primary(), &[*nu], accuracy).unwrap();
        for (all, one) in [(&waves, &alone), (&rays, &traced)] {
            let (a, b) = (all.points[i].tangential, one.points[0].tangential);
            let error = a.modulus.error + b.modulus.error;
            assert!((a.re - b.re).hypot(a.im - b.im) <= error, "{nu}: {a:?} {b:?}");
        }
    }
}

/// Where the reference sphere leaves more than the tolerance, a curve says so, and tighter tolerances add no work.
#[test]
fn a_contrast_says_what_limits_it() {
    let lens = image_lenses().into_iter().find(|l| l.id() == "double_gauss_rudolph_50").unwrap();
    let field = FieldPoint { x: 0.0, y: 24.0, weight: 1.0 };
    let model = lens.model(true);
    let [coarse, fine] = [1e-4, 2e-5].map(|tolerance| {
        let accuracy = Accuracy { tolerance, ..ACCURACY };
        diffraction_mtf(&model, field, lens.primary(), &[5.0, 20.0], accuracy).unwrap()
    });
    assert!(matches!(fine.limit, Some(ContrastLimit::Sphere(left)) if left > 1e-3), "{fine:?}");
    assert_eq!((coarse.reached, coarse.points, coarse.rays), (false, fine.points, fine.rays));
    let (_, model, field) = image_lenses()[0].fields().remove(0);
    let found = diffraction_mtf(&model, field, 0, &[5.0], Accuracy::default()).unwrap();
    assert!(found.reached && found.limit.is_none(), "{found:?}");
}
