//! The pupils that were found for the fields of a model, so that all analyses share one search.
//!
//! The search for a chief ray and for the edge of a pupil takes longer than many analyses of it. A model
//! remembers both for each of its own fields and wavelengths. What is remembered is compared as a whole,
//! the origin of the rays and their map included, so that a change of the beam finds nothing; a clone
//! remembers nothing, since it is made to be changed.

use super::field_source::PupilMap;
use super::launch::{FixedLaunch, LaunchError};
use super::region::RegionKind;
use std::sync::Mutex;

/// The form of a region, and the number of rays traced to find it.
type FoundRegion = (RegionKind, usize);

/// The pupils that were found for the fields of a model. A clone has none.
#[derive(Debug, Default)]
pub struct FoundPupils {
    /// By the launch at the paraxial entrance pupil.
    maps: Mutex<Vec<(FixedLaunch, Result<PupilMap, LaunchError>)>>,
    regions: Mutex<Vec<(FixedLaunch, FoundRegion)>>,
}

impl Clone for FoundPupils {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl FoundPupils {
    /// The map of a launch that aims at the real stop, searched for unless it is remembered.
    ///
    /// # Errors
    /// Those of the search.
    pub(super) fn map(
        &self,
        launch: &FixedLaunch,
        search: impl FnOnce() -> Result<PupilMap, LaunchError>,
    ) -> Result<PupilMap, LaunchError> {
        remembered(&self.maps, launch, search)
    }

    /// The region of a launch, searched for unless it is remembered.
    pub(super) fn region(
        &self,
        launch: &FixedLaunch,
        search: impl FnOnce() -> FoundRegion,
    ) -> FoundRegion {
        remembered(&self.regions, launch, search)
    }
}

/// A result that is remembered, or that of a search, which is remembered from now on. Two threads may
/// search for the same at the same time; both find the same.
fn remembered<T: Clone>(
    results: &Mutex<Vec<(FixedLaunch, T)>>,
    launch: &FixedLaunch,
    search: impl FnOnce() -> T,
) -> T {
    // A thread that panicked between two complete entries leaves the list as it was.
    let lock = || results.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let known = lock().iter().find(|(other, _)| other == launch).map(|(_, found)| found.clone());
    known.unwrap_or_else(|| {
        let found = search();
        lock().push((*launch, found.clone()));
        found
    })
}

#[cfg(test)]
mod tests {
    use crate::lens::FieldPoint;
    use crate::pupil::{RayModel, Region};

    #[test]
    fn a_pupil_is_searched_for_once_and_found_the_same_again() {
        let lens = crate::lens::blank();
        let mut model = RayModel::from_lens(&lens, 0).unwrap();
        model.fields = vec![FieldPoint { x: 0.0, y: 3.0, weight: 1.0 }];
        let field = model.fields[0];
        let find = |model: &RayModel| Region::new(model.launch(field, 0).unwrap()).kind;
        let first = find(&model);
        assert_eq!(find(&model), first);
        assert_eq!(find(&model.clone()), first);
        let remembered = |model: &RayModel| model.found.regions.lock().unwrap().len();
        assert_eq!((remembered(&model), remembered(&model.clone())), (1, 0));
    }

    #[test]
    fn a_model_remembers_its_own_fields_alone() {
        let model = RayModel::from_lens(&crate::lens::blank(), 0).unwrap();
        for degrees in 1..9 {
            let field = FieldPoint { x: 0.0, y: f64::from(degrees), weight: 1.0 };
            assert!(!Region::new(model.launch(field, 0).unwrap()).is_dark());
        }
        assert!(model.found.maps.lock().unwrap().is_empty());
    }
}
