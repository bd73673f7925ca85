//! The region of the pupil plane from which the rays of a field get through, and integrals over it.
//!
//! A [`Region`] is searched for once: [`RegionKind`] says whether it is the whole disc, one piece
//! with a [`Boundary`], an [`Annulus`] or irregular. Everything else is computed from it: quadrature
//! nodes, an outline to draw, traced rays with their moments, and how far a dark pupil is from light.

mod annulus;
mod axial_rims;
mod boundary;
mod boundary_tracking;
mod dark_points;
mod dark_pupil;
mod edge_curve;
mod edge_search;
mod kind;
mod light_grid;
mod limit_edge;
mod limit_secant;
mod moments;
mod nodes;
mod outline;
mod pupil_radius;
mod quadrature;
mod search;
mod traced_pupil;
mod whole_turn;

pub use annulus::Annulus;
pub use axial_rims::AxialRim;
pub use boundary::{Boundary, BoundaryArc, EdgePoint, PolarFrame, PupilLimit};
pub use dark_pupil::DarkPupil;
pub use edge_curve::{EdgeArc, EdgeCurves};
pub use kind::{Region, RegionKind};
pub use limit_edge::EdgeRay;
pub(super) use limit_edge::LimitEdge;
pub use moments::PupilMoments;
pub use nodes::Nodes;
pub use outline::{OutlineSide, PupilOutline};
pub use pupil_radius::PupilRadius;
pub(super) use quadrature::order_error;
pub use quadrature::{
    Accuracy, ConvergedList, ConvergedValues, TracedNodes, converge, converge_every_order,
    converge_list, converge_resolved,
};
pub use traced_pupil::TracedPupil;
