//! The ghosts of all fields, and the rays of one of them.

use super::AnalysisSettings;
use crate::analysis::{Coating, Ghost, GhostError, GhostRanking, ghost_section, ghosts};
use crate::lens::FieldPoint;
use crate::math::Vec3;
use crate::pupil::RayModel;

/// The ghosts of the fields at the primary wavelength.
#[derive(Debug, Clone)]
pub struct FieldGhosts {
    /// The coating between air and glass.
    pub coating: Coating,
    /// The order of all pairs of surfaces by first-order optics.
    pub ranking: GhostRanking,
    /// The brightest ghosts of each field by real rays, the brightest first.
    pub fields: Vec<Vec<Ghost>>,
}

/// The number of ghosts that real rays follow, and the rays of each.
const FOLLOWED: (usize, usize) = (24, 1024);
/// The number of rays of a ghost in the layout.
const DRAWN: usize = 9;

/// The ghosts of all fields; `None` if it was interrupted.
pub(super) fn field_ghosts(
    model: &RayModel,
    settings: &AnalysisSettings,
    interrupted: &dyn Fn() -> bool,
) -> Option<Result<FieldGhosts, GhostError>> {
    let coating = settings.coating;
    let (mut ranking, mut fields) = (None, Vec::with_capacity(model.fields.len()));
    for field in &model.fields {
        if interrupted() {
            return None;
        }
        match ghosts(model, (*field, model.primary), coating, FOLLOWED) {
            Ok((order, found)) => {
                ranking = Some(order);
                fields.push(found);
            }
            Err(why) => return Some(Err(why)),
        }
    }
    ranking.map(|ranking| Ok(FieldGhosts { coating, ranking, fields }))
}

/// The rays of the ghost of the settings along the axis; none without one.
pub(super) fn ghost_rays(model: &RayModel, settings: &AnalysisSettings) -> Vec<Vec<Vec3<f64>>> {
    let Some([first, second]) = settings.ghost else { return Vec::new() };
    let axis = FieldPoint { x: 0.0, y: 0.0, weight: 1.0 };
    let rays = ghost_section(model, (axis, model.primary), [first, second], DRAWN);
    rays.unwrap_or_default()
}
