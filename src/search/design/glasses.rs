//! Glasses of the catalogue in place of model glasses, and their exchange.

use super::LensRequirements;
use super::draft::LensDraft;
use crate::lens::{Lens, Medium, glass};
use crate::search::Random;
use rand::RngExt as _;

/// The differences of index and Abbe number that count as one unit of distance.
const UNIT: [f64; 2] = [0.01, 1.2];
/// The number of glasses that are tried in place of one.
const TRIED: usize = 10;

/// True if every glass is permitted.
pub(super) fn in_catalogue(lens: &Lens, asked: &LensRequirements) -> bool {
    lens.surfaces.iter().all(|row| match &row.medium {
        Medium::Model { nd, vd } => asked.glasses.allows_model(*nd, *vd),
        _ => true,
    })
}

/// The permitted glasses with data at every wavelength, without twins.
fn permitted(asked: &LensRequirements) -> Vec<&'static glass::Glass> {
    glass::distinct(glass::catalogue().iter().filter(|glass| {
        let known = asked.wavelengths.iter().all(|(um, _)| glass.index(*um).is_some());
        known && asked.glasses.allows(&glass.full_name())
    }))
}

/// The permitted glasses, the nearest to an index and an Abbe number first.
fn by_distance(nd: f64, vd: f64, asked: &LensRequirements) -> Vec<&'static glass::Glass> {
    let mut all = permitted(asked);
    let distance =
        |glass: &glass::Glass| ((glass.nd - nd) / UNIT[0]).hypot((glass.vd - vd) / UNIT[1]);
    all.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    all
}

/// The draft with the nearest permitted glasses in place of those that are not permitted.
pub(super) fn snapped(draft: &LensDraft, asked: &LensRequirements) -> LensDraft {
    let mut draft = draft.clone();
    for row in &mut draft.lens.surfaces {
        if let Medium::Model { nd, vd } = row.medium
            && !asked.glasses.allows_model(nd, vd)
            && let Some(nearest) = by_distance(nd, vd, asked).first()
        {
            row.medium = Medium::Glass(nearest.full_name());
        }
    }
    draft
}

/// Drafts with another glass in place of that of an element drawn at random: the nearest ones, and
/// as many drawn from farther away.
pub(super) fn exchanged(
    draft: &LensDraft,
    asked: &LensRequirements,
    random: &mut Random,
) -> Vec<LensDraft> {
    let rows: Vec<(usize, &'static glass::Glass)> = draft
        .lens
        .surfaces
        .iter()
        .enumerate()
        .filter_map(|(i, row)| match &row.medium {
            Medium::Glass(name) => Some((i, glass::find(name)?)),
            _ => None,
        })
        .collect();
    if rows.is_empty() {
        return Vec::new();
    }
    let (row, now) = rows[random.random_range(0..rows.len())];
    let near = by_distance(now.nd, now.vd, asked);
    let others: Vec<&glass::Glass> =
        near.into_iter().filter(|glass| glass.full_name() != now.full_name()).collect();
    let mut chosen: Vec<&glass::Glass> = others.iter().take(TRIED / 2).copied().collect();
    let far = others.len().min(60);
    if far > TRIED {
        chosen.extend((0..TRIED / 2).map(|_| others[random.random_range(TRIED / 2..far)]));
    }
    let with = |glass: &glass::Glass| {
        let mut draft = draft.clone();
        draft.lens.surfaces[row].medium = Medium::Glass(glass.full_name());
        draft
    };
    chosen.into_iter().map(with).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::lens::{Row, blank};
    use crate::search::design::LensSpecification;
    use rand::SeedableRng as _;

    fn requirements(glasses: &str) -> LensRequirements {
        let spec = format!(
            r#"{{"focal_length_mm": 50.0, "f_number": 4.0, "half_field_deg": 5.0{glasses}}}"#
        );
        let spec: LensSpecification = serde_json::from_str(&spec).unwrap();
        LensRequirements::complete(&spec).unwrap().0
    }

    fn draft(medium: Medium) -> LensDraft {
        let glass = Row { medium, thickness: 3.0, curvature: 0.02, ..Row::default() };
        let surfaces = vec![glass, Row { thickness: 40.0, ..Row::default() }];
        LensDraft { lens: Lens { surfaces, ..blank() }, pupil: 0.0 }
    }

    #[test]
    fn permitted_glasses_have_no_twins() {
        let all = permitted(&requirements(""));
        assert!(all.len() > 100, "{}", all.len());
        for (i, a) in all.iter().enumerate() {
            assert!(!all[i + 1..].iter().any(|b| a.is_twin_of(b)), "{}", a.full_name());
        }
        let two = requirements(r#", "glasses": ["SCHOTT N-BK7", "SCHOTT N-SF5"]"#);
        let mut names: Vec<String> =
            permitted(&two).iter().map(|glass| glass.full_name()).collect();
        names.sort();
        assert_eq!(names, ["SCHOTT N-BK7", "SCHOTT N-SF5"]);
        assert_eq!(by_distance(1.67, 32.0, &two)[0].full_name(), "SCHOTT N-SF5");
        assert_eq!(by_distance(1.52, 64.0, &two)[0].full_name(), "SCHOTT N-BK7");
    }

    #[test]
    fn a_model_glass_is_replaced_by_the_nearest_of_the_catalogue() {
        let asked = requirements("");
        let model = draft(Medium::Model { nd: 1.5169, vd: 64.1 });
        assert!(!in_catalogue(&model.lens, &asked));
        let snapped = snapped(&model, &asked);
        assert!(in_catalogue(&snapped.lens, &asked));
        let Medium::Glass(name) = &snapped.lens.surfaces[0].medium else { panic!("{snapped:?}") };
        let found = glass::find(name).unwrap();
        assert!((found.nd - 1.5168).abs() < 1e-3 && (found.vd - 64.17).abs() < 0.5, "{name}");
    }

    #[test]
    fn an_exchange_tries_other_glasses_the_nearest_first() {
        let asked = requirements("");
        let start = draft(Medium::Glass("SCHOTT N-BK7".to_owned()));
        let others = exchanged(&start, &asked, &mut Random::seed_from_u64(1));
        assert_eq!(others.len(), TRIED);
        let distance = |other: &LensDraft| {
            let Medium::Glass(name) = &other.lens.surfaces[0].medium else { panic!("{other:?}") };
            assert_ne!(name, "SCHOTT N-BK7");
            let glass = glass::find(name).unwrap();
            ((glass.nd - 1.5168) / UNIT[0]).hypot((glass.vd - 64.17) / UNIT[1])
        };
        let near: Vec<f64> = others[..TRIED / 2].iter().map(distance).collect();
        assert!(near.is_sorted(), "{near:?}");
        assert!(others[TRIED / 2..].iter().all(|other| distance(other) >= near[TRIED / 2 - 1]));
        let model = draft(Medium::Model { nd: 1.5, vd: 60.0 });
        assert!(exchanged(&model, &asked, &mut Random::seed_from_u64(1)).is_empty());
    }
}
