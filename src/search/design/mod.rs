//! A lens from a specification.
//!
//! A specification is completed and checked before any search. Starts come from the library, from
//! thin-lens formulas and from random structures; they are led to the full aperture and field, the
//! better half of them goes on, structures are mutated, glasses become those of the catalogue, and at
//! the end a diaphragm and rims are found and the lenses are refined as they are made. The judgement of
//! a lens, by real rays through all rims, knows nothing of how the lens was found.

mod as_built;
mod draft;
mod finish;
mod glasses;
mod judge;
mod refusal;
mod requirements;
mod rims;
mod run;
mod spec;
mod starts;
mod thin_structures;
mod thin_triplet;

pub use as_built::DesignedAsBuilt;
pub use draft::LimitCost;
pub use finish::{DesignMerit, DesignedLens};
pub use judge::{
    FieldJudgement, JUDGEMENT_TOLERANCE, JudgementError, LensJudgement, RequirementMargin,
    judge_lens,
};
pub use refusal::SpecificationError;
pub use requirements::{
    FOCAL_LENGTH_TOLERANCE, FilledValue, GlassChoice, LensRequirements, NearObject,
};
pub use run::{DesignRun, DesignSettings, DesignStage};
pub use spec::{AS_BUILT_GRADES, GlassList, LensSpecification, LensWish};
