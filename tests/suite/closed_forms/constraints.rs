//! Lengths between surfaces, worked out by hand.

use super::{assert_near, lens, row, sphere_sag};
use aplanat::lens::{Aperture, Lens, Medium, Row};
use aplanat::merit::{Goal, Term, WeightedTerm, constraint_margins};

/// A stop, a concave mirror 100 mm behind it and a convex one 80 mm in front of that; the image lies
/// 120 mm behind the second one.
fn two_mirrors() -> Lens {
    let mirror = |curvature, thickness| Row {
        medium: Medium::Mirror,
        semi_diameter: Some(20.0),
        ..row(curvature, thickness, 1.0)
    };
    let stop = Row { stop: true, semi_diameter: Some(20.0), ..row(0.0, 100.0, 1.0) };
    let rows = vec![stop, mirror(-1.0 / 400.0, -80.0), mirror(-1.0 / 300.0, 120.0)];
    lens(rows, Aperture::EntrancePupilDiameter(30.0), &[0.0])
}

fn lengths(lens: &Lens, term: Term) -> Vec<f64> {
    let margins = constraint_margins(lens, [WeightedTerm::new(term, 1.0)].into_iter()).unwrap();
    margins.into_iter().map(|margin| margin.value).collect()
}

#[test]
fn lengths_between_mirrors_are_counted_along_the_light() {
    let lens = two_mirrors();
    assert_eq!(lengths(&lens, Term::AirCenter { min: 0.0, max: 1.0 }), [100.0, 80.0]);
    assert_eq!(lengths(&lens, Term::TotalTrack(1.0)), [300.0]);
    assert_eq!(lengths(&lens, Term::BackFocus(1.0)), [120.0]);
    // At the rim a concave mirror comes nearer to what lies in front of it.
    let (first, second) = (sphere_sag(-1.0 / 400.0, 20.0), sphere_sag(-1.0 / 300.0, 20.0));
    let edges = lengths(&lens, Term::AirEdge(0.0));
    assert_eq!(edges.len(), 2);
    assert_near(edges[0], 100.0 + first, 1e-14);
    assert_near(edges[1], 80.0 + first - second, 1e-14);
}

/// Two menisci that face each other with their hollow sides, each with a wide and a narrow rim.
fn menisci() -> Lens {
    let rim = |semi_diameter, row| Row { semi_diameter: Some(semi_diameter), ..row };
    let rows = vec![
        Row { stop: true, ..rim(10.0, row(0.02, 1.0, 1.5)) },
        rim(5.0, row(0.01, 0.3, 1.0)),
        rim(10.0, row(-0.01, 1.0, 1.5)),
        rim(5.0, row(-0.02, 100.0, 1.0)),
    ];
    lens(rows, Aperture::EntrancePupilDiameter(4.0), &[0.0])
}

#[test]
fn glass_reaches_to_its_larger_rim_and_air_to_its_smaller_one() {
    let lens = menisci();
    let glass = 1.0 + sphere_sag(0.01, 10.0) - sphere_sag(0.02, 10.0);
    let air = 0.3 - 2.0 * sphere_sag(0.01, 5.0);
    for edge in lengths(&lens, Term::GlassEdge(0.0)) {
        assert_near(edge, glass, 1e-13);
    }
    assert_near(lengths(&lens, Term::AirEdge(0.0))[0], air, 1e-12);
    // The default goal keeps the thin edges that a lens has: 0.49 and 0.05 mm here.
    let goal = Goal::default_for(&lens).unwrap();
    let edges: Vec<f64> = goal
        .terms
        .iter()
        .filter_map(|weighted| match weighted.term {
            Term::GlassEdge(edge) | Term::AirEdge(edge) => Some(edge),
            _ => None,
        })
        .collect();
    assert_eq!(edges.len(), 2);
    assert_near(edges[0], glass, 1e-13);
    assert_near(edges[1], air, 1e-12);
}
