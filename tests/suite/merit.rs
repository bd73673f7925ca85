//! Derivatives of every term by every kind of variable, against central differences.

use aplanat::analysis::{strehl, wavefront};
use aplanat::files;
use aplanat::lens::{
    Aperture, FieldKind, FieldPoint, Lens, Medium, Object, Parameter, Pickup, Quantity, Row,
    ToleranceGrade, Variable,
};
use aplanat::merit::{DerivativeLevel, Goal, LimitTreatment, Merit, PupilEdge, Term, WeightedTerm};
use aplanat::pupil::{Accuracy, RayModel};

pub(crate) fn bundled(name: &str) -> Lens {
    files::open(format!("lenses/{name}.json")).unwrap().lens
}

pub(crate) fn vary(lens: &mut Lens, surface: usize, quantity: Quantity) {
    vary_at(lens, Parameter::new(surface, quantity));
}

/// Makes a number a variable without bounds.
pub(crate) fn vary_at(lens: &mut Lens, parameter: Parameter) {
    lens.variables.push(Variable { parameter, min: None, max: None });
}

/// A double Gauss in which every kind of number varies: an asphere, a conic, a model glass, a
/// pickup, a solved last gap.
fn everything() -> Lens {
    let mut lens = bundled("double_gauss_rudolph_50");
    lens.variables.clear();
    lens.surfaces[2].conic = -0.3;
    lens.surfaces[9].asphere = vec![1e-6, -2e-9];
    lens.surfaces[0].medium = Medium::Model { nd: 1.5725, vd: 57.5 };
    lens.image_solve = Some(0.1);
    for surface in [0, 1, 4, 6] {
        vary(&mut lens, surface, Quantity::Curvature);
    }
    vary(&mut lens, 2, Quantity::Conic);
    vary(&mut lens, 7, Quantity::Conic);
    vary(&mut lens, 9, Quantity::Asphere(0));
    vary(&mut lens, 9, Quantity::Asphere(3));
    vary(&mut lens, 0, Quantity::Index);
    for surface in [0, 4, 5] {
        vary(&mut lens, surface, Quantity::Thickness);
    }
    lens.pickups.push(Pickup {
        parameter: Parameter::new(10, Quantity::Curvature),
        source: Parameter::new(0, Quantity::Curvature),
        scale: -1.0,
        offset: 0.0,
    });
    lens
}

fn terms() -> Vec<Term> {
    vec![
        Term::Spot,
        Term::AsBuilt { grade: Some(ToleranceGrade::Commercial) },
        Term::Wavefront,
        Term::GeometricMtf { frequency: 5.0, min: 1.0 },
        Term::FocalLength(60.0),
        Term::Distortion,
        Term::GlassCenter { min: 1.5, max: 2.0 },
        Term::GlassEdge(3.0),
        Term::AirCenter { min: 0.5, max: 1.0 },
        Term::AirEdge(4.0),
        Term::TotalTrack(20.0),
        Term::BackFocus(90.0),
    ]
}

pub(crate) fn check(lens: &Lens, term: Term, pupil: PupilEdge, steps: impl Fn(Quantity) -> f64) {
    check_term(lens, WeightedTerm::new(term, 1.0), pupil, steps);
}

pub(crate) fn check_term(
    lens: &Lens,
    weighted: WeightedTerm,
    pupil: PupilEdge,
    steps: impl Fn(Quantity) -> f64,
) {
    let term = weighted.term;
    let goal = Goal {
        terms: vec![weighted],
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
        pupil,
    };
    // The motion of the edge is exact in the limit of many rays only.
    let tolerance = if pupil == PupilEdge::Moving { 1e-11 } else { 1e-4 };
    let merit = Merit::new(lens, &goal, tolerance).unwrap();
    let values = merit.values(lens);
    let sum = merit.evaluate(&values, DerivativeLevel::Gradient).unwrap();
    let normal = merit.evaluate(&values, DerivativeLevel::Normal).unwrap();
    let mut worst: f64 = 0.0;
    for (i, variable) in merit.variables().iter().enumerate() {
        let step = steps(variable.parameter.quantity);
        let at = |offset: f64| {
            let mut moved = values.clone();
            moved[i] += offset * step;
            merit.value(&moved).unwrap()
        };
        let difference = (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * step);
        let scale = sum.gradient.amax() * 1e-9 + 1e-9 * sum.value / step;
        let error = (sum.gradient[i] - difference).abs();
        let relative = error / (difference.abs() + scale);
        worst = worst.max(relative);
        let name = variable.parameter.to_string();
        assert!(relative < 2e-6, "{} by {name}: {} and {difference}", term.name(), sum.gradient[i]);
        let same = (sum.gradient[i] - normal.gradient[i]).abs();
        assert!(
            same <= 1e-9 * sum.gradient.amax(),
            "{} by {name}: backwards and by rows",
            term.name()
        );
    }
    println!("{}: gradient against differences, worst {worst:.1e}", term.name());
}

pub(crate) fn step(quantity: Quantity) -> f64 {
    match quantity {
        Quantity::Curvature => 2e-5,
        Quantity::Asphere(term) => 1e-6 * 0.03_f64.powi(2 * term as i32),
        Quantity::Conic | Quantity::Thickness | Quantity::SemiDiameter => 1e-2,
        Quantity::Index | Quantity::Grin(_) | Quantity::Freeform(_) => 1e-4,
    }
}

/// A factor of the steps by which a term may be told from a polynomial: contrast oscillates.
fn smoothness(term: Term) -> f64 {
    if matches!(term, Term::GeometricMtf { .. }) { 0.1 } else { 1.0 }
}

#[test]
fn every_term_has_the_derivative_of_its_value() {
    let lens = everything();
    for term in terms() {
        check(&lens, term, PupilEdge::Frozen, |quantity| smoothness(term) * step(quantity));
    }
}

#[test]
fn every_term_includes_the_motion_of_the_pupil() {
    for (first, name) in ["double_gauss_rudolph_50", "double_gauss_nikkor_s_50"].iter().enumerate()
    {
        let name = *name;
        let mut lens = bundled(name);
        lens.variables.clear();
        if name == "double_gauss_nikkor_s_50" {
            // The first lens has the weights of colours.
            lens.wavelengths = vec![lens.wavelengths[lens.primary()]];
        } else {
            lens.wavelengths.truncate(2);
        }
        for surface in 0..lens.surfaces.len() {
            // Equal rims would make the larger of two a number with two slopes.
            let rim = Parameter::new(surface, Quantity::SemiDiameter);
            let size = lens.get(rim).unwrap();
            lens.set(rim, size * (1.0 + 1e-3 * surface as f64));
        }
        // Every other surface, in front of the stop and behind it.
        for surface in (first..lens.surfaces.len()).step_by(2) {
            for quantity in [Quantity::Curvature, Quantity::Thickness, Quantity::SemiDiameter] {
                vary(&mut lens, surface, quantity);
            }
        }
        let moving = [
            Term::Spot,
            Term::Wavefront,
            Term::GlassEdge(3.0),
            Term::SpotIntegral,
            Term::Throughput,
            Term::ThroughputLoss(200.0),
            Term::RelativeIllumination { field: 1, min: 2.0 },
            Term::FNumber(3.0),
            Term::Light(1.01),
            Term::MeanLight(1.02),
            Term::Steepness(0.1),
            Term::SemiDiameter { min: 5.0, max: 6.0 },
        ];
        for term in moving {
            check(&lens, term, PupilEdge::Moving, |quantity| match (term, quantity) {
                // Rounding of paths of 1e5 waves asks for larger steps, which rims side by side do not bear.
                (Term::Wavefront, Quantity::Curvature) => 0.5 * step(quantity),
                (Term::Wavefront, _) => 0.1 * step(quantity),
                _ => 0.02 * step(quantity),
            });
        }
    }
}

/// Contrast oscillates over the pupil, and takes many more rays than the other terms.
#[test]
fn contrast_includes_the_motion_of_the_pupil() {
    let mut lens = bundled("double_gauss_rudolph_50");
    lens.wavelengths = vec![lens.wavelengths[lens.primary()]];
    lens.fields.values.remove(1);
    lens.variables.clear();
    vary(&mut lens, 0, Quantity::Curvature);
    for surface in [0, 5] {
        let rim = Parameter::new(surface, Quantity::SemiDiameter);
        lens.set(rim, lens.get(rim).unwrap() * (1.0 + 1e-3 * surface as f64));
        vary(&mut lens, surface, Quantity::SemiDiameter);
    }
    let term = Term::GeometricMtf { frequency: 2.0, min: 1.0 };
    check(&lens, term, PupilEdge::Moving, |quantity| 0.02 * step(quantity));
}

/// An aperture that is a pupil, a cone or a focal ratio fills a stop that changes with the lens.
#[test]
fn derivatives_include_the_stop_that_a_beam_fills() {
    let distant = |aperture| Lens { aperture, ..bundled("cooke_triplet_100_f27") };
    let mut near = distant(Aperture::ObjectNa(0.05));
    near.object = Object::Finite(200.0);
    near.fields.kind = FieldKind::ObjectHeight;
    let lenses =
        [distant(Aperture::FNumber(4.0)), distant(Aperture::EntrancePupilDiameter(20.0)), near];
    for mut lens in lenses {
        lens.variables.clear();
        // The first lens has the weights of colours.
        if matches!(lens.aperture, Aperture::FNumber(_)) {
            lens.wavelengths.truncate(2);
        } else {
            lens.wavelengths = vec![lens.wavelengths[lens.primary()]];
        }
        for surface in 0..lens.surfaces.len() {
            vary(&mut lens, surface, Quantity::Curvature);
            vary(&mut lens, surface, Quantity::Thickness);
        }
        let as_built = Term::AsBuilt { grade: Some(ToleranceGrade::Commercial) };
        for term in [Term::Spot, as_built, Term::Wavefront, Term::Throughput, Term::Light(1.01)] {
            // Rounding of paths of 1e5 waves asks for larger steps.
            let share = if term == Term::Wavefront { 0.1 } else { 0.02 };
            check(&lens, term, PupilEdge::Moving, |quantity| share * step(quantity));
        }
    }
}

/// A stop that is filled in part does not clip by its own rim, and the rims beside it clip by theirs.
#[test]
fn derivatives_include_the_rims_beside_a_stop_that_a_beam_fills() {
    let mut lens = Lens { aperture: Aperture::FNumber(4.0), ..bundled("cooke_triplet_100_f27") };
    let stop = lens.stop().unwrap();
    lens.variables.clear();
    lens.surfaces[0].semi_diameter = Some(11.0);
    for surface in [0, stop] {
        vary(&mut lens, surface, Quantity::SemiDiameter);
    }
    for term in [Term::Spot, Term::Throughput] {
        check(&lens, term, PupilEdge::Moving, |quantity| 0.02 * step(quantity));
    }
    let merit = Merit::new(&lens, &goal_of(Term::Throughput), 1e-6).unwrap();
    let slopes = merit.evaluate(&merit.values(&lens), DerivativeLevel::Gradient).unwrap().gradient;
    assert!(merit.has_light() && slopes[0] < 0.0 && slopes[1] == 0.0, "{slopes}");
}

/// A lens whose fields off the axis end at its last rim.
fn half_dark() -> Lens {
    let mut lens = bundled("double_gauss_rudolph_50");
    lens.variables.clear();
    lens.surfaces[10].semi_diameter = Some(0.5);
    for surface in 0..lens.surfaces.len() {
        for quantity in [Quantity::Curvature, Quantity::Thickness, Quantity::SemiDiameter] {
            vary(&mut lens, surface, quantity);
        }
    }
    lens
}

#[test]
fn pupils_without_light_have_a_derivative_towards_light() {
    let lens = half_dark();
    let terms =
        [Term::Throughput, Term::ThroughputLoss(200.0), Term::Light(0.8), Term::MeanLight(1.2)];
    for term in terms {
        check(&lens, term, PupilEdge::Moving, |quantity| 0.02 * step(quantity));
    }
    let goal = Goal {
        terms: vec![WeightedTerm::new(Term::Throughput, 1.0)],
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
        pupil: PupilEdge::Moving,
    };
    let merit = Merit::new(&lens, &goal, 1e-3).unwrap();
    assert!(!merit.has_light());
    let gradient =
        merit.evaluate(&merit.values(&lens), DerivativeLevel::Gradient).unwrap().gradient;
    let by_rims = merit.variables().iter().zip(gradient.iter());
    let by_rims = by_rims.filter(|(v, _)| v.parameter.quantity == Quantity::SemiDiameter);
    let steepest = by_rims.min_by(|a, b| a.1.total_cmp(b.1)).unwrap();
    assert_eq!(steepest.0.parameter.surface, 10);
    assert!(*steepest.1 < 0.0);
}

#[test]
fn a_pupil_in_pieces_has_the_derivative_of_the_warp_field() {
    // A ball lens focuses its zones far apart; a small rim behind lets a disc and a ring through.
    let row = |curvature, thickness, index, rim| Row {
        curvature,
        thickness,
        medium: if index == 1.0 { Medium::Air } else { Medium::Index(index) },
        semi_diameter: Some(rim),
        ..Row::default()
    };
    let mut lens = bundled("double_gauss_rudolph_50");
    lens.surfaces = vec![
        row(0.1, 18.0, 1.5, 9.9),
        row(-0.1, 2.0, 1.0, 9.9),
        Row { stop: true, ..row(0.0, 5.0, 1.0, 1.0) },
    ];
    lens.aperture = Aperture::StopSemiDiameter(1.0);
    lens.fields.values = vec![FieldPoint { x: 0.0, y: 0.0, weight: 1.0 }];
    lens.wavelengths.truncate(1);
    lens.wavelengths[0].primary = true;
    lens.variables.clear();
    vary(&mut lens, 0, Quantity::Curvature);
    vary(&mut lens, 2, Quantity::SemiDiameter);
    let goal = |pupil| Goal {
        terms: vec![WeightedTerm::new(Term::Throughput, 1.0)],
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
        pupil,
    };
    let gradient = |pupil| {
        let merit = Merit::new(&lens, &goal(pupil), 1e-3).unwrap();
        merit.evaluate(&merit.values(&lens), DerivativeLevel::Gradient).unwrap().gradient
    };
    let moving = gradient(PupilEdge::Moving);
    let area = |change: f64| {
        let mut lens = lens.clone();
        lens.surfaces[2].semi_diameter = Some(1.0 + change);
        lens.aperture = Aperture::StopSemiDiameter(1.0 + change);
        Merit::new(&lens, &goal(PupilEdge::Moving), 1e-4).unwrap().light()
    };
    // A smaller step meets the grid of rays that a ragged pupil is sampled by.
    let exact = -(area(0.01) - area(-0.01)) / 0.02;
    println!("by the rim: {} and {exact} by differences", moving[1]);
    assert!((moving[1] / exact - 1.0).abs() < 0.05);
    assert_eq!(gradient(PupilEdge::Frozen)[1], 0.0);
}

#[test]
fn a_zoom_lens_has_derivatives_by_its_moving_gaps() {
    let mut lens = bundled("zoom_nikkor_28_80");
    lens.variables.clear();
    for gap in lens.zoom[0].numbers.clone() {
        for zoom in 0..lens.zoom.len() {
            vary_at(&mut lens, Parameter::at_zoom(gap.surface, gap.quantity, zoom));
        }
    }
    vary(&mut lens, 3, Quantity::Curvature);
    let contrast = Term::GeometricMtf { frequency: 2.0, min: 1.0 };
    let terms =
        [Term::Spot, Term::Wavefront, contrast, Term::FocalLength(29.0), Term::TotalTrack(10.0)];
    for term in terms {
        check(&lens, term, PupilEdge::Frozen, |quantity| smoothness(term) * step(quantity));
    }
}

#[test]
fn the_gauss_newton_matrix_is_that_of_the_residuals() {
    // Near a solution the Hessian of a sum of squares is twice the Gauss-Newton matrix; a linear
    // residual is near one everywhere.
    let mut lens = bundled("achromat_ac254_100");
    lens.variables.clear();
    vary(&mut lens, 2, Quantity::Thickness);
    for term in [Term::Spot, Term::Wavefront] {
        let merit = Merit::new(&lens, &goal_of(term), 1e-4).unwrap();
        let values = merit.values(&lens);
        let slope = |t: f64| {
            let sum = merit.evaluate(&[values[0] + t], DerivativeLevel::Gradient);
            sum.unwrap().gradient[0]
        };
        let second = (slope(0.01) - slope(-0.01)) / 0.02;
        let normal = merit.evaluate(&values, DerivativeLevel::Normal).unwrap().normal[(0, 0)];
        let limit = if term == Term::Spot { 1e-6 } else { 1e-3 };
        assert!((second / (2.0 * normal) - 1.0).abs() < limit, "{second} and {normal}");
    }
}

/// A goal of one term with pupils that move.
fn goal_of(term: Term) -> Goal {
    Goal {
        terms: vec![WeightedTerm::new(term, 1.0)],
        zoom_ratios: Vec::new(),
        limits: LimitTreatment::default(),
        pupil: PupilEdge::default(),
    }
}

/// On the axis a tilt about y is one about x, turned by a right angle: a lens without a plane of symmetry has
/// spots about their own centroids.
#[test]
fn a_lens_without_symmetry_has_the_merit_of_the_same_lens_turned() {
    let tilted = |tilt: [f64; 2]| {
        let mut lens = achromat();
        lens.fields.values.truncate(1);
        lens.surfaces[0].tilt = tilt;
        lens.variables.clear();
        (0..3).for_each(|surface| vary(&mut lens, surface, Quantity::Curvature));
        lens
    };
    let contrast = Term::GeometricMtf { frequency: 10.0, min: 1.0 };
    for term in [Term::Spot, Term::SpotIntegral, Term::Wavefront, Term::Strehl, contrast] {
        let sum = |tilt| {
            let lens = tilted(tilt);
            let merit = Merit::new(&lens, &goal_of(term), 1e-4).unwrap();
            merit.evaluate(&merit.values(&lens), DerivativeLevel::Normal).unwrap()
        };
        let [about_x, about_y] = [sum([0.2, 0.0]), sum([0.0, 0.2])];
        assert!(about_x.value > 0.0, "{term:?}");
        assert!(
            (about_y.value / about_x.value - 1.0).abs() < 2e-3,
            "{term:?}: {about_x:?} {about_y:?}"
        );
        let off = (&about_y.gradient - &about_x.gradient).norm();
        assert!(off < 1e-2 * about_x.gradient.norm(), "{term:?}: {about_x:?} {about_y:?}");
        let off = (&about_y.normal - &about_x.normal).norm();
        assert!(off < 1e-2 * about_x.normal.norm(), "{term:?}: {about_x:?} {about_y:?}");
    }
}

/// A spherical mirror of radius 200 mm with a beam of semi-diameter 10 mm.
fn spherical_mirror() -> Lens {
    let mut lens = bundled("double_gauss_rudolph_50");
    lens.surfaces = vec![Row {
        curvature: -1.0 / 200.0,
        thickness: -100.0,
        medium: Medium::Mirror,
        stop: true,
        ..Row::default()
    }];
    lens.aperture = Aperture::EntrancePupilDiameter(20.0);
    lens.fields.values = vec![FieldPoint { x: 0.0, y: 0.0, weight: 1.0 }];
    lens.wavelengths.truncate(1);
    lens.wavelengths[0].primary = true;
    lens.variables.clear();
    vary(&mut lens, 0, Quantity::Thickness);
    lens
}

/// The wavefront of a spherical mirror is `r⁴/4R³` to the lowest order, and `2/(3√5)` of it, root
/// mean square, about its mean.
#[test]
fn the_wavefront_of_a_spherical_mirror_is_spherical_aberration() {
    let lens = spherical_mirror();
    let merit = Merit::new(&lens, &goal_of(Term::Wavefront), 1e-6).unwrap();
    let value = merit.value(&merit.values(&lens)).unwrap();
    let edge = 1e4 / (4.0 * 8e6) / (lens.wavelengths[0].um * 1e-3);
    let exact = 2.0 / (3.0 * 5.0_f64.sqrt()) * edge;
    assert!((value.sqrt() / exact - 1.0).abs() < 5e-3, "{} and {exact}", value.sqrt());
}

/// Off the axis the best image point removes the tilt, so that the wavefront is at most that about
/// the chief ray, and on the axis both are the same.
#[test]
fn the_wavefront_term_is_that_of_the_analysis_without_tilt() {
    let lens = bundled("heliar_100_f45");
    let model = RayModel::from_lens(&lens, 0).unwrap();
    for (number, field) in model.fields.iter().enumerate() {
        let mut one = lens.clone();
        one.fields.values = vec![*field];
        one.wavelengths = vec![lens.wavelengths[lens.primary()]];
        vary(&mut one, 0, Quantity::Curvature);
        let merit = Merit::new(&one, &goal_of(Term::Wavefront), 1e-6).unwrap();
        let free = merit.value(&merit.values(&one)).unwrap().sqrt();
        let accuracy = Accuracy { tolerance: 1e-6, ..Accuracy::default() };
        let about_chief = wavefront(&model, *field, model.primary, accuracy).unwrap().rms.value;
        let printed = wavefront(&model, *field, model.primary, accuracy).unwrap();
        let without_tilt = printed.rms_without_tilt.unwrap().value;
        assert!((free / without_tilt - 1.0).abs() < 1e-5, "{free} and {without_tilt}");
        if number == 0 {
            assert!((free / about_chief - 1.0).abs() < 1e-5, "{free} and {about_chief}");
        } else {
            assert!(free < about_chief && free > 0.1 * about_chief, "{free} and {about_chief}");
        }
    }
}

/// Defocus alone: the transfer of a uniform disc of radius `a` is `2 J₁(k a)/(k a)`, here at the
/// frequency where `k a = 1`.
#[test]
fn the_contrast_of_a_defocused_disc_is_that_of_bessel() {
    let mut lens = spherical_mirror();
    lens.surfaces[0].conic = -1.0;
    lens.surfaces[0].thickness = -99.0;
    // The rays of a paraboloid cross the plane 1 mm before its focus at r/f (1 + r²/4f²...).
    let radius = 10.0 / (100.0 - 100.0 / 400.0);
    let frequency = 1.0 / (std::f64::consts::TAU * radius);
    let merit = Merit::new(&lens, &goal_of(Term::GeometricMtf { frequency, min: 1.0 }), 1e-8);
    let merit = merit.unwrap();
    let value = merit.value(&merit.values(&lens)).unwrap();
    let bessel = 2.0 * 0.440_050_585_744_933_5;
    assert!((1.0 - value.sqrt() - bessel).abs() < 1e-3, "{} and {bessel}", 1.0 - value.sqrt());
}

/// A contrast that oscillates faster than the rays follow says so.
#[test]
fn a_contrast_says_if_its_rays_are_too_few() {
    let mut lens = bundled("cooke_triplet_100_f27");
    vary(&mut lens, 0, Quantity::Curvature);
    let reached = |frequency, tolerance| {
        let goal = goal_of(Term::GeometricMtf { frequency, min: 1.0 });
        let merit = Merit::new(&lens, &goal, tolerance).unwrap();
        merit.terms(&merit.values(&lens)).unwrap()[0].reached
    };
    assert!(reached(1.0, 1e-3));
    assert!(!reached(300.0, 1e-8));
}

#[test]
fn a_contrast_needs_a_frequency_and_a_reachable_minimum() {
    let lens = bundled("heliar_100_f45");
    for (frequency, min) in [(0.0, 0.5), (-3.0, 0.5), (10.0, 0.0), (10.0, 1.5), (f64::NAN, 0.5)] {
        let goal = goal_of(Term::GeometricMtf { frequency, min });
        let text = Merit::new(&lens, &goal, 1e-3).unwrap_err().to_string();
        assert!(text.contains("geometric_mtf"), "{text}");
    }
}

/// A contrast that is already above its minimum asks for nothing.
#[test]
fn a_contrast_above_its_minimum_has_no_merit() {
    let mut lens = bundled("heliar_100_f45");
    vary(&mut lens, 0, Quantity::Curvature);
    let goal = goal_of(Term::GeometricMtf { frequency: 0.01, min: 0.5 });
    let merit = Merit::new(&lens, &goal, 1e-3).unwrap();
    let sum = merit.evaluate(&merit.values(&lens), DerivativeLevel::Normal).unwrap();
    assert!(sum.value == 0.0 && sum.gradient.amax() == 0.0);
}

/// A rod is longer than its focal length: the default goal must not ask for another lens.
#[test]
fn the_default_goal_allows_the_glass_of_its_own_lens() {
    for bundled in files::bundled_lenses() {
        let lens = files::parse(bundled.text.as_bytes(), bundled.name).unwrap().lens;
        let goal = Goal::default_for(&lens).unwrap();
        let glass = |row: &&Row| !matches!(row.medium, Medium::Air | Medium::Mirror);
        let rows = lens.surfaces.iter().filter(glass);
        let thickest = rows.map(|row| row.thickness.abs()).fold(0.0, f64::max);
        let limits = goal.terms.iter().filter_map(|weighted| match weighted.term {
            Term::GlassCenter { max, .. } => Some(max),
            _ => None,
        });
        for max in limits {
            assert!(max >= thickest, "{}: {max} and {thickest}", bundled.name);
        }
    }
}

/// An achromat near the diffraction limit: steps of a hundredth of its Strehl ratio would be large.
fn achromat() -> Lens {
    let mut lens = bundled("achromat_ac254_100");
    lens.variables.clear();
    lens.fields.values = vec![
        FieldPoint { x: 0.0, y: 0.0, weight: 1.0 },
        FieldPoint { x: 0.0, y: 0.8, weight: 2.0 },
    ];
    for surface in 0..lens.surfaces.len() {
        for quantity in [Quantity::Curvature, Quantity::Thickness] {
            vary(&mut lens, surface, quantity);
        }
    }
    lens
}

#[test]
fn the_strehl_ratio_has_the_derivative_of_its_value() {
    let lens = achromat();
    check(&lens, Term::Strehl, PupilEdge::Frozen, |quantity| 0.002 * step(quantity));
}

#[test]
fn the_strehl_ratio_includes_the_motion_of_the_pupil() {
    let mut lens = achromat();
    for surface in 0..lens.surfaces.len() {
        let rim = Parameter::new(surface, Quantity::SemiDiameter);
        let size = lens.get(rim).unwrap_or(12.0);
        lens.set(rim, size * (1.0 + 1e-3 * surface as f64));
        vary(&mut lens, surface, Quantity::SemiDiameter);
    }
    // Rims change no path: with smaller steps there is the rounding of the paths alone.
    check(&lens, Term::Strehl, PupilEdge::Moving, |quantity| {
        let factor = if quantity == Quantity::SemiDiameter { 0.1 } else { 0.002 };
        factor * step(quantity)
    });
}

/// A paraboloid is perfect on its axis; w waves of defocus at the rim leave `(sin πw / πw)²`.
#[test]
fn the_strehl_ratio_of_a_defocused_mirror_is_that_of_the_books() {
    let loss = |defocus: f64| {
        let mut lens = spherical_mirror();
        lens.surfaces[0].conic = -1.0;
        lens.surfaces[0].thickness = -100.0 + defocus;
        let merit = Merit::new(&lens, &goal_of(Term::Strehl), 1e-8).unwrap();
        (merit.value(&merit.values(&lens)).unwrap(), lens.wavelengths[0].um * 1e-3)
    };
    assert!(loss(0.0).0.abs() < 1e-9, "{:?}", loss(0.0));
    // The sagitta of the wave at the rim: 1 − cos θ with tan(θ/2) = r/2f.
    let rim = 2.0 * 0.05_f64.powi(2) / (1.0 + 0.05_f64.powi(2));
    for defocus in [0.02, 0.05, 0.1] {
        let (found, wavelength) = loss(defocus);
        let phase = std::f64::consts::PI * defocus * rim / wavelength;
        let exact = 1.0 - (phase.sin() / phase).powi(2);
        assert!((found - exact).abs() < 2e-3 * exact, "{defocus}: {found} and {exact}");
    }
}

/// Energy in place of amplitude in cosines changes the ratio of this lens by less than a thousandth.
#[test]
fn the_strehl_ratio_is_that_of_the_diffraction_image() {
    let mut lens = bundled("achromat_ac254_100");
    lens.fields.values.truncate(1);
    lens.wavelengths = vec![lens.wavelengths[lens.primary()]];
    vary(&mut lens, 0, Quantity::Curvature);
    let model = RayModel::from_lens(&lens, 0).unwrap();
    let accuracy = Accuracy { tolerance: 1e-7, ..Accuracy::default() };
    let exact = strehl(&model, model.fields[0], 0, accuracy).unwrap().at_chief.value;
    let merit = Merit::new(&lens, &goal_of(Term::Strehl), 1e-8).unwrap();
    let found = 1.0 - merit.value(&merit.values(&lens)).unwrap();
    assert!((found - exact).abs() < 1e-3, "{found} and {exact}");
}

/// Rims close step by step, as an optimizer moves them, until limits end the pupils that did not at the start.
#[test]
fn pupils_that_are_followed_step_by_step_are_those_of_the_lens() {
    let mut lens = bundled("tessar_50_f28");
    lens.variables.clear();
    for surface in [0, 2, 7] {
        vary(&mut lens, surface, Quantity::SemiDiameter);
    }
    let merit = Merit::new(&lens, &goal_of(Term::Light(1.0)), 1e-2).unwrap();
    let mut followed = merit.clone();
    let at = |part: f64| -> Vec<f64> { merit.values(&lens).iter().map(|v| v * part).collect() };
    let mut forms = Vec::new();
    for step in 1..=8 {
        let values = at(1.0 - 0.02 * f64::from(step));
        let (there, pupils) =
            followed.evaluate_with_pupils(&values, DerivativeLevel::Gradient).unwrap();
        forms.push(pupils.clone());
        followed.follow_pupils(pupils);
        // From their own lens the pupils are tracked to themselves.
        let again = followed.evaluate(&values, DerivativeLevel::Gradient).unwrap();
        assert!((again.value / there.value - 1.0).abs() < 1e-9, "{step}");
        assert!((&again.gradient - &there.gradient).norm() < 1e-8 * there.gradient.norm());
        // Those of the start give the same, as far as the nodes resolve the pupils, and so do new ones.
        let far = merit.value(&values).unwrap();
        let mut anew = merit.clone();
        anew.resample(&merit.lens(&values)).unwrap();
        let anew = anew.value(&values).unwrap();
        for other in [far, anew] {
            assert!((other / there.value - 1.0).abs() < 1e-2, "{step}: {other} {}", there.value);
        }
    }
    assert!(forms.windows(2).any(|pair| pair[0] != pair[1]));
}

/// On the axis one rim ends the light. Where another rim is as narrow, the area of the pupil has a kink,
/// and the shortfall of light has none: each of the rims has its own.
#[test]
fn light_on_the_axis_has_no_kink_where_two_rims_are_equally_narrow() {
    let mut lens = bundled("tessar_50_f28");
    lens.fields.values.truncate(1);
    assert_eq!((lens.fields.values[0].x, lens.fields.values[0].y), (0.0, 0.0));
    lens.wavelengths.retain(|wavelength| wavelength.primary);
    let light = |lens: &Lens| {
        Merit::new(lens, &goal_of(Term::Light(1.0)), 1e-4).unwrap().spot_samplings()[0].area
    };
    let stop = lens.stop().unwrap();
    let at_stop = light(&lens);
    // The rim of the first surface takes as much as the stop.
    let full = lens.surfaces[0].semi_diameter.unwrap();
    let (mut low, mut high) = (0.3 * full, full);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        lens.surfaces[0].semi_diameter = Some(middle);
        if light(&lens) < at_stop * (1.0 - 1e-12) { low = middle } else { high = middle }
    }
    lens.surfaces[0].semi_diameter = Some(high);
    lens.variables.clear();
    for surface in [0, stop] {
        vary(&mut lens, surface, Quantity::SemiDiameter);
    }
    let merit = Merit::new(&lens, &goal_of(Term::Light(1.0)), 1e-4).unwrap();
    let values = merit.values(&lens);
    let at = |change: [f64; 2]| {
        let there = [values[0] + change[0], values[1] + change[1]];
        merit.evaluate(&there, DerivativeLevel::Normal).unwrap()
    };
    let h = 1e-3;
    for (i, sides) in [[[h, 0.0], [-h, 0.0]], [[0.0, h], [0.0, -h]]].iter().enumerate() {
        let [wide, narrow] = sides.map(at);
        assert!(wide.value < 1e-12, "{}", wide.value);
        // From the kept side the narrow one is known beforehand.
        let base = at([0.0; 2]);
        let mut change = nalgebra::DVector::zeros(2);
        change[i] = -h;
        let promised: f64 = base
            .separate
            .iter()
            .map(|residual| (residual.value + residual.slope.dot(&change)).max(0.0).powi(2))
            .sum();
        assert!((promised / narrow.value - 1.0).abs() < 1e-3, "{promised} {}", narrow.value);
    }
    // Both narrow: the sum of both, with its derivatives.
    let both = at([-2.0 * h, -h]);
    let [first, second] = [at([-2.0 * h, 0.0]), at([0.0, -h])];
    assert!((both.value / (first.value + second.value) - 1.0).abs() < 1e-9);
    let gradient = &first.gradient + &second.gradient;
    assert!((&both.gradient - &gradient).norm() < 1e-8 * gradient.norm());
    let only_value = merit.value(&[values[0] - 2.0 * h, values[1] - h]).unwrap();
    assert!((only_value / both.value - 1.0).abs() < 1e-12);
}
