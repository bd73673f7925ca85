//! The starting points of a design: lenses of the library at the focal length that is asked for,
//! two thin groups, and random lenses.

use super::LensRequirements;
use super::draft::{BeamPlan, DraftMerit, Freedom, LensDraft, USED_TERMS};
use super::judge::{asked_fields, asked_object, asked_wavelengths, is_aspheric};
use super::thin_structures::{ThinStructure, screened_structures};
use crate::files::{LibraryLens, library_lenses, scale_to_focal_length};
use crate::lens::{Lens, Medium, Row, blank, glass, paraxial_image_distance};
use crate::paraxial::{Beam, first_order};
use crate::search::Random;
use crate::search::element::piece_count;
use rand::RngExt as _;
use std::sync::atomic::{AtomicBool, Ordering};

/// A start with the name of where it comes from.
#[derive(Debug, Clone)]
pub(super) struct NamedDraft {
    pub(super) name: String,
    pub(super) draft: LensDraft,
}

/// The relative difference of all curvatures and gaps below which two lenses are the same.
const SAME: f64 = 0.05;

/// The lenses of the library that may be starts, the most promising ones first. `without` names
/// lenses that may not; neither may their copies.
pub(super) fn library_starts(asked: &LensRequirements, without: &[String]) -> Vec<NamedDraft> {
    let excluded: Vec<LensDraft> = library_lenses()
        .iter()
        .filter(|lens| without.contains(&lens.name))
        .filter_map(|lens| draft_of(&lens.open().ok()?, asked))
        .collect();
    let mut found: Vec<(f64, NamedDraft)> = Vec::new();
    for entry in library_lenses().iter().filter(|lens| !without.contains(&lens.name)) {
        let Some(distance) = distance(entry, asked) else { continue };
        let draft = entry.open().ok().and_then(|lens| draft_of(&lens, asked));
        let Some(draft) = draft else { continue };
        if !excluded.iter().any(|other| is_copy(&draft, other)) {
            found.push((distance, NamedDraft { name: entry.name.clone(), draft }));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.into_iter().map(|(_, start)| start).collect()
}

/// The distance of a lens from the requirements; `None` for one of another kind.
fn distance(entry: &LibraryLens, asked: &LensRequirements) -> Option<f64> {
    let one = |values: &[f64]| (values.len() == 1).then(|| values[0]);
    let f_number = one(entry.aperture.f_number()?)?;
    let field = one(entry.field.half_angle()?)?;
    one(&entry.focal_length)?;
    let too_many = entry.elements > asked.elements;
    if too_many || entry.mirrors > 0 || entry.elements == 0 {
        return None;
    }
    let missing = (asked.elements - entry.elements) as f64;
    let far = |a: f64, b: f64| (a / b).ln().abs();
    Some(
        far(f_number, asked.f_number)
            + 2.0 * far(field, asked.half_field().max(0.5))
            + 0.5 * missing,
    )
}

/// The draft of a lens at the focal length that is asked for; `None` if it is not one of plain
/// glass at one focal length, or breaks the number of elements.
pub(super) fn draft_of(lens: &Lens, asked: &LensRequirements) -> Option<LensDraft> {
    if !lens.zoom.is_empty() || !LensDraft::is_plain(lens) || piece_count(lens) > asked.elements {
        return None;
    }
    let mut lens = scaled(lens, asked)?;
    let solved = lens.resolve(0, lens.wavelengths[lens.primary()].um).ok()?;
    let first = first_order(&solved, &Beam::for_lens(&lens, 0)).ok()?;
    if first.efl? < 0.0 {
        return None;
    }
    let mut pupil = first.entrance_pupil.position?;
    for (row, surface) in lens.surfaces.iter_mut().zip(&solved.surfaces) {
        row.thickness = surface.thickness;
    }
    pupil -= without_planes(&mut lens);
    if asked.object.is_some() {
        let image = image_distance(&lens, asked)?;
        lens.surfaces.last_mut()?.thickness = image;
    }
    lens.surfaces.iter_mut().for_each(make_plain);
    if lens.surfaces.iter().filter(|row| is_aspheric(row)).count() > asked.aspheric_surfaces {
        for row in &mut lens.surfaces {
            (row.conic, row.asphere) = (0.0, Vec::new());
        }
    }
    Some(LensDraft { lens: cleared(lens, asked), pupil })
}

/// The lens at the focal length that is asked for. One for a near object that has it but for the thickness
/// of a lens stays as it is.
fn scaled(lens: &Lens, asked: &LensRequirements) -> Option<Lens> {
    let thin = asked.thin_focal_length();
    if asked.object.is_some() {
        let solved = lens.resolve(0, lens.wavelengths[lens.primary()].um).ok()?;
        let focal = first_order(&solved, &Beam::for_lens(lens, 0)).ok()?.efl?;
        if (focal / thin).ln().abs() < THICK {
            return Some(lens.clone());
        }
    }
    scale_to_focal_length(lens, thin).ok()
}

/// The distance behind the last vertex of the image of a near object, in mm; `None` if it is not real.
fn image_distance(lens: &Lens, asked: &LensRequirements) -> Option<f64> {
    let system = lens.resolve(0, lens.wavelengths[lens.primary()].um).ok()?;
    let image = paraxial_image_distance(&system, asked_object(asked));
    (image > 0.0 && image < 10.0 * asked.track).then_some(image)
}

/// The logarithm of the ratio of the focal length of a lens for a near object to that of a thin one up to
/// which it stays.
const THICK: f64 = 0.25;

/// Removes planes in air, and returns the length in front of the first refracting surface.
fn without_planes(lens: &mut Lens) -> f64 {
    let mut rows: Vec<Row> = Vec::new();
    let mut front = 0.0;
    for row in lens.surfaces.drain(..) {
        let air = rows.last().is_none_or(|before: &Row| before.medium == Medium::Air);
        if air && row.medium == Medium::Air {
            match rows.last_mut() {
                Some(before) => before.thickness += row.thickness,
                None => front += row.thickness,
            }
        } else {
            rows.push(row);
        }
    }
    lens.surfaces = rows;
    front
}

/// Makes a row one of a draft: without rim, with a model glass.
fn make_plain(row: &mut Row) {
    (row.semi_diameter, row.obstruction, row.stop) = (None, None, false);
    row.apertures.clear();
    if let Medium::Glass(name) = &row.medium
        && let Some(glass) = glass::find(name)
    {
        row.medium = Medium::Model { nd: glass.nd, vd: glass.vd };
    }
}

/// The lens without what a draft does not need.
pub(super) fn cleared(lens: Lens, asked: &LensRequirements) -> Lens {
    let mut lens = Lens {
        object: asked_object(asked),
        fields: asked_fields(asked, &asked.fields),
        wavelengths: asked_wavelengths(asked),
        variables: Vec::new(),
        pickups: Vec::new(),
        image_solve: None,
        merit: None,
        ..lens
    };
    if let Some(first) = lens.surfaces.first_mut() {
        first.stop = true;
    }
    lens
}

/// True if two drafts have the same surfaces but for small changes.
fn is_copy(a: &LensDraft, b: &LensDraft) -> bool {
    let [a, b] = [&a.lens.surfaces, &b.lens.surfaces];
    if a.len() != b.len() {
        return false;
    }
    let most = |of: fn(&Row) -> f64| b.iter().map(|row| of(row).abs()).fold(0.0, f64::max);
    let near =
        |of: fn(&Row) -> f64| a.iter().zip(b).all(|(a, b)| (of(a) - of(b)).abs() < SAME * most(of));
    near(|row| row.curvature) && near(|row| row.thickness)
}

/// The glasses of constructed starts: crowns and flints.
const CROWNS: [(f64, f64); 4] = [(1.5168, 64.17), (1.6204, 60.3), (1.6968, 55.5), (1.788, 47.4)];
const FLINTS: [(f64, f64); 4] = [(1.6727, 32.2), (1.7282, 28.3), (1.7847, 26.1), (1.62, 36.4)];

/// Random lenses of a number of elements, a third of them screened as thin lenses, each the best of several by its merit at a small aperture
/// and field; fewer once `stop` is true.
pub(super) fn random_starts(
    asked: &LensRequirements,
    count: usize,
    tries: usize,
    random: &mut Random,
    stop: &AtomicBool,
) -> Vec<NamedDraft> {
    let mut found = Vec::new();
    let draws = THIN_DRAWS * count;
    let thin = screened_structures(asked, draws, count.div_ceil(3), random);
    for i in (0..count).take_while(|_| !stop.load(Ordering::Relaxed)) {
        let tried = (0..tries).filter_map(|_| {
            let draft = match (i % 3, thin.get(i / 3)) {
                (2, Some(structure)) => lens_of(structure, asked, random)?,
                (0, _) => two_group_lens(asked, random)?,
                _ => random_lens(asked, random)?,
            };
            Some((screened(&draft, asked)?, draft))
        });
        let best = tried.min_by(|a, b| a.0.total_cmp(&b.0));
        let name = format!("random {}", i + 1);
        found.extend(best.map(|(_, draft)| NamedDraft { name, draft }));
    }
    found
}

/// The thin lenses that are screened for each random start.
const THIN_DRAWS: usize = 8192;

/// A lens of thick elements with the powers and the gaps of thin ones, and random glasses and bendings.
fn lens_of(
    structure: &ThinStructure,
    asked: &LensRequirements,
    random: &mut Random,
) -> Option<LensDraft> {
    let mut rows = Vec::new();
    let thick = (0.05 * asked.thin_focal_length()).max(1.5 * asked.glass_center);
    for lens in &structure.lenses {
        let gap = (lens.gap - thick).max(asked.air_center);
        // Lenses in contact may be cemented.
        let cemented = if lens.gap < thick { 0.5 } else { 0.0 };
        let element = ThinElement { crown: lens.power > 0.0, power: lens.power, gap, cemented };
        push_element(&mut rows, &element, asked, random);
    }
    focused(rows, asked, random)
}

/// The merit of a draft at a small aperture and field; `None` if its beams do not get through.
fn screened(draft: &LensDraft, asked: &LensRequirements) -> Option<f64> {
    let plan = BeamPlan { difficulty: [0.3, 0.4], ..BeamPlan::full(0.1) };
    let freedom = Freedom { glasses: false, aspheric_surfaces: 0, terms: USED_TERMS, pupil: false };
    let mut merit = DraftMerit::new(draft, asked, &plan, freedom)?;
    Some(merit.evaluate(&merit.start())?.value)
}

/// An element of a random lens.
struct ThinElement {
    crown: bool,
    /// Its power, in 1/mm.
    power: f64,
    /// The air behind it, in mm.
    gap: f64,
    /// The chance that it is cemented to the element in front of it.
    cemented: f64,
}

/// A random lens whose last curvature gives it the focal length; almost half of the elements are
/// cemented to the one before.
fn random_lens(asked: &LensRequirements, random: &mut Random) -> Option<LensDraft> {
    let f = asked.thin_focal_length();
    let free = (asked.track - asked.back_focus).max(0.1 * f);
    let mut rows = Vec::new();
    for i in 0..piece_number(asked, random) {
        let crown = random.random::<f64>() < if i % 2 == 0 { 0.75 } else { 0.3 };
        let power = if crown { 1.0 } else { -1.0 } * (0.5 + 2.0 * random.random::<f64>()) / f;
        let gap = (0.02 + 0.2 * random.random::<f64>().powi(2)) * free;
        push_element(&mut rows, &ThinElement { crown, power, gap, cemented: 0.4 }, asked, random);
    }
    focused(rows, asked, random)
}

/// A random lens of two groups that have the focal length and the back focus as thin lenses: a
/// negative group in front where the back focus exceeds the focal length, a positive one otherwise.
fn two_group_lens(asked: &LensRequirements, random: &mut Random) -> Option<LensDraft> {
    let f = asked.thin_focal_length();
    let pieces = piece_number(asked, random);
    if pieces < 2 {
        return None;
    }
    let back = asked.back_focus.max(0.05 * f) * (1.0 + 0.3 * random.random::<f64>());
    let longest = asked.track - back;
    let distance = longest * (0.3 + 0.6 * random.random::<f64>());
    let powers = group_powers(f, back, distance);
    let front = random.random_range(1..pieces);
    let mut rows: Vec<Row> = Vec::new();
    let mut first_length = 0.0;
    for (power, count) in powers.into_iter().zip([front, pieces - front]) {
        let start = rows.len();
        for element in group(power, count, asked, random) {
            push_element(&mut rows, &element, asked, random);
        }
        let end = rows.len() - 1;
        let length: f64 = rows[start..end].iter().map(|row| row.thickness).sum();
        if start == 0 {
            first_length = length;
        } else {
            let apart = distance - 0.5 * (first_length + length);
            rows[start - 1].thickness = apart.max(0.02 * f);
        }
    }
    focused(rows, asked, random)
}

/// The powers of two thin lenses at a distance `d` with the focal length `f` and the back focus `b`:
/// `(f − b) / (d f)` and `(b + d − f) / (d b)` (Kingslake, *Lens Design Fundamentals*, 3.1).
fn group_powers(f: f64, b: f64, d: f64) -> [f64; 2] {
    [(f - b) / (d * f), (b + d - f) / (d * b)]
}

/// The elements of a group of this power: one of the opposite sign and of the opposite kind of glass
/// among others that share the rest.
fn group(
    power: f64,
    count: usize,
    asked: &LensRequirements,
    random: &mut Random,
) -> Vec<ThinElement> {
    let f = asked.focal_length;
    let corrector = (count > 1).then(|| random.random_range(0..count));
    let opposite = if corrector.is_some() { 0.2 + 1.2 * random.random::<f64>() } else { 0.0 };
    // A group without power still bends: its elements have those of a weak lens.
    let size = power.abs().max(0.3 / f).copysign(power);
    let share = size * (1.0 + opposite) / (count.max(2) - 1) as f64;
    let element = |i: usize| {
        let is_corrector = corrector == Some(i);
        let power = if is_corrector { -opposite * size } else { share };
        let gap = (0.01 + 0.08 * random.random::<f64>().powi(2)) * f;
        ThinElement { crown: power > 0.0, power, gap, cemented: if i > 0 { 0.4 } else { 0.0 } }
    };
    (0..count).map(element).collect()
}

/// The number of pieces of a random lens.
fn piece_number(asked: &LensRequirements, random: &mut Random) -> usize {
    let elements = asked.elements.min(8);
    if elements > 2 { elements - random.random_range(0..2) } else { elements }
}

/// Appends an element of random glass and bending.
fn push_element(
    rows: &mut Vec<Row>,
    element: &ThinElement,
    asked: &LensRequirements,
    random: &mut Random,
) {
    let f = asked.focal_length;
    let thick = (0.05 * f).max(1.5 * asked.glass_center);
    let list = if element.crown { CROWNS } else { FLINTS };
    let (nd, vd) = list[random.random_range(0..list.len())];
    let bend = 3.0 * (random.random::<f64>() - 0.5) / f;
    let curvature = element.power / (nd - 1.0);
    let cemented = random.random::<f64>() < element.cemented;
    let glass = Medium::Model { nd, vd };
    let last = rows.last_mut().filter(|_| cemented);
    let front = if let Some(last) = last {
        (last.medium, last.thickness) = (glass, thick);
        last.curvature
    } else {
        let front = bend + 0.5 * curvature;
        rows.push(Row { curvature: front, thickness: thick, medium: glass, ..Row::default() });
        front
    };
    rows.push(Row { curvature: front - curvature, thickness: element.gap, ..Row::default() });
}

/// The lens of these rows with the focal length and the image plane that are asked for.
fn focused(rows: Vec<Row>, asked: &LensRequirements, random: &mut Random) -> Option<LensDraft> {
    let lens = cleared(Lens { surfaces: rows, ..blank() }, asked);
    let system = lens.resolve(0, lens.wavelengths[lens.primary()].um).ok()?;
    let (mut y, mut nu, mut before) = (1.0, asked.object_slope(), 1.0);
    let last = lens.surfaces.len() - 1;
    for surface in &system.surfaces[..last] {
        nu -= y * (surface.index - before) * surface.shape.curvature();
        before = surface.index;
        y += surface.thickness * nu / before;
    }
    // nu' = nu - y (1 - n) c = -1/f
    let curvature = (nu + 1.0 / asked.focal_length) / (y * (1.0 - before));
    let back = y * asked.focal_length;
    let good = curvature.abs() < 5.0 / asked.focal_length && back > 0.3 * asked.back_focus;
    if !good || back > asked.track {
        return None;
    }
    let mut lens = lens;
    (lens.surfaces[last].curvature, lens.surfaces[last].thickness) = (curvature, back);
    let length: f64 = lens.surfaces[..last].iter().map(|row| row.thickness).sum();
    let pupil = length * random.random::<f64>();
    Some(LensDraft { lens, pupil })
}

/// Cemented achromats by the thin-lens formulas, with either glass in front, in several bendings.
pub(super) fn achromats(asked: &LensRequirements) -> Vec<NamedDraft> {
    let f = asked.thin_focal_length();
    let mut found = Vec::new();
    for (crown_first, bend) in [(true, 0.0), (true, 1.5), (false, 0.0), (false, 1.5)] {
        let ((n1, v1), (n2, v2)) = (CROWNS[0], FLINTS[0]);
        let [positive, negative] =
            [v1 / (v1 - v2) / f / (n1 - 1.0), -v2 / (v1 - v2) / f / (n2 - 1.0)];
        let ((a, first), (b, second)) = if crown_first {
            ((positive, (n1, v1)), (negative, (n2, v2)))
        } else {
            ((negative, (n2, v2)), (positive, (n1, v1)))
        };
        let front = 0.5 * a + bend / f;
        let thick = 0.04 * f;
        let row = |curvature: f64, (nd, vd): (f64, f64)| Row {
            curvature,
            thickness: thick,
            medium: Medium::Model { nd, vd },
            ..Row::default()
        };
        let image = asked.focal_length;
        let last = Row { curvature: front - a - b, thickness: image, ..Row::default() };
        let rows = vec![row(front, first), row(front - a, second), last];
        let lens = cleared(Lens { surfaces: rows, ..blank() }, asked);
        let name =
            if crown_first { "achromat, crown in front" } else { "achromat, flint in front" };
        found.push(NamedDraft { name: name.to_owned(), draft: LensDraft { lens, pupil: 0.0 } });
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::design::LensSpecification;
    use rand::SeedableRng as _;

    fn requirements() -> LensRequirements {
        let spec: LensSpecification = serde_json::from_str(
            r#"{"focal_length_mm": 80.0, "f_number": 4.0, "half_field_deg": 10.0, "max_elements": 6}"#,
        )
        .unwrap();
        LensRequirements::complete(&spec).unwrap().0
    }

    fn focal_length(draft: &LensDraft, um: f64) -> f64 {
        let system = draft.lens.resolve(0, um).unwrap();
        let (mut y, mut nu, mut before) = (1.0, 0.0, 1.0);
        for surface in &system.surfaces[..system.surfaces.len() - 1] {
            nu -= y * (surface.index - before) * surface.shape.curvature();
            before = surface.index;
            y += surface.thickness * nu / before;
        }
        -1.0 / nu
    }

    #[test]
    fn random_lenses_have_the_focal_length_and_fit_into_the_track() {
        let (asked, mut random) = (requirements(), Random::seed_from_u64(4));
        let drafts: Vec<_> = (0..200).filter_map(|_| random_lens(&asked, &mut random)).collect();
        assert!(drafts.len() > 20, "{}", drafts.len());
        for draft in &drafts {
            let um = draft.lens.wavelengths[draft.lens.primary()].um;
            assert!((focal_length(draft, um) / 80.0 - 1.0).abs() < 1e-9);
            let rows = &draft.lens.surfaces;
            let back = rows.last().unwrap().thickness;
            assert!(back <= asked.track && back > 0.3 * asked.back_focus, "{back}");
            assert!(rows.iter().all(|row| row.thickness > 0.0), "{rows:?}");
        }
        let elements = |draft: &LensDraft| piece_count(&draft.lens);
        assert!(drafts.iter().all(|draft| (1..=asked.elements).contains(&elements(draft))));
    }

    #[test]
    fn two_groups_have_the_focal_length_and_a_long_back_focus_from_a_negative_front() {
        let spec: LensSpecification = serde_json::from_str(
            r#"{"focal_length_mm": 28.0, "f_number": 3.5, "half_field_deg": 33.0,
                "min_back_focus_mm": 37.5, "max_track_mm": 90.5, "max_elements": 6}"#,
        )
        .unwrap();
        let asked = LensRequirements::complete(&spec).unwrap().0;
        let mut random = Random::seed_from_u64(5);
        let drafts: Vec<_> = (0..400).filter_map(|_| two_group_lens(&asked, &mut random)).collect();
        assert!(drafts.len() > 20, "{}", drafts.len());
        for draft in &drafts {
            let um = draft.lens.wavelengths[draft.lens.primary()].um;
            assert!((focal_length(draft, um) / 28.0 - 1.0).abs() < 1e-9);
            assert!(draft.lens.surfaces.iter().all(|row| row.thickness > 0.0));
            assert!((2..=6).contains(&piece_count(&draft.lens)));
        }
        let [f, b, d] = [28.0, 38.0, 45.0];
        let [front, rear] = group_powers(f, b, d);
        // The height of a ray at the rear lens, over the slope behind it, is the back focus.
        let (height, slope) = (1.0 - d * front, front + rear * (1.0 - d * front));
        assert!(front < 0.0 && (slope * f - 1.0).abs() < 1e-12);
        assert!((height / slope - b).abs() < 1e-9);
    }

    #[test]
    fn achromats_have_their_power_and_no_colour_as_thin_lenses() {
        for start in achromats(&requirements()) {
            let mut draft = start.draft;
            draft.lens.surfaces[..2].iter_mut().for_each(|row| row.thickness = 0.0);
            let [blue, yellow, red] =
                [0.4861327, 0.5875618, 0.6562725].map(|um| focal_length(&draft, um));
            assert!((yellow / 80.0 - 1.0).abs() < 1e-9, "{}: {yellow}", start.name);
            assert!((blue / red - 1.0).abs() < 1e-4, "{}: {blue} {red}", start.name);
        }
    }

    #[test]
    fn the_nearest_lenses_of_the_library_come_first() {
        let asked = requirements();
        let named = |name: &str| library_lenses().iter().find(|entry| entry.name == name).unwrap();
        let tessar = named("tessar_50_f28");
        assert_eq!(tessar.elements, 4);
        let f_number = tessar.aperture.f_number().unwrap()[0];
        let half = tessar.field.half_angle().unwrap()[0];
        let expected = (4.0 / f_number).ln() + 2.0 * (half / 10.0).ln().abs() + 0.5 * (6.0 - 4.0);
        let found = distance(tessar, &asked).unwrap();
        assert!((found - expected).abs() < 1e-12, "{found}, not {expected}");
        assert_eq!(distance(named("zoom_tamron_28_75_f28"), &asked), None);
        let starts = library_starts(&asked, &[]);
        let far = |start: &NamedDraft| distance(named(&start.name), &asked).unwrap();
        assert!(starts.windows(2).all(|pair| far(&pair[0]) <= far(&pair[1])));
    }

    #[test]
    fn a_copy_has_nearly_the_same_surfaces() {
        let original = achromats(&requirements()).swap_remove(0).draft;
        let changed = |change: fn(&mut Row)| {
            let mut other = original.clone();
            change(&mut other.lens.surfaces[1]);
            other
        };
        assert!(is_copy(&original, &original));
        assert!(is_copy(&changed(|row| row.curvature *= 1.01), &original));
        assert!(is_copy(&changed(|row| row.thickness *= 1.01), &original));
        assert!(!is_copy(&changed(|row| row.curvature *= 1.5), &original));
        assert!(!is_copy(&changed(|row| row.thickness += 20.0), &original));
        let mut longer = original.clone();
        longer.lens.surfaces.push(Row::default());
        assert!(!is_copy(&longer, &original));
    }

    /// Mirrors, gradients and materials without an Abbe number have no place in a draft.
    #[test]
    fn drafts_are_made_of_plain_glasses_alone() {
        let asked = requirements();
        let found = crate::files::bundled_lenses().iter().filter_map(|bundled| {
            let lens = crate::files::json::read(bundled.text, bundled.name).unwrap();
            Some((
                bundled.name,
                draft_of(&lens, &LensRequirements { elements: 20, ..asked.clone() })?,
            ))
        });
        let mut count = 0;
        for (name, draft) in found {
            let is_plain = |medium: &Medium| {
                matches!(medium, Medium::Air | Medium::Glass(_) | Medium::Model { .. })
            };
            assert!(draft.lens.surfaces.iter().all(|row| is_plain(&row.medium)), "{name}");
            count += 1;
        }
        assert!(count > 5, "{count}");
    }
}
