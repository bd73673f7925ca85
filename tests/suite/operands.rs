//! Terms of the merit function that bound one quantity, and terms about a part of the lens: values
//! against independent ones, derivatives against differences.

use super::merit::{bundled, check_term, step, vary};
use aplanat::lens::{
    Aperture, Edit, ElementEdit, Fields, Lens, Medium, ParameterKind, Quantity, Row, Wavelength,
    add_variables, apply_edit, glass,
};
use aplanat::merit::{
    DerivativeLevel, Goal, LimitTreatment, Merit, MeritError, OperandKind, PupilEdge, Term,
    TermScope, WeightedTerm,
};
use aplanat::optimize::{DescentMethod, start};
use aplanat::paraxial::{Beam, first_order, seidel};

fn goal(terms: Vec<WeightedTerm>) -> Goal {
    let limits = LimitTreatment::Constraints;
    Goal { terms, pupil: PupilEdge::Frozen, zoom_ratios: Vec::new(), limits }
}

fn scoped(term: Term, scope: TermScope) -> WeightedTerm {
    WeightedTerm { scope, ..WeightedTerm::new(term, 1.0) }
}

const fn operand(kind: OperandKind) -> Term {
    Term::Operand { kind, min: None, max: None }
}

/// The values of a bounded quantity, in the order of its places.
fn values(lens: &Lens, kind: OperandKind, scope: TermScope) -> Vec<f64> {
    let merit = Merit::new(lens, &goal(vec![scoped(operand(kind), scope)]), 1e-3).unwrap();
    let margins = merit.operand_margins(&merit.values(lens)).unwrap();
    margins.iter().map(|margin| margin.value).collect()
}

fn surfaces(first: usize, last: usize) -> TermScope {
    TermScope { surfaces: Some([first, last]), ..TermScope::ALL }
}

fn assert_near(found: f64, expected: f64, error: f64) {
    assert!((found - expected).abs() <= error, "{found} and {expected}");
}

#[test]
fn bounded_quantities_have_the_values_of_other_code() {
    let lens = bundled("tessar_50_f28");
    let um = lens.wavelengths[lens.primary()].um;
    let system = lens.resolve(0, um).unwrap();
    let data = first_order(&system, &Beam::for_lens(&lens, 0)).unwrap();
    let sums = seidel(&system, &data, None).unwrap();
    for (kind, expected) in [
        (OperandKind::SphericalAberration, sums.total.s1),
        (OperandKind::Coma, sums.total.s2),
        (OperandKind::Astigmatism, sums.total.s3),
        (OperandKind::PetzvalCurvature, sums.total.s4),
        (OperandKind::ThirdOrderDistortion, sums.total.s5),
        (OperandKind::Track, lens.total_track()),
    ] {
        assert_near(values(&lens, kind, TermScope::ALL)[0], expected, 1e-12);
    }
    let two = sums.surfaces[2].s1 + sums.surfaces[3].s1;
    let found = values(&lens, OperandKind::SphericalAberration, surfaces(2, 3))[0];
    assert_near(found, two, 1e-15);
    let gaps: Vec<f64> = lens.surfaces.iter().map(|row| row.thickness).collect();
    assert_eq!(values(&lens, OperandKind::Gap, TermScope::ALL), gaps[..gaps.len() - 1]);
    assert_eq!(values(&lens, OperandKind::Gap, surfaces(1, 2)), gaps[1..3]);
    assert_near(values(&lens, OperandKind::Track, surfaces(1, 2))[0], gaps[1] + gaps[2], 1e-12);
}

#[test]
fn angles_of_chief_rays_follow_from_the_law_of_refraction() {
    let lens = bundled("tessar_50_f28");
    let field = lens.fields.values.len() - 1;
    let at = |first, last| TermScope { fields: Some([field, field]), ..surfaces(first, last) };
    let incidence = values(&lens, OperandKind::IncidenceAngle, at(0, 1));
    let behind = values(&lens, OperandKind::ChiefRayAngle, at(0, 1));
    let height = values(&lens, OperandKind::ChiefRayHeight, at(0, 1));
    let um = lens.wavelengths[lens.primary()].um;
    let system = lens.resolve(0, um).unwrap();
    let arrives = lens.fields.values[field].y.to_radians();
    // From the normal by Snell's law, in the plane of the axis and the field.
    let normal = -(height[0] * lens.surfaces[0].curvature).asin();
    let (n, n1) = (system.index_before(0), system.index_before(1));
    assert_near(incidence[0].to_radians(), arrives - normal, 1e-12);
    let refracted = (n / n1 * (arrives - normal).sin()).asin() + normal;
    assert_near(behind[0].to_radians(), refracted, 1e-12);
    let image = values(&lens, OperandKind::Telecentricity, TermScope::ALL);
    assert_eq!(image, values(&lens, OperandKind::ChiefRayAngle, TermScope::ALL));
    assert_near(image[0], 0.0, 1e-12);
}

/// Two thin lenses in contact with powers φν₁/(ν₁ − ν₂) and −φν₂/(ν₁ − ν₂) have F and C in one focus,
/// and d at (P₁ − P₂)/(ν₁ − ν₂) of the focal length from it (Kingslake, *Lens Design Fundamentals*, 2010,
/// section 5.5), P being `(n_F − n_d)/(n_F − n_C)`.
#[test]
fn the_secondary_spectrum_of_a_thin_achromat_is_that_of_its_glasses() {
    let mut lens = bundled("achromat_ac254_100");
    lens.wavelengths = [0.4861327, 0.5875618, 0.6562725]
        .map(|um| Wavelength { um, weight: 1.0, primary: um == 0.5875618 })
        .to_vec();
    lens.fields.values.truncate(1);
    lens.variables.clear();
    lens.aperture = Aperture::EntrancePupilDiameter(0.1);
    let names = ["SCHOTT N-BK7", "SCHOTT N-SF5"];
    let indices = names.map(|name| {
        let glass = glass::find(name).unwrap();
        lens.wavelengths.iter().map(|line| glass.index(line.um).unwrap()).collect::<Vec<_>>()
    });
    let abbe = |n: &[f64]| (n[1] - 1.0) / (n[0] - n[2]);
    let partial = |n: &[f64]| (n[0] - n[1]) / (n[0] - n[2]);
    let [v1, v2] = [abbe(&indices[0]), abbe(&indices[1])];
    let focal = 100.0;
    let bend = |power: f64, n: &[f64]| power / (n[1] - 1.0);
    let [first, second] =
        [bend(v1 / (v1 - v2) / focal, &indices[0]), bend(-v2 / (v1 - v2) / focal, &indices[1])];
    let curvatures = [0.5 * first, -0.5 * first, -0.5 * first - second];
    let media = [Medium::Glass(names[0].into()), Medium::Glass(names[1].into()), Medium::Air];
    lens.surfaces = std::iter::zip(curvatures, media)
        .map(|(curvature, medium)| Row { curvature, medium, thickness: 1e-6, ..Row::default() })
        .collect();
    lens.surfaces[0].stop = true;
    lens.surfaces[2].thickness = focal;
    let axial = values(&lens, OperandKind::AxialColor, TermScope::ALL)[0];
    assert_near(axial, 0.0, 1e-4);
    let expected = focal * (partial(&indices[0]) - partial(&indices[1])) / (v1 - v2);
    let found = values(&lens, OperandKind::SecondarySpectrum, TermScope::ALL)[0];
    assert_near(found, expected, 0.01 * expected.abs());

    // Without a wavelength between two others there is none.
    lens.wavelengths.truncate(2);
    let terms = goal(vec![scoped(operand(OperandKind::SecondarySpectrum), TermScope::ALL)]);
    let refused = Merit::new(&lens, &terms, 1e-3)
        .and_then(|merit| merit.operand_margins(&merit.values(&lens)).map(drop));
    assert!(matches!(refused, Err(MeritError::DoesNotApply { .. })), "{refused:?}");
}

/// A chief ray through a stop in the front focal plane leaves parallel to the axis, near the axis.
#[test]
fn a_stop_in_the_front_focal_plane_makes_a_lens_telecentric() {
    let mut lens = bundled("achromat_ac254_100");
    let system = lens.resolve(0, lens.wavelengths[lens.primary()].um).unwrap();
    let data = first_order(&system, &Beam::for_lens(&lens, 0)).unwrap();
    let gap = -data.ffl.unwrap();
    lens.surfaces.iter_mut().for_each(|row| row.stop = false);
    lens.surfaces.insert(0, Row { stop: true, thickness: gap, ..Row::default() });
    lens.variables.clear();
    lens.aperture = Aperture::EntrancePupilDiameter(2.0);
    lens.fields.values.retain(|field| field.y == 0.0);
    let mut edge = lens.fields.values[0];
    edge.y = 0.01;
    lens.fields.values.push(edge);
    let angles = values(&lens, OperandKind::Telecentricity, TermScope::ALL);
    assert_near(angles[1], 0.0, 1e-6);
}

#[test]
fn bounded_quantities_have_exact_derivatives() {
    let mut lens = bundled("double_gauss_rudolph_50");
    lens.variables.clear();
    lens.image_solve = Some(0.1);
    for surface in [0, 4, 9] {
        vary(&mut lens, surface, Quantity::Curvature);
        vary(&mut lens, surface, Quantity::Thickness);
    }
    vary(&mut lens, 2, Quantity::Conic);
    for kind in OperandKind::ALL {
        let term = Term::Operand { kind, min: Some(1e3), max: None };
        check_term(&lens, WeightedTerm::new(term, 1.0), PupilEdge::Frozen, step);
    }
    let part = TermScope { fields: Some([1, 1]), wavelengths: Some([0, 0]), ..surfaces(3, 6) };
    for kind in [OperandKind::ChiefRayHeight, OperandKind::IncidenceAngle] {
        let term = Term::Operand { kind, min: None, max: Some(-1e3) };
        check_term(&lens, scoped(term, part), PupilEdge::Frozen, step);
    }
}

/// The sums grow with the beam, and a variable stop is one of their numbers.
#[test]
fn third_order_sums_follow_the_rim_of_the_stop() {
    let mut lens = bundled("tessar_50_f28");
    lens = apply_edit(&lens, &Edit::SetAperture(Aperture::StopSemiDiameter(6.0))).unwrap();
    lens.variables.clear();
    let stop = lens.stop().unwrap();
    vary(&mut lens, stop, Quantity::SemiDiameter);
    for kind in OperandKind::ALL.into_iter().filter(|kind| kind.is_third_order()) {
        let term = Term::Operand { kind, min: Some(1.0), max: None };
        check_term(&lens, WeightedTerm::new(term, 1.0), PupilEdge::Frozen, step);
    }
}

/// A lens with its stop opened is the lens with that aperture: spherical aberration by the fourth
/// power of the beam, coma by the third.
#[test]
fn third_order_sums_of_an_opened_stop_are_those_of_the_faster_lens() {
    let aperture = |lens: &Lens, radius: f64| {
        let mut lens =
            apply_edit(lens, &Edit::SetAperture(Aperture::StopSemiDiameter(radius))).unwrap();
        lens.variables.clear();
        lens
    };
    let lens = aperture(&bundled("tessar_50_f28"), 6.0);
    let mut opened = lens.clone();
    let stop = lens.stop().unwrap();
    vary(&mut opened, stop, Quantity::SemiDiameter);
    for kind in OperandKind::ALL.into_iter().filter(|kind| kind.is_third_order()) {
        let terms = vec![scoped(operand(kind), TermScope::ALL)];
        let merit = Merit::new(&opened, &goal(terms), 1e-3).unwrap();
        let found = merit.operand_margins(&[6.6]).unwrap()[0].value;
        let exact = values(&aperture(&lens, 6.6), kind, TermScope::ALL)[0];
        assert_near(found, exact, 1e-9 * exact.abs());
    }
}

#[test]
fn terms_about_a_part_are_terms_of_a_lens_with_that_part_only() {
    let mut lens = bundled("tessar_50_f28");
    lens.variables.clear();
    vary(&mut lens, 0, Quantity::Curvature);
    for edge in [PupilEdge::Frozen, PupilEdge::Moving] {
        for term in [Term::Spot, Term::SpotIntegral, Term::Throughput, Term::Distortion] {
            if term == Term::Throughput && edge == PupilEdge::Frozen {
                continue;
            }
            let gradient = |lens: &Lens, weighted| {
                let goal = Goal { pupil: edge, ..goal(vec![weighted]) };
                let merit = Merit::new(lens, &goal, 1e-6).unwrap();
                let sum = merit.evaluate(&merit.values(lens), DerivativeLevel::Normal).unwrap();
                [sum.value, sum.gradient[0], sum.normal[(0, 0)]]
            };
            let scope = TermScope { fields: Some([1, 1]), ..TermScope::ALL };
            let found = gradient(&lens, scoped(term, scope));
            let mut part = lens.clone();
            part.fields.values = vec![lens.fields.values[1]];
            let expected = gradient(&part, WeightedTerm::new(term, 1.0));
            for (found, expected) in found.into_iter().zip(expected) {
                let error = 1e-4 * expected.abs() + 1e-12;
                assert!((found - expected).abs() < error, "{term:?} {found} {expected}");
            }
        }
    }
}

#[test]
fn spots_of_one_wavelength_and_one_zoom_position() {
    let mut lens = bundled("zoom_nikkor_28_80");
    lens.variables.clear();
    vary(&mut lens, 3, Quantity::Curvature);
    let scope = TermScope { wavelengths: Some([0, 0]), zooms: Some([1, 1]), ..TermScope::ALL };
    check_term(&lens, scoped(Term::Spot, scope), PupilEdge::Frozen, step);
    let value = |lens: &Lens, weighted| {
        let merit = Merit::new(lens, &goal(vec![weighted]), 1e-6).unwrap();
        merit.value(&merit.values(lens)).unwrap()
    };
    let found = value(&lens, scoped(Term::Spot, scope));
    let mut single = aplanat::lens::at_zoom(&lens, 1);
    single.wavelengths.truncate(1);
    single.wavelengths[0].primary = true;
    let expected = value(&single, WeightedTerm::new(Term::Spot, 1.0));
    assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
}

#[test]
fn limits_of_some_surfaces_say_nothing_about_the_others() {
    let lens = bundled("tessar_50_f28");
    let count = |scope| {
        let term = scoped(Term::GlassCenter { min: 0.1, max: 9.0 }, scope);
        let found = aplanat::merit::constraint_margins(&lens, [term].into_iter()).unwrap();
        found.iter().map(|margin| margin.surface.unwrap()).collect::<Vec<_>>()
    };
    let all = count(TermScope::ALL);
    assert!(all.len() > 2);
    assert_eq!(count(surfaces(all[1], all[1])), [all[1]]);
}

#[test]
fn a_scope_that_a_term_or_a_lens_has_not_is_refused() {
    let lens = bundled("tessar_50_f28");
    let rows = lens.surfaces.len();
    let refused = |term, scope| {
        let error = Merit::new(&lens, &goal(vec![scoped(term, scope)]), 1e-3).unwrap_err();
        assert!(matches!(error, MeritError::DoesNotApply { .. }), "{error}");
        error.to_string()
    };
    assert!(refused(Term::Spot, surfaces(0, 1)).contains("restricted to surfaces"));
    assert!(refused(Term::FocalLength(50.0), surfaces(0, 1)).contains("surfaces"));
    assert!(refused(operand(OperandKind::Gap), surfaces(0, rows)).contains("no surface"));
    let field = TermScope { fields: Some([9, 9]), ..TermScope::ALL };
    assert!(refused(Term::Spot, field).contains("no field"));
    // The image plane is a surface for rays.
    assert_eq!(values(&lens, OperandKind::ChiefRayHeight, surfaces(rows, rows)).len(), 3);
    let backwards = Lens { merit: Some(goal(vec![scoped(Term::Spot, surfaces(2, 1))])), ..lens };
    assert!(backwards.check().unwrap_err().to_string().contains("surfaces 2 to 1"));
}

#[test]
fn terms_follow_the_surfaces_and_fields_that_they_are_about() {
    let mut lens = bundled("tessar_50_f28");
    let field = TermScope { fields: Some([2, 2]), ..TermScope::ALL };
    lens.merit = Some(goal(vec![
        scoped(operand(OperandKind::Gap), surfaces(2, 3)),
        scoped(operand(OperandKind::Sag), surfaces(0, 0)),
        scoped(Term::Spot, field),
    ]));
    let scopes = |lens: &Lens| {
        let terms = &lens.merit.as_ref().unwrap().terms;
        terms.iter().map(|w| w.scope).collect::<Vec<_>>()
    };
    let inserted = Edit::InsertRow { at: 1, row: Row::default() };
    let longer = apply_edit(&lens, &inserted).unwrap();
    assert_eq!(scopes(&longer)[..2], [surfaces(3, 4), surfaces(0, 0)]);
    let shorter = apply_edit(&lens, &Edit::Element(ElementEdit::Remove(0))).unwrap();
    assert_eq!(scopes(&shorter), [surfaces(0, 1), field], "the term about a lost surface is gone");
    let turned = apply_edit(&lens, &Edit::ReverseRows { first: 0, last: 3 }).unwrap();
    assert_eq!(scopes(&turned)[..2], [surfaces(0, 3), surfaces(3, 3)]);
    let mut fields = lens.fields.values.clone();
    fields.remove(1);
    let fewer = Edit::SetFields(Fields { kind: lens.fields.kind, values: fields });
    let fewer = apply_edit(&lens, &fewer).unwrap();
    assert_eq!(scopes(&fewer)[2].fields, Some([1, 1]));
}

#[test]
fn the_optimizer_keeps_a_target_of_a_chief_ray() {
    let mut lens = bundled("tessar_50_f28");
    lens.variables.clear();
    add_variables(&mut lens, &[ParameterKind::Curvatures]);
    let edge = lens.fields.values.len() - 1;
    let scope = TermScope { fields: Some([edge, edge]), ..TermScope::ALL };
    let before = values(&lens, OperandKind::Telecentricity, scope)[0];
    let target = Some(before - 0.5);
    let kind = OperandKind::Telecentricity;
    let asked = scoped(Term::Operand { kind, min: target, max: target }, scope);
    let goal = goal(vec![WeightedTerm::new(Term::Spot, 1.0), asked]);
    let mut optimizer = start(DescentMethod::TrustRegion, &lens, &goal, 1e-3).unwrap();
    (0..15).take_while(|_| optimizer.step().end.is_none()).for_each(drop);
    optimizer.verify_best();
    let after = values(optimizer.best(), OperandKind::Telecentricity, scope)[0];
    assert_near(after, before - 0.5, 1e-6);
}

#[test]
fn scopes_are_written_to_the_file_and_absent_ones_are_not() {
    let whole = serde_json::to_string(&WeightedTerm::new(Term::Spot, 1.0)).unwrap();
    assert_eq!(whole, r#"{"term":"spot","weight":1.0}"#);
    let kind = OperandKind::ChiefRayAngle;
    let term = Term::Operand { kind, min: None, max: Some(12.0) };
    let part = scoped(term, surfaces(3, 4));
    let text = serde_json::to_string(&part).unwrap();
    assert_eq!(serde_json::from_str::<WeightedTerm>(&text).unwrap(), part);
    assert!(text.contains(r#""scope":{"surfaces":[3,4]}"#), "{text}");
}
