//! A lens from a specification: what a customer writes, what no lens can do, and how a lens that
//! claims to satisfy it is judged.

mod judge;
mod refusal;
mod requirements;
mod spec;

pub use judge::{
    FieldJudgement, JUDGEMENT_TOLERANCE, JudgementError, LensJudgement, RequirementMargin,
    judge_lens,
};
pub use refusal::SpecificationError;
pub use requirements::{FOCAL_LENGTH_TOLERANCE, FilledValue, GlassChoice, LensRequirements};
pub use spec::{GlassList, LensSpecification};
