//! The rays of a beam without those that symmetry gives.
//!
//! In a centred lens an error of making does to the mirror image of a ray in the plane x = 0 the
//! mirror image of what it, or its opposite, does to the ray; likewise to a ray that is turned by 180°
//! about the axis. Only one of such rays is traced, and means over all are told from it.

use super::nominal::{half_turn, mirror_image};
use super::{Beam, ColourRays, FieldBeam, ToleranceScene};
use crate::lens::PerturbationKind;

/// The symmetry of the rays of one field, and of the field that is opposite to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct RaySymmetry {
    /// True if the rays come in pairs: one, then its mirror image.
    pub(super) mirrored: bool,
    /// True if the next field has the same rays, turned about the axis.
    pub(super) turned: bool,
}

/// The effect of an error on a lens that is seen in a mirror, and on one that is turned by 180°.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ErrorParity {
    /// True if the mirror image has the opposite error.
    pub(super) odd: bool,
    /// True if the turned lens has the opposite error.
    pub(super) lateral: bool,
}

impl ErrorParity {
    /// The parity of what is neither odd nor lateral: points and slopes of rays without errors.
    pub(super) const EVEN: Self = Self { odd: false, lateral: false };

    /// The parity of a kind of errors.
    pub(super) fn of(kind: PerturbationKind) -> Self {
        let odd = matches!(
            kind,
            PerturbationKind::SurfaceDecenterX
                | PerturbationKind::SurfaceTiltY
                | PerturbationKind::ElementDecenterX
                | PerturbationKind::ElementTiltY
                | PerturbationKind::ElementRollY
        );
        Self { odd, lateral: kind >= PerturbationKind::SurfaceDecenterX }
    }
}

impl RaySymmetry {
    /// True if the mean of an error's effect along an axis vanishes in every pair of rays.
    pub(super) fn cancels_mean(self, axis: usize, error: ErrorParity) -> bool {
        self.mirrored && (axis == 0) != error.odd
    }

    /// True if the mean product of the effects of two errors vanishes.
    pub(super) fn cancels_product(self, a: ErrorParity, b: ErrorParity) -> bool {
        (self.mirrored && a.odd != b.odd) || (self.turned && a.lateral != b.lateral)
    }
}

/// One field, standing for its opposite if that has the same rays.
pub(super) struct FoldedField<'a> {
    /// The number of the field, counted from 0.
    pub(super) number: usize,
    /// The weight of both.
    pub(super) weight: f64,
    pub(super) symmetry: RaySymmetry,
    pub(super) field: &'a FieldBeam,
}

impl FoldedField<'_> {
    /// The places of the rays of a wavelength that are traced, each with the weight that it has
    /// together with its mirror image.
    pub(super) fn rays(&self, colour: &ColourRays) -> impl Iterator<Item = (usize, f64)> {
        let step = if self.symmetry.mirrored { 2 } else { 1 };
        let weights = colour.weights.iter().copied().enumerate().step_by(step);
        weights.map(move |(i, weight)| (i, step as f64 * weight))
    }
}

/// The fields of a scene without those that stand for their opposite; all of them for a lens that is
/// not centred or has a GRIN medium.
pub(super) fn folded_fields(scene: &ToleranceScene) -> Vec<FoldedField<'_>> {
    let centred = scene.lens.systems.iter().all(|s| !s.has_poses() && !s.has_grin());
    let Beam { fields } = &scene.beam;
    let mut folded = Vec::new();
    let mut fields = fields.iter().enumerate().peekable();
    while let Some((number, field)) = fields.next() {
        let turned = fields.next_if(|(_, next)| centred && is_turned(field, next)).is_some();
        let mirrored = centred && field.colours.iter().all(is_mirrored);
        let weight = if turned { 2.0 * field.weight } else { field.weight };
        let symmetry = RaySymmetry { mirrored, turned };
        folded.push(FoldedField { number, weight, symmetry, field });
    }
    folded
}

/// True if each ray is followed by its mirror image with the same weight.
fn is_mirrored(colour: &ColourRays) -> bool {
    let weights = colour.weights.chunks(2).all(|pair| pair.len() == 2 && pair[0] == pair[1]);
    weights && colour.rays.chunks(2).all(|pair| mirror_image(pair[0]) == pair[1])
}

/// True if the second of two fields has the rays of the first one, turned about the axis.
fn is_turned(field: &FieldBeam, next: &FieldBeam) -> bool {
    let same = |(a, b): (&ColourRays, &ColourRays)| {
        a.wavelength == b.wavelength
            && a.weights == b.weights
            && a.rays.len() == b.rays.len()
            && a.rays.iter().zip(&b.rays).all(|(a, b)| half_turn(*a) == *b)
    };
    field.weight == next.weight
        && field.colours.len() == next.colours.len()
        && field.colours.iter().zip(&next.colours).all(same)
}
