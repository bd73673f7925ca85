//! The boundary of a pupil that is its own mirror image over a whole turn, for a lens that is about to
//! lose its symmetry: an error of making moves the two halves of an edge apart.

use super::boundary::{Boundary, BoundaryArc};
use super::kind::RegionKind;
use std::f64::consts::{PI, TAU};

impl RegionKind {
    /// The same form, its boundary over a whole turn.
    #[must_use]
    pub fn over_whole_turn(&self) -> Self {
        match self {
            Self::StarShaped(boundary) => Self::StarShaped(boundary.over_whole_turn()),
            other => other.clone(),
        }
    }
}

impl Boundary {
    fn over_whole_turn(&self) -> Self {
        if self.samples.last().is_none_or(|(azimuth, _)| *azimuth > 1.5 * PI) {
            return self.clone();
        }
        let mut samples = self.samples.clone();
        samples.extend(self.samples.iter().rev().skip(1).map(|(a, edge)| (TAU - a, *edge)));
        Self { arcs: mirrored_arcs(&self.arcs), samples, ..self.clone() }
    }
}

/// The arcs of a half turn and their mirror images: those that the line of symmetry cuts are joined, the
/// first one from a negative azimuth.
fn mirrored_arcs(half: &[BoundaryArc]) -> Vec<BoundaryArc> {
    let [first, inner @ .., last] = half else {
        return half.iter().map(|arc| BoundaryArc { from: 0.0, to: TAU, ..*arc }).collect();
    };
    let image = |arc: &BoundaryArc| BoundaryArc { from: TAU - arc.to, to: TAU - arc.from, ..*arc };
    let mut arcs = vec![BoundaryArc { from: -first.to, ..*first }];
    arcs.extend_from_slice(inner);
    arcs.push(BoundaryArc { to: TAU - last.from, ..*last });
    arcs.extend(inner.iter().rev().map(image));
    arcs
}

#[cfg(test)]
mod tests {
    use crate::files::{bundled_lenses, json};
    use crate::lens::Pose;
    use crate::pupil::{PupilMoments, RayModel, Region};

    /// The pupil of a lens of which a surface is displaced by nothing worth the name, found from the half
    /// of it in the symmetric lens.
    #[test]
    fn a_boundary_over_the_whole_turn_has_the_light_of_its_half() {
        for name in ["double_gauss_nikkor_s_50", "cooke_triplet_100_f27"] {
            let found = bundled_lenses().iter().find(|own| own.name == name).unwrap();
            let lens = json::read(found.text, name).unwrap();
            let model = RayModel::from_lens(&lens, 0).unwrap();
            let mut systems: Vec<_> = model.channels.iter().map(|c| c.system.clone()).collect();
            for system in &mut systems {
                system.surfaces[1].pose = Some(Pose::new([1e-13, 0.0], [0.0; 2]));
            }
            let moved = model.with_systems(&systems).unwrap();
            for field in &model.fields {
                let half = Region::new(model.launch(*field, model.primary).unwrap());
                let launch = half.launch.to_fixed().launch(&moved);
                let whole = Region::track(&half.kind.over_whole_turn(), launch);
                let light =
                    |region: &Region<'_>| -> PupilMoments { region.moments(&region.nodes(8)) };
                let [a, b] = [light(&half), light(&whole)];
                assert!((a.area / b.area - 1.0).abs() < 1e-9, "{name}: {} {}", a.area, b.area);
                assert!((a.spread / b.spread - 1.0).abs() < 1e-7, "{name}: {a:?} {b:?}");
            }
        }
    }
}
