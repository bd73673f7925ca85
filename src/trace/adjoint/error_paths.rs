//! Derivatives of optical paths by errors of making.
//!
//! By Fermat's principle a ray that bends changes its optical path to second order only. To first order
//! an error changes it by what it does to a ray that is held: a surface whose point of incidence moves
//! by `d` by `(k − k')·d`, with the optical directions `k` in front and `k'` behind, a gap by `k'` along
//! the axis, an index by the way in its medium; and the motion of the end, where the ray has the optical
//! direction `k`, adds `k` times that (Hopkins and Tiziani, *British Journal of Applied Physics* 17,
//! 1966). No derivative of a ray is needed.

use super::error_lanes::{ErrorColumns, HitColumns, Lane, TracedLanes};
use super::errors::{AdjointColumns, ErrorNumber, ErrorRows, add_lanes};
use crate::trace::Tracer;
use crate::trace::batch::Rays;

/// The derivatives of the optical paths of rays by errors of making.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorPaths {
    /// For each number that where the end of the ray is held in the frame of the image plane.
    rows: ErrorRows,
}

impl ErrorPaths {
    /// The derivatives of all paths by a number, the ends of rays being held in the frame of the image plane.
    pub fn row(&self, surface: usize, number: ErrorNumber) -> &[f64] {
        self.rows.row(0, surface, number)
    }
}

impl Tracer<f64> {
    /// The derivatives of the optical paths of rays that all arrive by errors of making; zeros for a lens
    /// without them ([`Tracer::has_error_slopes`]).
    pub fn error_paths(&self, rays: &Rays<f64>) -> ErrorPaths {
        let rows = ErrorRows::zeros(rays.len(), self.surfaces(), 1);
        let mut found = ErrorPaths { rows };
        let mut tape = self.empty_tape();
        self.visit_lanes(
            rays,
            #[inline(always)]
            |traced| self.lane_paths(traced, &mut tape, &mut found.rows),
        );
        found
    }

    #[inline(always)]
    fn lane_paths(&self, traced: &TracedLanes, tape: &mut [HitColumns<f64>], rows: &mut ErrorRows) {
        self.record(traced, |_| ErrorColumns::NONE, tape);
        for (i, interface) in self.interfaces.iter().enumerate() {
            let index = interface.index_before;
            let way = tape[i].s.map(|s| s * index);
            if let Some(medium) = interface.medium_before {
                add_lanes(rows.row_mut(0, medium, ErrorNumber::Index), &way, traced.lane);
            }
            let [hits, behind] = &tape[i..=(i + 1).min(tape.len() - 1)] else { continue };
            let mut bent = AdjointColumns::<f64>::zero();
            bent.by.point = hits.at.k.less(&behind.at.k);
            bent.pass(interface, &ErrorColumns::NONE, hits, false);
            bent.store_motion(rows, i, traced.lane);
            add_lanes(
                rows.row_mut(0, i, ErrorNumber::Thickness),
                &behind.at.k.along_axis(),
                traced.lane,
            );
        }
    }
}

impl AdjointColumns<f64> {
    /// Stores the derivatives by what moves or bends a surface.
    #[inline(always)]
    fn store_motion(&self, rows: &mut ErrorRows, surface: usize, lane: Lane) {
        for number in ErrorNumber::ALL {
            if !matches!(number, ErrorNumber::Index | ErrorNumber::Thickness) {
                let lanes = &self.numbers[number as usize];
                add_lanes(rows.row_mut(0, surface, number), lanes, lane);
            }
        }
    }
}
