//! Splits a cemented interface into an air gap between two surfaces of similar curvature.

use super::distributions::{ShiftedExponential, choose, normal_log_density, sample_normal};
use super::draft::{MutationContext, MutationDraft, ReverseMove};
use super::glue;
use super::kind::MutationKind;
use super::queries::{has_pickup, is_of_medium, is_plain};
use super::record::StructureChange;
use super::refusal::Refusal;
use crate::lens::{Lens, Medium, Parameter, Quantity, Row};
use crate::search::element::{ElementKind, elements};
use crate::search::projection::ProjectionMap;
use crate::search::{Random, SearchRules};

/// The cemented interfaces that may be split.
pub(super) fn sites(lens: &Lens, rules: &SearchRules) -> Result<Vec<usize>, Refusal> {
    let rows = lens.surfaces.len();
    let cemented = elements(lens).into_iter().filter(|e| matches!(e.kind, ElementKind::Glass(_)));
    let inner = cemented.flat_map(|element| element.first + 1..element.last);
    let found: Vec<usize> = inner
        .filter(|row| rules.may_change(*row, rows) && is_plain(&lens.surfaces[*row]))
        .filter(|row| !has_pickup(lens, *row, |q| q == Quantity::Curvature))
        .collect();
    if found.is_empty() { Err(Refusal::NoCementedInterface) } else { Ok(found) }
}

/// Splits a cemented interface.
pub(super) fn draw(
    context: &MutationContext<'_>,
    random: &mut Random,
) -> Result<MutationDraft, Refusal> {
    let sites = sites(&context.lens, context.rules)?;
    let row = choose(&sites, random).copied().ok_or(Refusal::NoCementedInterface)?;
    let cut = SplitDraw::draw(context.rules, context.scale, random);
    let mut draft = context.start_draft(sites.len());
    insert_air_gap(&mut draft, row, cut);
    draft.map = ProjectionMap::AlongNormals;
    draft.change = StructureChange::Split { surface: row.into() };
    let there = cut.log_density(context.rules, context.scale);
    let back = |there: f64| ReverseMove::new(MutationKind::Glue, 2f64.ln() - there);
    draft.reverse = there.filter(|_| glue::can_glue(&draft.lens, row, context.rules)).map(back);
    Ok(draft)
}

/// Replaces a surface by two.
fn insert_air_gap(draft: &mut MutationDraft, row: usize, cut: SplitDraw) {
    let joint = draft.lens.surfaces[row].clone();
    let sense = draft.lens.light_direction(row);
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
    draft.inherit_variables(&[row, row + 1]);
}

/// The random numbers of a new air gap.
#[derive(Debug, Clone, Copy)]
pub(super) struct SplitDraw {
    /// Half the difference of the curvatures in front and behind.
    pub(super) difference: f64,
    /// The air space between them.
    pub(super) air: f64,
}

impl SplitDraw {
    fn air_distribution(rules: &SearchRules, scale: f64) -> ShiftedExponential {
        ShiftedExponential::new(rules.air_center, 0.5 * scale / 50.0)
    }

    /// A tenth of that of a new element: the two parts have strong power.
    fn curvature_deviation(scale: f64) -> f64 {
        0.025 / scale
    }

    pub(super) fn draw(rules: &SearchRules, scale: f64, random: &mut Random) -> Self {
        let difference = sample_normal(Self::curvature_deviation(scale), random);
        Self { difference, air: Self::air_distribution(rules, scale).draw(random) }
    }

    pub(super) fn log_density(&self, rules: &SearchRules, scale: f64) -> Option<f64> {
        let air = Self::air_distribution(rules, scale).log_density(self.air)?;
        Some(air + normal_log_density(self.difference, Self::curvature_deviation(scale)))
    }
}
