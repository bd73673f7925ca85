//! Point spread, contrast and Zernike sums by diffraction.

use crate::images::{ACCURACY, image_lens, image_lenses};
use crate::pictures::bundled;
use crate::reference::{Worst, number};
use aplanat::analysis::{
    AnalysisError, PupilCurve, PupilFunction, PupilSamples, TransferValue, ZernikeOrder,
    diffraction_gate, diffraction_mtf, encircled_energy, geometric_mtf, perfect_contrast,
    point_spread, polychromatic_diffraction_mtf, strehl, through_focus_mtf,
};
use aplanat::lens::FieldPoint;
use aplanat::measure::ImageLens;
use aplanat::pupil::{Accuracy, RayModel};
use std::f64::consts::PI;

/// Notes contrasts of a lens at a tolerance as shares of the errors that they state for the computation, and the
/// largest of these errors.
fn contrast(lens: &ImageLens<'_>, tolerance: f64) -> (Worst, f64) {
    let accuracy = Accuracy { tolerance, ..ACCURACY };
    let (mut worst, mut stated) = (Worst::default(), 0.0f64);
    for (exact, model, field) in lens.fields().unwrap() {
        for (list, poly) in [(&exact.value["mtf"], false), (&exact.value["poly"]["mtf"], true)] {
            for exact in list.as_array().into_iter().flatten() {
                let nu = [number(&exact["frequency"])];
                let curve = if poly {
                    polychromatic_diffraction_mtf(&model, field, &nu, accuracy)
                } else {
                    diffraction_mtf(&model, field, lens.primary(), &nu, accuracy)
                };
                let curve = curve.unwrap();
                assert!(curve.reached, "{} {} {nu:?} {curve:?}", lens.id(), field.y);
                let point = curve.points[0];
                let tangential = exact["lines"] == "tangential";
                let got = if tangential { point.tangential } else { point.sagittal };
                let place = format!("{} {nu:?} {got:?}", field.y);
                let error = got.numerical_error() + ROUNDING;
                stated = stated.max(error);
                worst.note(got.modulus.value, number(&exact["diffraction"]), error, &place);
                if !poly {
                    worst.note(got.re, number(&exact["re"]), error, &place);
                    worst.note(got.im, number(&exact["im"]), error, &place);
                }
            }
        }
    }
    (worst, stated)
}

/// The rounding of paths of some 1e5 waves, as a part of a contrast.
const ROUNDING: f64 = 2e-11;

/// Every contrast of the file lies within the error that is stated for its computation, at any tolerance, and every
/// tolerance is reached: what the choice of the sphere leaves is no error of a number on this sphere.
#[test]
fn contrast_of_lenses_is_within_its_stated_error() {
    for tolerance in [1e-2, 1e-3, 1e-4] {
        let mut compared = 0;
        for lens in image_lenses() {
            let (worst, stated) = contrast(&lens, tolerance);
            assert!(stated <= tolerance, "{} {stated:e}", lens.id());
            let what = format!("contrast {} to {tolerance:e}, stated {stated:.1e}", lens.id());
            compared += worst.check(&what, 1.0);
        }
        assert_eq!(compared, 87);
    }
}

/// So it is for lenses with large aberrations, against a much tighter tolerance: a singlet, a lens of f/1.2 and one
/// with strong aspheres.
#[test]
fn contrast_of_strong_aberrations_is_within_its_stated_error() {
    let nu = [4.0, 10.0, 25.0, 50.0];
    for name in ["singlet_la1131", "double_gauss_canon_fd50_f12", "phone_us7558005_1"] {
        let model = RayModel::from_lens(&bundled(name), 0).unwrap();
        for share in [0.0, 0.7] {
            let field = FieldPoint { x: 0.0, y: share * model.beam.edge, weight: 1.0 };
            let at = |tolerance: f64| {
                let accuracy = Accuracy { tolerance, ..ACCURACY };
                diffraction_mtf(&model, field, model.primary, &nu, accuracy).unwrap()
            };
            let exact = at(2e-5);
            for tolerance in [1e-2, 1e-3, 1e-4] {
                let found = at(tolerance);
                let (mut worst, mut stated) = (Worst::default(), 0.0f64);
                let pairs = found.points.iter().zip(&exact.points).flat_map(|(found, exact)| {
                    [(found.tangential, exact.tangential), (found.sagittal, exact.sagittal)]
                });
                for (a, b) in pairs {
                    let error = a.numerical_error() + b.numerical_error();
                    stated = stated.max(a.numerical_error());
                    let off = (a.re - b.re).hypot(a.im - b.im);
                    worst.note(off, 0.0, error, format!("{a:?}"));
                }
                assert_eq!(found.reached, stated <= tolerance, "{name} {share} {stated:e}");
                let sphere = found.sphere;
                let what =
                    format!("{name} {share} to {tolerance:e}, stated {stated:.1e}, {sphere:.1e}");
                worst.check(&what, 1.0);
            }
        }
    }
}

#[test]
fn diffraction_contrast_is_spectrally_accurate() {
    let (worst, stated) = contrast(&image_lenses()[0], 1e-10);
    assert!(stated <= 1e-10, "{stated:e}");
    assert!(worst.check("contrast to 1e-10", 1.0) > 15);
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

#[test]
fn contrast_ends_at_the_cutoff_of_a_round_pupil() {
    let (pupil, unit) = disc(|_| 0.0);
    let cutoff = unit.recip();
    assert_eq!(pupil.transfer([cutoff, 0.0], 0.0, 1e-9).modulus.value, 0.0);
    assert_eq!(pupil.transfer([0.0; 2], 0.0, 1e-9).modulus.value, 1.0);
    // A sliver: 16/(3 pi sqrt 2) * ((1 - s))^1.5 of the whole just below the cutoff.
    let rest: f64 = 1e-4;
    let got = pupil.transfer([cutoff * (1.0 - rest), 0.0], 0.0, 1e-14);
    let sliver = 8.0 * 2f64.sqrt() / (3.0 * PI) * rest.powf(1.5);
    assert!((got.re / sliver - 1.0).abs() < 1e-3, "{got:?} {sliver:e}");
}

#[test]
fn a_folded_pupil_is_refused_by_name() {
    let lens = image_lens("phone_us7558005_1");
    let (_, model, field) = lens.fields().unwrap().pop().unwrap();
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
    let (_, model, field) = lens.fields().unwrap().remove(0);
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
    let (_, model, field) = lens.fields().unwrap().remove(0);
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
        RayModel::from_systems(systems, w, model.beam, aiming).unwrap()
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
    for (_, model, field) in lens.fields().unwrap().into_iter().take(1) {
        for tolerance in [1e-2, 1e-14] {
            let accuracy = Accuracy { tolerance, ..ACCURACY };
            let curve = diffraction_mtf(&model, field, lens.primary(), &[10.0], accuracy).unwrap();
            let point = curve.points[0];
            let within = |value: &TransferValue| value.numerical_error() <= tolerance;
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
            let model = lens.model(clipped).unwrap();
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
    let (_, model, field) = lens.fields().unwrap().remove(1);
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

/// What the choice of the reference sphere leaves is told apart from the errors of the computation, which reach
/// their tolerance; the error of a value has both.
#[test]
fn a_contrast_tells_what_the_sphere_leaves() {
    let field = FieldPoint { x: 0.0, y: 24.0, weight: 1.0 };
    let lens = image_lens("double_gauss_rudolph_50");
    let model = lens.model(true).unwrap();
    let [coarse, fine] = [1e-4, 2e-5].map(|tolerance| {
        let accuracy = Accuracy { tolerance, ..ACCURACY };
        diffraction_mtf(&model, field, lens.primary(), &[5.0, 20.0], accuracy).unwrap()
    });
    assert!(coarse.reached && fine.reached && fine.limit.is_none(), "{fine:?}");
    assert!(coarse.sphere > 1e-3 && (coarse.sphere / fine.sphere - 1.0).abs() < 0.2, "{coarse:?}");
    for (coarse, fine) in coarse.points.iter().zip(&fine.points) {
        let [a, b] = [coarse, fine].map(|point| point.tangential);
        let off = (a.re - b.re).hypot(a.im - b.im);
        assert!(off <= a.numerical_error() + b.numerical_error(), "{a:?} {b:?}");
        assert!(a.modulus.error >= a.sphere && b.numerical_error() <= 2e-5, "{a:?} {b:?}");
    }
    let (_, model, field) = image_lenses()[0].fields().unwrap().remove(0);
    let found = diffraction_mtf(&model, field, 0, &[5.0], Accuracy::default()).unwrap();
    assert!(found.reached && found.limit.is_none() && found.sphere == 0.0, "{found:?}");
}
