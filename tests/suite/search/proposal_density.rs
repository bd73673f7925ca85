//! The densities that new elements are drawn from, worked out by hand, against what is claimed and
//! against what is drawn; and the limits that hold while the rest of a lens gives way.

use super::{generous, seeded};
use crate::merit::bundled;
use aplanat::lens::{Lens, Medium, Row, blank};
use aplanat::search::{MutatedLens, MutationKind, SearchRules, mutate};
use std::f64::consts::{SQRT_2, TAU};

/// The focal length of the lenses here, which sets the widths of all densities.
const FOCAL: f64 = 100.0;

/// The logarithm of the normal density.
fn normal(x: f64, deviation: f64) -> f64 {
    (-(x * x) / (2.0 * deviation * deviation)).exp().ln() - (deviation * TAU.sqrt()).ln()
}

/// The logarithm of the density of an exponential with this mean between two lengths.
fn exponential(x: f64, [least, most]: [f64; 2], mean: f64) -> f64 {
    let whole = mean * (1.0 - (-(most - least) / mean).exp());
    ((-(x - least) / mean).exp() / whole).ln()
}

fn glass(name: &str) -> Medium {
    Medium::Glass(name.to_owned())
}

fn plain(curvature: f64, thickness: f64, medium: Medium) -> Row {
    Row { curvature, thickness, medium, ..Row::default() }
}

/// A lens without rims; its first surface is the stop.
fn lens(rows: Vec<Row>) -> Lens {
    let mut lens = Lens { surfaces: rows, ..blank() };
    lens.surfaces[0].stop = true;
    lens
}

/// An equiconvex singlet of index 1.5 with the focal length, 2 mm thick.
fn singlet() -> Lens {
    // 1/f = (n − 1) (2 c − (n − 1) d c²/n)
    let (n, d) = (1.5, 2.0);
    let mut curvature = 1.0 / FOCAL;
    for _ in 0..20 {
        let thickness_part = (n - 1.0) * d * curvature * curvature / n;
        curvature = f64::midpoint(1.0 / ((n - 1.0) * FOCAL), thickness_part);
    }
    let (front, rear) = (Medium::Index(n), Medium::Air);
    lens(vec![plain(curvature, d, front), plain(-curvature, 98.0, rear)])
}

/// Nothing but the second surface may get a neighbour.
fn one_place() -> SearchRules {
    SearchRules {
        fixed_ends: [1, 0],
        projection: false,
        glasses: ["SCHOTT N-BK7", "SCHOTT N-SF6", "SCHOTT N-LAK9"].map(String::from).to_vec(),
        weights: vec![(MutationKind::AddSinglet, 3.0), (MutationKind::Split, 0.5)],
        glass_center: [1.0, 2.0],
        glass_edge: 0.5,
        air_center: [0.1, 0.4],
        ..generous()
    }
}

fn mutants(kind: MutationKind, lens: &Lens, rules: &SearchRules, count: u64) -> Vec<MutatedLens> {
    (0..count).map(|seed| mutate(kind, lens, rules, &mut seeded(seed)).unwrap()).collect()
}

/// The two curvatures, the thickness and the air of the singlet behind the second surface.
fn drawn(mutant: &MutatedLens) -> [f64; 4] {
    let rows = &mutant.lens.surfaces;
    assert_eq!(rows.len(), 4);
    [rows[2].curvature, rows[3].curvature, rows[2].thickness, rows[1].thickness]
}

#[test]
fn a_new_singlet_has_the_density_of_its_numbers() {
    let (lens, rules) = (singlet(), one_place());
    let beside = lens.surfaces[1].curvature;
    for mutant in mutants(MutationKind::AddSinglet, &lens, &rules, 50) {
        let [front, rear, thickness, air] = drawn(&mutant);
        // Curvatures around that of the neighbour, one of three glasses, and a removal that is
        // drawn a third as often; whether the image stays is chosen alike in both directions.
        let density = normal(front - beside, 0.25 / FOCAL)
            + normal(rear - beside, 0.25 / FOCAL)
            + exponential(thickness, [1.0, 2.0], 0.75 * FOCAL / 50.0)
            + exponential(air, [0.1, 0.4], 0.1 * FOCAL / 50.0);
        let exact = (1.0_f64 / 3.0).ln() - (density - 3f64.ln());
        let got = mutant.log_ratio.unwrap();
        assert!((got - exact).abs() < 1e-9, "{got} instead of {exact}: {}", mutant.change);
    }
}

#[test]
fn a_new_air_gap_has_the_density_of_its_numbers() {
    let bk7 = || glass("SCHOTT N-BK7");
    let lens = lens(vec![
        plain(0.02, 4.0, bk7()),
        plain(-0.01, 2.0, glass("SCHOTT N-SF6")),
        plain(-0.002, 90.0, Medium::Air),
    ]);
    let focal = focal_length(&lens);
    let rules = SearchRules { fixed_ends: [0, 0], ..one_place() };
    for mutant in mutants(MutationKind::Split, &lens, &rules, 50) {
        let rows = &mutant.lens.surfaces;
        assert_eq!(rows.len(), 4);
        let half = 0.5 * (rows[1].curvature - rows[2].curvature);
        assert!((rows[1].curvature + rows[2].curvature + 0.02).abs() < 1e-15);
        // Two curvatures from a mean and half a difference: a determinant of 2.
        let density = normal(half, 0.025 / focal)
            + exponential(rows[1].thickness, [0.1, 0.4], 0.5 * focal / 50.0);
        let exact = 2f64.ln() + 2f64.ln() - density;
        let got = mutant.log_ratio.unwrap();
        assert!((got - exact).abs() < 1e-9, "{got} instead of {exact}: {}", mutant.change);
    }
}

fn focal_length(lens: &Lens) -> f64 {
    let system = lens.resolve(0, lens.wavelengths[0].um).unwrap();
    let ray = aplanat::paraxial::paraxial_ray(&system, 1.0, 0.0);
    -1.0 / ray.slopes[lens.surfaces.len() - 1]
}

/// The largest difference between the distribution of some numbers and a distribution function.
fn distance(mut numbers: Vec<f64>, distribution: impl Fn(f64) -> f64) -> f64 {
    numbers.sort_by(f64::total_cmp);
    let count = numbers.len() as f64;
    let off = |(i, x): (usize, &f64)| {
        let exact = distribution(*x);
        (exact - i as f64 / count).abs().max((exact - (i + 1) as f64 / count).abs())
    };
    numbers.iter().enumerate().map(off).fold(0.0, f64::max)
}

/// `erf`, by Abramowitz and Stegun 7.1.26, to 1.5e-7.
fn erf(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.3275911 * x.abs());
    let terms = [0.254829592, -0.284496736, 1.421413741, -1.453152027, 1.061405429];
    let sum = terms.iter().rev().fold(0.0, |sum, a| (sum + a) * t);
    x.signum() * (1.0 - sum * (-x * x).exp())
}

#[test]
fn new_singlets_are_drawn_from_their_density() {
    let (lens, rules) = (singlet(), one_place());
    let beside = lens.surfaces[1].curvature;
    let found = mutants(MutationKind::AddSinglet, &lens, &rules, 2000);
    let numbers: Vec<[f64; 4]> = found.iter().map(drawn).collect();
    let column = |i: usize| numbers.iter().map(|row| row[i]).collect::<Vec<f64>>();
    let bell = |c: f64| 0.5 * (1.0 + erf((c - beside) / (0.25 / FOCAL) / SQRT_2));
    let falling = |[least, most]: [f64; 2], mean: f64| {
        move |x: f64| (-(x - least) / mean).exp_m1() / (-(most - least) / mean).exp_m1()
    };
    let distances = [
        distance(column(0), bell),
        distance(column(1), bell),
        distance(column(2), falling([1.0, 2.0], 1.5)),
        distance(column(3), falling([0.1, 0.4], 0.2)),
    ];
    // Kolmogorov and Smirnov: one sample of a thousand is farther than 1.95/√N.
    println!("distances of 2000 draws: {distances:.4?}");
    assert!(distances.iter().all(|d| *d < 1.95 / 2000f64.sqrt()), "{distances:?}");
    // One of three glasses each, within four standard deviations.
    for name in &rules.glasses {
        let made = found.iter().filter(|m| m.lens.surfaces[2].medium == glass(name)).count();
        assert!(made.abs_diff(667) < 85, "{name}: {made}");
    }
    // A fourth surface where it was, nine times of ten.
    let kept = found.iter().filter(|m| m.lens.surfaces[3].thickness < 98.0).count();
    assert!(kept.abs_diff(1800) < 54, "{kept}");
}

#[test]
fn a_cemented_surface_is_as_wide_as_the_narrower_of_the_two() {
    for [front, rear] in [[8.0, 6.0], [6.0, 8.0]] {
        let rim = |semi_diameter, row| Row { semi_diameter: Some(semi_diameter), ..row };
        let lens = lens(vec![
            rim(10.0, plain(0.01, 4.0, glass("SCHOTT N-BK7"))),
            rim(front, plain(0.0, 1.0, Medium::Air)),
            rim(rear, plain(0.0, 2.0, glass("SCHOTT N-SF6"))),
            rim(10.0, plain(0.0, 90.0, Medium::Air)),
        ]);
        let rules = SearchRules { projection: false, ..generous() };
        let glued = mutate(MutationKind::Glue, &lens, &rules, &mut seeded(1)).unwrap().lens;
        assert_eq!((glued.surfaces.len(), glued.surfaces[1].semi_diameter), (3, Some(6.0)));
    }
}

/// The gaps of glass, or of air, but for the last one.
fn gaps(lens: &Lens, of_glass: bool) -> Vec<f64> {
    let rows = &lens.surfaces[..lens.surfaces.len() - 1];
    let chosen = rows.iter().filter(|row| (row.medium != Medium::Air) == of_glass);
    chosen.map(|row| row.thickness).collect()
}

#[test]
fn glass_and_air_keep_their_own_limits_while_a_lens_is_projected() {
    let mut lens = bundled("heliar_100_f45");
    lens.variables.clear();
    let last = lens.surfaces.len() - 1;
    for row in &mut lens.surfaces[..last] {
        row.thickness = if row.medium == Medium::Air { 9.0 } else { 5.0 };
    }
    let (fixed, free) = (|v: f64| [v, v], [0.5, 30.0]);
    for (glass_center, air_center) in [(fixed(5.0), free), (free, fixed(9.0))] {
        let rules = SearchRules { glass_center, air_center, ..generous() };
        let (mut made, mut moved) = (0, 0);
        for seed in 0..30 {
            for kind in [MutationKind::Bend, MutationKind::ExchangeGlass] {
                let Ok(mutant) = mutate(kind, &lens, &rules, &mut seeded(seed)) else { continue };
                let (glass, air) = (gaps(&mutant.lens, true), gaps(&mutant.lens, false));
                let (held, left) = if glass_center == free { (air, glass) } else { (glass, air) };
                let at = if glass_center == free { 9.0 } else { 5.0 };
                assert!(held.iter().all(|gap| *gap == at), "{}: {held:?}", mutant.change);
                assert!(left.iter().all(|gap| (0.5..=30.0).contains(gap)), "{left:?}");
                moved += usize::from(left.iter().any(|gap| *gap != 5.0 && *gap != 9.0));
                made += 1;
            }
        }
        assert!(made > 20 && 2 * moved > made, "{moved} of {made}");
    }
}
