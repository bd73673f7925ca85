//! Derivatives of every term by every kind of variable, against central differences.

use aplanat::files;
use aplanat::lens::{
    Aperture, FieldKind, FieldPoint, Lens, Medium, Object, Parameter, Pickup, Quantity, Row,
    Variable,
};
use aplanat::merit::{DerivativeLevel, Goal, LimitTreatment, Merit, PupilEdge, Term, WeightedTerm};

pub(crate) fn bundled(name: &str) -> Lens {
    files::open(format!("lenses/{name}.json")).unwrap().lens
}

pub(crate) fn vary(lens: &mut Lens, surface: usize, quantity: Quantity) {
    let parameter = Parameter::new(surface, quantity);
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
        Quantity::Conic
        | Quantity::Thickness
        | Quantity::ZoomThickness(_)
        | Quantity::SemiDiameter => 1e-2,
        Quantity::Index | Quantity::Grin(_) => 1e-4,
    }
}

#[test]
fn every_term_has_the_derivative_of_its_value() {
    let lens = everything();
    terms().into_iter().for_each(|term| check(&lens, term, PupilEdge::Frozen, step));
}

#[test]
fn every_term_includes_the_motion_of_the_pupil() {
    for name in ["double_gauss_rudolph_50", "double_gauss_nikkor_s_50"] {
        let mut lens = bundled(name);
        lens.variables.clear();
        for surface in 0..lens.surfaces.len() {
            // Equal rims would make the larger of two a number with two slopes.
            let rim = Parameter::new(surface, Quantity::SemiDiameter);
            let size = lens.get(rim).unwrap();
            lens.set(rim, size * (1.0 + 1e-3 * surface as f64));
            for quantity in [Quantity::Curvature, Quantity::Thickness, Quantity::SemiDiameter] {
                vary(&mut lens, surface, quantity);
            }
        }
        let moving = [
            Term::Spot,
            Term::GlassEdge(3.0),
            Term::SpotIntegral,
            Term::Throughput,
            Term::ThroughputLoss(200.0),
            Term::RelativeIllumination { field: 1, min: 2.0 },
            Term::FNumber(3.0),
            Term::Light(1.01),
            Term::Steepness(0.1),
            Term::SemiDiameter { min: 5.0, max: 6.0 },
        ];
        for term in moving {
            check(&lens, term, PupilEdge::Moving, |quantity| 0.02 * step(quantity));
        }
    }
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
        for surface in 0..lens.surfaces.len() {
            vary(&mut lens, surface, Quantity::Curvature);
            vary(&mut lens, surface, Quantity::Thickness);
        }
        for term in [Term::Spot, Term::Throughput, Term::Light(1.01)] {
            check(&lens, term, PupilEdge::Moving, |quantity| 0.02 * step(quantity));
        }
    }
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
    for term in [Term::Throughput, Term::ThroughputLoss(200.0), Term::Light(0.8)] {
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
    for gap in lens.zoom[0].thicknesses.clone() {
        for zoom in 0..lens.zoom.len() {
            vary(&mut lens, gap.surface, Quantity::ZoomThickness(zoom));
        }
    }
    vary(&mut lens, 3, Quantity::Curvature);
    for term in [Term::Spot, Term::FocalLength(29.0), Term::TotalTrack(10.0)] {
        check(&lens, term, PupilEdge::Frozen, step);
    }
}

#[test]
fn the_gauss_newton_matrix_is_that_of_the_residuals() {
    // Near a solution the Hessian of a sum of squares is twice the Gauss-Newton matrix; a linear
    // residual is near one everywhere.
    let mut lens = bundled("achromat_ac254_100");
    lens.variables.clear();
    vary(&mut lens, 2, Quantity::Thickness);
    let goal = Goal {
        terms: vec![WeightedTerm::new(Term::Spot, 1.0)],
        zoom_ratios: vec![],
        limits: LimitTreatment::default(),
        pupil: PupilEdge::default(),
    };
    let merit = Merit::new(&lens, &goal, 1e-4).unwrap();
    let values = merit.values(&lens);
    let at =
        |t: f64| merit.evaluate(&[values[0] + t], DerivativeLevel::Gradient).unwrap().gradient[0];
    let second = (at(0.01) - at(-0.01)) / 0.02;
    let normal = merit.evaluate(&values, DerivativeLevel::Normal).unwrap().normal[(0, 0)];
    assert!((second / (2.0 * normal) - 1.0).abs() < 1e-6, "{second} and {normal}");
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
