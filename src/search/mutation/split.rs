//! A cemented interface becomes an air gap between two surfaces of nearly its curvature.

use super::Kind;
use super::chance::{Length, log_normal, normal, pick};
use super::draft::{Back, Draft, Scene, hangs, is_of_medium, is_plain, sense};
use super::glue;
use crate::lens::{Lens, Medium, Parameter, Quantity, Row};
use crate::search::element::{Make, elements};
use crate::search::projection::Map;
use crate::search::{Random, Rules};

/// The random numbers of a new air gap.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cut {
    /// Half the difference of the curvatures in front and behind.
    pub(super) difference: f64,
    /// The air between them.
    pub(super) air: f64,
}

/// Cemented interfaces that may be split.
pub(super) fn places(lens: &Lens, rules: &Rules) -> Result<Vec<usize>, String> {
    let rows = lens.surfaces.len();
    let cemented = elements(lens).into_iter().filter(|e| matches!(e.make, Make::Glass(_)));
    let inner = cemented.flat_map(|element| element.first + 1..element.last);
    let found: Vec<usize> = inner
        .filter(|row| rules.allow(*row, rows) && is_plain(&lens.surfaces[*row]))
        .filter(|row| !hangs(lens, *row, |q| q == Quantity::Curvature))
        .collect();
    if found.is_empty() { Err("no plain cemented interface".to_owned()) } else { Ok(found) }
}

impl Cut {
    fn lengths(rules: &Rules, scale: f64) -> Length {
        Length::new(rules.air_center, 0.5 * scale / 50.0)
    }

    /// A tenth of the spread of a new element's curvatures: the two parts have strong power.
    fn spread(scale: f64) -> f64 {
        0.025 / scale
    }

    fn draw(scene: &Scene<'_>, random: &mut Random) -> Self {
        let difference = normal(Self::spread(scene.scale), random);
        Self { difference, air: Self::lengths(scene.rules, scene.scale).draw(random) }
    }

    pub(super) fn log_density(&self, rules: &Rules, scale: f64) -> Option<f64> {
        let air = Self::lengths(rules, scale).log_density(self.air)?;
        Some(air + log_normal(self.difference, Self::spread(scale)))
    }
}

/// Splits a cemented interface.
pub(super) fn draw(scene: &Scene<'_>, random: &mut Random) -> Result<Draft, String> {
    let places = places(&scene.lens, scene.rules)?;
    let row = pick(&places, random).copied().ok_or("no place")?;
    let cut = Cut::draw(scene, random);
    let mut draft = scene.draft(places.len());
    open(&mut draft, row, cut);
    draft.map = Map::Along;
    draft.what = format!("split the cemented surface {row}");
    let there = cut.log_density(scene.rules, scene.scale);
    let back = |there: f64| Back::by(Kind::Glue, 2f64.ln() - there);
    draft.back = there.filter(|_| glue::can(&draft.lens, row, scene.rules)).map(back);
    Ok(draft)
}

/// Makes two surfaces of one.
fn open(draft: &mut Draft, row: usize, cut: Cut) {
    let joint = draft.lens.surfaces[row].clone();
    let sense = sense(&draft.lens, row);
    let rear = Row {
        curvature: joint.curvature - cut.difference,
        stop: false,
        comment: String::new(),
        ..joint.clone()
    };
    draft.insert(row + 1, rear);
    draft.move_gap(row, row + 1);
    draft.lens.map_parameters(|p| {
        let of_glass = p.surface == row && is_of_medium(p.quantity);
        Some(if of_glass { Parameter { surface: row + 1, ..p } } else { p })
    });
    let front = &mut draft.lens.surfaces[row];
    front.curvature = joint.curvature + cut.difference;
    front.medium = Medium::Air;
    front.thickness = sense * cut.air;
    draft.origins[row].curvature = None;
    draft.settle(&[row, row + 1]);
}
