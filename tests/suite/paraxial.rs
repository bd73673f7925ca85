//! First-order data and Seidel sums against `lenses.json`.

use crate::reference::{Reference, Worst, lenses, number, numbers};
use aplanat::paraxial::{FirstOrder, ParaxialRay, SeidelSums, first_order, seidel};

/// Of the largest number of the same kind: what double precision leaves over a few surfaces.
const TOLERANCE: f64 = 1e-12;

fn data(lens: &Reference) -> FirstOrder<f64> {
    first_order(&lens.open(lens.primary()), &lens.beam()).unwrap()
}

fn scalars(data: &FirstOrder<f64>) -> Vec<(&'static str, Option<f64>)> {
    vec![
        ("efl", data.efl),
        ("power", Some(data.power)),
        ("bfl", data.bfl),
        ("ffl", data.ffl),
        ("pp1", data.front_principal_plane),
        ("pp2", data.rear_principal_plane),
        ("z_ep", data.entrance_pupil.position),
        ("z_xp", data.exit_pupil.position),
        ("xp_diameter", data.exit_pupil.diameter),
        ("stop_radius", Some(data.stop_semi_diameter)),
        ("paraxial_image", data.paraxial_image),
        ("image_defocus", data.image_defocus),
        ("magnification", data.magnification),
        ("petzval_sum", Some(data.petzval_sum)),
        ("image_fno", data.working_f_number),
        ("lagrange", data.lagrange),
    ]
}

/// The largest of the terms that a number is a sum of.
fn scale(name: &str, exact: f64, lens: &Reference, data: &FirstOrder<f64>) -> f64 {
    match name {
        "ffl" | "pp1" | "pp2" => data.efl.unwrap().abs().max(exact.abs()),
        "image_defocus" => data.paraxial_image.unwrap().abs(),
        "z_ep" | "z_xp" => {
            let rows = lens.data["surfaces"].as_array().unwrap();
            let length = rows.iter().filter_map(|row| row["t"].as_f64()).map(f64::abs);
            length.fold(exact.abs(), f64::max)
        }
        "petzval_sum" => {
            let system = lens.open(lens.primary());
            let bend = system.surfaces.iter().map(|s| s.shape.curvature().abs());
            bend.fold(exact.abs(), f64::max)
        }
        _ => exact.abs(),
    }
}

fn compare(worst: &mut Worst, got: &[f64], exact: &[f64], name: &str) {
    let largest = exact.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    for (i, (got, exact)) in got.iter().zip(exact).enumerate() {
        worst.note(*got, *exact, largest, format!("{name}[{i}]"));
    }
}

fn compare_ray(worst: &mut Worst, ray: &ParaxialRay<f64>, lens: &Reference, name: &str) {
    let exact = &lens.data["paraxial"];
    for (got, part) in [(&ray.heights, "y"), (&ray.slopes, "u")] {
        let name = format!("{name}_{part}");
        let exact = numbers(&exact[&name]);
        assert_eq!(got.len(), exact.len(), "{name}");
        compare(worst, got, &exact, &name);
    }
}

#[test]
fn reference_paraxial_data() {
    let mut compared = 0;
    for lens in lenses() {
        let (data, mut worst) = (data(&lens), Worst::default());
        for (name, got) in scalars(&data) {
            let exact = &lens.data["paraxial"][name];
            if exact.is_null() {
                assert_eq!(got, None, "{}: {name}", lens.id());
                continue;
            }
            let exact = number(exact);
            worst.note(got.unwrap(), exact, scale(name, exact, &lens, &data), name);
        }
        compare_ray(&mut worst, &data.marginal, &lens, "marginal");
        compare_ray(&mut worst, data.chief.as_ref().unwrap(), &lens, "chief");
        compared += worst.check(&format!("paraxial {}", lens.id()), TOLERANCE);
    }
    assert_eq!(compared, 523);
}

fn row(sums: &SeidelSums<f64>) -> [f64; 7] {
    [sums.s1, sums.s2, sums.s3, sums.s4, sums.s5, sums.c1, sums.c2]
}

#[test]
fn reference_seidel_sums() {
    let mut compared = 0;
    for lens in lenses() {
        let system = lens.open(lens.primary());
        let (short, long) = outer(&lens);
        let outer = (lens.open(short), lens.open(long));
        let got = seidel(&system, &data(&lens), Some((&outer.0, &outer.1))).unwrap();
        let exact = &lens.data["seidel"];
        let rows: Vec<_> = exact["per_surface"].as_array().unwrap().iter().map(numbers).collect();
        let total = numbers(&exact["total"]);
        assert_eq!(rows.len(), got.surfaces.len(), "{}", lens.id());
        let mut worst = Worst::default();
        for column in 0..7 {
            let terms = || rows.iter().chain([&total]).map(|row| row[column]);
            let largest = terms().fold(0.0, |largest: f64, x| largest.max(x.abs()));
            let sums = got.surfaces.iter().chain([&got.total]);
            for (i, (sums, exact)) in sums.zip(terms()).enumerate() {
                worst.note(row(sums)[column], exact, largest, format!("column {column} row {i}"));
            }
        }
        compared += worst.check(&format!("seidel {}", lens.id()), TOLERANCE);
    }
    assert_eq!(compared, 651);
}

/// The shortest and the longest wavelength.
fn outer(lens: &Reference) -> (usize, usize) {
    let um = lens.wavelengths();
    let by_length = |a: &usize, b: &usize| um[*a].total_cmp(&um[*b]);
    ((0..um.len()).min_by(by_length).unwrap(), (0..um.len()).max_by(by_length).unwrap())
}
