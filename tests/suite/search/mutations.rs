//! Every kind of mutation on every lens of the library: its effect, its refusals, and the validity
//! of its result.

use super::{generous, seeded};
use crate::merit::bundled;
use aplanat::files;
use aplanat::lens::{
    FieldPoint, Lens, Medium, Object, Parameter, ParameterKind, Pickup, Quantity, System,
    add_variables,
};
use aplanat::pupil::{RayModel, Region};
use aplanat::search::element::{elements, piece_count, topology};
use aplanat::search::{MutatedLens, MutationKind, Refusal, SearchRules, mutate, propose};

/// A lens is one at every zoom position: it can be resolved, and no surfaces cross within the rims of
/// both.
pub(super) fn assert_lens(lens: &Lens) {
    lens.check().unwrap();
    let um = lens.wavelengths[lens.primary()].um;
    for zoom in 0..lens.zoom_positions() {
        let system = lens.resolve(zoom, um).unwrap();
        for gap in 0..lens.surfaces.len() - 1 {
            assert_apart(&system, gap);
        }
    }
}

fn assert_apart(system: &System<f64>, gap: usize) {
    let mirrors = system.surfaces[..=gap].iter().filter(|s| s.mirror).count();
    let sense = if mirrors % 2 == 1 { -1.0 } else { 1.0 };
    let (front, rear) = (&system.surfaces[gap], &system.surfaces[gap + 1]);
    let center = sense * front.thickness;
    assert!(center >= 0.0, "gap {gap}: {center}");
    let rim = front.semi_diameter.min(rear.semi_diameter);
    // The size of a stop is the aperture, and no mutation makes it smaller.
    if rim.is_finite() && system.stop != Some(gap) && system.stop != Some(gap + 1) {
        let sag = |surface: &aplanat::lens::Surface<f64>| surface.shape.sag(rim * rim).unwrap().0;
        let edge = center + sense * (sag(rear) - sag(front));
        assert!(edge > -1e-9 * rim.max(1.0), "gap {gap}: {edge} at {rim}");
    }
}

#[test]
fn every_mutation_of_every_lens_gives_a_lens_or_a_reason() {
    for entry in files::bundled_lenses() {
        let lens = bundled(entry.name);
        let mut random = seeded(1);
        for kind in MutationKind::MUTATIONS.repeat(8) {
            match mutate(kind, &lens, &generous(), &mut random) {
                Ok(mutant) => {
                    assert_lens(&mutant.lens);
                    assert_eq!(mutant.kind, kind);
                    assert!(mutant.log_ratio.is_none_or(f64::is_finite));
                    assert!(!mutant.change.to_string().is_empty());
                }
                Err(error) => assert_eq!(error.kind, kind),
            }
        }
    }
}

#[test]
fn the_pattern_of_glass_and_air_is_read_from_the_rows() {
    let pattern = |name: &str| topology(&bundled(name));
    assert_eq!(pattern("double_gauss_nikkor_s_50"), "1|2|stop|2|1|1");
    assert_eq!(pattern("achromat_ac254_100"), "stop|2");
    assert_eq!(pattern("telescope_rc_f8"), "stop|m|m");
    assert_eq!(pattern("telephoto_nikkor_135_f28"), "1|1|stop|2|1");
    assert_eq!(piece_count(&bundled("heliar_100_f45")), 5);
}

#[test]
fn each_mutation_changes_the_topology_as_documented() {
    let lens = bundled("double_gauss_nikkor_s_50");
    let after = |kind: MutationKind, seed: u64| {
        let mutant = mutate(kind, &lens, &generous(), &mut seeded(seed)).unwrap();
        (topology(&mutant.lens), piece_count(&mutant.lens), mutant)
    };
    for seed in 0..12 {
        let (_, count, mutant) = after(MutationKind::AddSinglet, seed);
        assert_eq!((count, mutant.new_glass.len()), (8, 1));
        assert_eq!(mutant.lens.surfaces.len(), lens.surfaces.len() + 2);
        let (_, count, _) = after(MutationKind::RemoveSinglet, seed);
        assert_eq!(count, 6);
        let (pattern, count, _) = after(MutationKind::Glue, seed);
        assert_eq!(count, 7);
        assert!(["3|stop|2|1|1", "1|2|stop|3|1", "1|2|stop|2|2"].contains(&&*pattern));
        let (pattern, count, _) = after(MutationKind::Split, seed);
        assert_eq!(count, 7);
        assert!(["1|1|1|stop|2|1|1", "1|2|stop|1|1|1|1"].contains(&&*pattern), "{pattern}");
        let (_, count, _) = after(MutationKind::DropLayer, seed);
        assert_eq!(count, 6);
        for kind in [MutationKind::Bend, MutationKind::Flip, MutationKind::ExchangeGlass] {
            assert_eq!(after(kind, seed).0, "1|2|stop|2|1|1");
        }
        assert_eq!(after(MutationKind::MoveStop, seed).2.lens.surfaces.len(), lens.surfaces.len());
    }
}

#[test]
fn violated_rules_give_reasons() {
    let lens = bundled("double_gauss_nikkor_s_50");
    let refused = |kind: MutationKind, rules: SearchRules| {
        mutate(kind, &lens, &rules, &mut seeded(1)).unwrap_err()
    };
    let full = SearchRules { elements: [2, 7], ..SearchRules::default() };
    assert_eq!(
        refused(MutationKind::AddSinglet, full).to_string(),
        "add singlet: the lens has as many elements as the rules allow"
    );
    let least = SearchRules { elements: [7, 9], ..SearchRules::default() };
    for kind in [MutationKind::RemoveSinglet, MutationKind::DropLayer] {
        assert_eq!(refused(kind, least.clone()).refusal, Refusal::TooFewElements);
    }
    let held = SearchRules { fixed_ends: [13, 0], ..SearchRules::default() };
    for kind in MutationKind::MUTATIONS {
        assert!(mutate(kind, &lens, &held, &mut seeded(1)).is_err(), "{kind:?}");
    }
    let short = SearchRules { track: Some(10.0), ..SearchRules::default() };
    let longer = (0..20).filter_map(|seed| {
        mutate(MutationKind::AddSinglet, &lens, &short, &mut seeded(seed)).err()
    });
    assert!(longer.into_iter().all(|error| error.refusal == Refusal::TooLong));
}

#[test]
fn the_only_element_is_not_removed() {
    let lens = bundled("singlet_la1131");
    let rules = SearchRules { elements: [0, 8], ..SearchRules::default() };
    let refusal = mutate(MutationKind::RemoveSinglet, &lens, &rules, &mut seeded(1)).unwrap_err();
    assert_eq!(refusal.refusal, Refusal::NoSinglet);
}

#[test]
fn a_forbidden_kind_is_not_proposed() {
    let lens = bundled("double_gauss_nikkor_s_50");
    let weights =
        MutationKind::MUTATIONS.map(|kind| (kind, f64::from(u8::from(kind == MutationKind::Flip))));
    let only = SearchRules { weights: weights.to_vec(), ..generous() };
    let mut random = seeded(2);
    for _ in 0..20 {
        assert_eq!(propose(&lens, &only, &mut random).unwrap().kind, MutationKind::Flip);
    }
    let none = SearchRules {
        weights: MutationKind::MUTATIONS.map(|kind| (kind, 0.0)).to_vec(),
        ..generous()
    };
    assert!(propose(&lens, &none, &mut random).is_err());
}

#[test]
fn elements_of_the_same_glass_are_not_glued() {
    let mut lens = bundled("cooke_triplet_100_f27");
    lens.surfaces.remove(4);
    lens.surfaces[0].stop = true;
    let glass = Medium::Glass("SCHOTT N-BK7".to_owned());
    for row in [0, 2, 4] {
        lens.surfaces[row].medium = glass.clone();
    }
    let refusal = mutate(MutationKind::Glue, &lens, &generous(), &mut seeded(1)).unwrap_err();
    assert_eq!(refusal.refusal, Refusal::NoNeighbours);
    // An index that is the same by chance makes an interface without effect, and still a lens.
    lens.surfaces[2].medium = Medium::Model { nd: 1.5168, vd: 64.17 };
    let mutant = mutate(MutationKind::Glue, &lens, &generous(), &mut seeded(1));
    mutant.into_iter().for_each(|mutant| assert_lens(&mutant.lens));
}

#[test]
fn only_listed_glasses_are_used() {
    let lens = bundled("double_gauss_nikkor_s_50");
    let glasses = vec!["SCHOTT N-BK7".to_owned(), "SCHOTT N-SF6".to_owned()];
    let rules = SearchRules { glasses: glasses.clone(), ..generous() };
    let mut random = seeded(3);
    for _ in 0..20 {
        let mutant = mutate(MutationKind::AddSinglet, &lens, &rules, &mut random).unwrap();
        let Medium::Glass(name) = &mutant.lens.surfaces[mutant.new_glass[0]].medium else {
            panic!()
        };
        assert!(glasses.contains(name), "{name}");
    }
    let unknown = SearchRules { glasses: vec!["NO SUCH".to_owned()], ..generous() };
    assert!(mutate(MutationKind::AddSinglet, &lens, &unknown, &mut random).is_err());
}

#[test]
fn aspheres_and_mirrors_survive() {
    let figured = |lens: &Lens| {
        let figures = lens.surfaces.iter().map(|row| (row.conic, row.asphere.clone()));
        figures.filter(|(conic, terms)| *conic != 0.0 || !terms.is_empty()).count()
    };
    for (name, count) in [("phone_us7558005_1", 8), ("double_gauss_canon_fd50_f12", 1)] {
        let lens = bundled(name);
        assert_eq!(figured(&lens), count);
        for kind in [
            MutationKind::AddSinglet,
            MutationKind::Bend,
            MutationKind::Flip,
            MutationKind::MoveStop,
        ] {
            let mutant = mutate(kind, &lens, &generous(), &mut seeded(4)).unwrap();
            assert_eq!(figured(&mutant.lens), count, "{name}: {}", mutant.change);
        }
    }
    let mut telescope = bundled("telescope_rc_f8");
    // A new element is judged by light near the axis.
    telescope.surfaces[0].obstruction = None;
    let rules = SearchRules { elements: [0, 4], ..SearchRules::default() };
    let mut random = seeded(5);
    for _ in 0..30 {
        let mutant = mutate(MutationKind::AddSinglet, &telescope, &rules, &mut random).unwrap();
        assert_lens(&mutant.lens);
        assert_eq!(elements(&mutant.lens).len(), 3);
        let mirrors = mutant.lens.surfaces.iter().filter(|row| row.medium == Medium::Mirror);
        assert_eq!(mirrors.count(), 2);
    }
}

#[test]
fn pickups_hold_after_mutations() {
    let mut lens = bundled("double_gauss_rudolph_50");
    lens.variables.clear();
    add_variables(&mut lens, &[ParameterKind::Curvatures]);
    let follows = |surface, source| Pickup {
        parameter: Parameter::new(surface, Quantity::Curvature),
        source: Parameter::new(source, Quantity::Curvature),
        scale: -1.0,
        offset: 0.0,
    };
    lens.variables.retain(|v| v.parameter.surface < 9);
    lens.pickups = vec![follows(9, 1), follows(10, 0)];
    let mut random = seeded(6);
    for kind in MutationKind::MUTATIONS.repeat(10) {
        let Ok(mutant) = mutate(kind, &lens, &generous(), &mut random) else { continue };
        assert_lens(&mutant.lens);
        assert_eq!(mutant.lens.pickups.len(), 2, "{}", mutant.change);
        for pickup in &mutant.lens.pickups {
            let [follower, source] = [pickup.parameter, pickup.source].map(|p| mutant.lens.get(p));
            assert_eq!(follower.unwrap(), pickup.scale * source.unwrap(), "{}", mutant.change);
        }
    }
}

/// The numbers of a lens, for comparison.
fn same(a: &Lens, b: &Lens) -> bool {
    let near = |x: f64, y: f64, scale: f64| (x - y).abs() < 1e-7 * scale;
    a.surfaces.len() == b.surfaces.len()
        && a.surfaces.iter().zip(&b.surfaces).all(|(a, b)| {
            let curved = near(a.curvature, b.curvature, 0.1);
            curved && near(a.thickness, b.thickness, 10.0) && a.medium == b.medium
        })
}

/// Some draw of the mutation that undoes it leads back with a ratio that cancels. Other draws may
/// lead to the same lens on other ways, as an element that goes with the air behind it.
fn assert_undone(
    lens: &Lens,
    there: &MutatedLens,
    back: MutationKind,
    rules: &SearchRules,
) -> bool {
    let Some(log) = there.log_ratio else { return false };
    let mut others = Vec::new();
    for seed in 0..400 {
        let Ok(mutant) = mutate(back, &there.lens, rules, &mut seeded(seed)) else { continue };
        if same(lens, &mutant.lens) {
            let other = mutant.log_ratio;
            if other.is_some_and(|other| (log + other).abs() < 1e-6) {
                return true;
            }
            others.push(other);
        }
    }
    panic!("{} with {log} is not undone: {others:?}", there.change);
}

#[test]
fn a_mutation_and_the_one_that_undoes_it_are_a_reversible_pair() {
    let rules = SearchRules {
        weights: vec![(MutationKind::AddSinglet, 3.0), (MutationKind::Split, 0.5)],
        ..generous()
    };
    for name in ["heliar_100_f45", "achromat_ac254_100", "tessar_50_f28"] {
        let mut lens = bundled(name);
        lens.variables.clear();
        for (there, back) in [
            (MutationKind::AddSinglet, MutationKind::RemoveSinglet),
            (MutationKind::Split, MutationKind::Glue),
            (MutationKind::Flip, MutationKind::Flip),
        ] {
            let undone = (0..10).filter(|seed| {
                let mutant = mutate(there, &lens, &rules, &mut seeded(*seed)).unwrap();
                assert_undone(&lens, &mutant, back, &rules)
            });
            let undone = undone.count();
            println!("{name}: {} of 10 undone by {}", undone, back.name());
            assert!(undone >= 5, "{name}: {} {undone}", there.name());
        }
    }
}

#[test]
fn without_projection_numbers_stay() {
    let lens = bundled("heliar_100_f45");
    let rules = SearchRules { projection: false, ..generous() };
    let mutant = mutate(MutationKind::Bend, &lens, &rules, &mut seeded(1)).unwrap();
    assert_eq!((mutant.projection, mutant.log_ratio), (None, Some(0.0)));
    let mutant = mutate(MutationKind::AddSinglet, &lens, &rules, &mut seeded(1)).unwrap();
    assert!(mutant.log_ratio.is_some());
    for seed in 0..10 {
        let mutant = mutate(MutationKind::Split, &lens, &rules, &mut seeded(seed)).unwrap();
        assert!(assert_undone(&lens, &mutant, MutationKind::Glue, &rules));
    }
}

/// The approximate memory of a lens: everything in it that could grow.
fn size(lens: &Lens) -> usize {
    let zoom: usize = lens.zoom.iter().map(|position| position.numbers.len()).sum();
    let text: usize = lens.surfaces.iter().map(|row| row.comment.len()).sum();
    lens.surfaces.len() + lens.variables.len() + lens.pickups.len() + zoom + text
}

fn chain(name: &str, moves: usize) {
    let start = bundled(name);
    let rules = SearchRules { elements: [2, 10], ..SearchRules::default() };
    let mut random = seeded(2026);
    let (mut lens, mut refused, mut made, mut most) = (start.clone(), 0, 0, 0);
    for number in 0..moves {
        match propose(&lens, &rules, &mut random) {
            Ok(mutant) => {
                (lens, refused, made) = (mutant.lens, 0, made + 1);
                lens.check().unwrap();
                most = most.max(size(&lens));
            }
            Err(_) => refused += 1,
        }
        if number % 100 == 0 {
            assert_lens(&lens);
        }
        if refused > 20 {
            (lens, refused) = (start.clone(), 0);
        }
    }
    println!("{name}: {made} of {moves} mutations made, at most {most} numbers");
    assert!(made > moves / 5, "{name}: {made}");
    assert!(most < 40 + 4 * size(&start), "{name}: {most}");
}

#[test]
fn a_hundred_thousand_mutations_keep_a_lens_valid() {
    chain("double_gauss_nikkor_s_50", 40_000);
    chain("cooke_triplet_100_f27", 40_000);
    chain("achromat_ac254_100", 20_000);
}

/// The share of its axial pupil that a lens lets through at the wavelength of its focal length.
fn clear(lens: &Lens) -> f64 {
    let model = RayModel::from_lens(lens, 0).unwrap();
    let axis = FieldPoint { x: 0.0, y: 0.0, weight: 1.0 };
    Region::new(model.launch(axis, model.primary).unwrap()).trace_pupil(4).signed_area()
}

/// A new element shall not be punished for light that only its rims took away.
#[test]
fn a_new_element_clips_no_light() {
    for name in
        ["double_gauss_canon_ef50_f18", "double_gauss_nikkor_s_50", "double_gauss_rudolph_50"]
    {
        let lens = bundled(name);
        let (mut random, before) = (seeded(5), clear(&lens));
        for kind in [MutationKind::AddSinglet, MutationKind::Split, MutationKind::Glue] {
            let mutants =
                (0..60).filter_map(|_| mutate(kind, &lens, &generous(), &mut random).ok());
            let shares: Vec<f64> = mutants.map(|m| clear(&m.lens) / before).collect();
            let sound = shares.iter().filter(|share| **share > 0.9).count();
            println!("{name}: {}: {sound} of {} keep their light", kind.name(), shares.len());
            assert!(kind == MutationKind::Glue || 2 * sound > shares.len());
        }
    }
}

/// The object and the rest of the lens stay where they are: a new front element takes its length from
/// the distance of the object.
#[test]
fn a_new_front_element_stands_between_the_object_and_the_lens() {
    let far = bundled("heliar_100_f45");
    let rules = SearchRules {
        projection: false,
        weights: vec![(MutationKind::AddSinglet, 3.0), (MutationKind::Split, 0.5)],
        ..generous()
    };
    for object in [Object::Finite(400.0), Object::Finite(-250.0), Object::Infinity] {
        let lens = Lens { object, ..far.clone() };
        let (mut in_front, mut between) = (0, 0);
        for seed in 0..60 {
            let added = mutate(MutationKind::AddSinglet, &lens, &rules, &mut seeded(seed));
            let Ok(mutant) = added else { continue };
            let rows = &mutant.lens.surfaces;
            if mutant.new_glass != [0] || rows[2].curvature != lens.surfaces[0].curvature {
                between += 1;
                assert!(mutant.log_ratio.is_some(), "{}", mutant.change);
                continue;
            }
            in_front += 1;
            match (object, mutant.lens.object) {
                (Object::Finite(before), Object::Finite(after)) => {
                    let length = rows[0].thickness + rows[1].thickness;
                    assert!((before - length - after).abs() < 1e-9, "{before} {length} {after}");
                    // To take it away again would move the object.
                    assert_eq!(mutant.log_ratio, None);
                }
                (Object::Infinity, Object::Infinity) => assert!(mutant.log_ratio.is_some()),
                (before, after) => panic!("{before:?} {after:?}"),
            }
        }
        assert!(in_front >= 3 && between >= 3, "{object:?}: {in_front} {between}");
    }
}

#[test]
fn kinds_are_proposed_in_proportion_to_their_weights() {
    let lens = bundled("double_gauss_nikkor_s_50");
    let weight = |kind: MutationKind| match kind {
        MutationKind::Flip => 3.0,
        MutationKind::RemoveSinglet => 6.0,
        MutationKind::AddSinglet => 1.0,
        _ => 0.0,
    };
    let weights = MutationKind::MUTATIONS.map(|kind| (kind, weight(kind))).to_vec();
    // With both ends fixed every mutation is refused at once, by its kind.
    let rules = SearchRules { weights, fixed_ends: [13, 0], ..generous() };
    let mut random = seeded(5);
    let kinds: Vec<MutationKind> =
        (0..300).map(|_| propose(&lens, &rules, &mut random).unwrap_err().kind).collect();
    // Four standard errors of a share of 300.
    for (kind, share) in [
        (MutationKind::Flip, 0.3f64),
        (MutationKind::RemoveSinglet, 0.6),
        (MutationKind::AddSinglet, 0.1),
    ] {
        let allowed = 4.0 * (share * (1.0 - share) / 300.0).sqrt();
        let found = kinds.iter().filter(|found| **found == kind).count() as f64 / 300.0;
        assert!((found - share).abs() < allowed, "{}: {found}", kind.name());
    }
}
