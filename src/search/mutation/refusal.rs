//! The reasons that a mutation does not apply.

use super::kind::MutationKind;
use crate::lens::LensError;
use crate::paraxial::ParaxialError;
use crate::pupil::RayModelError;
use crate::search::projection::ProjectionError;
use serde::de::value::{Error, StringDeserializer};
use serde::{Deserialize, Deserializer, Serialize, de::IntoDeserializer as _};
use std::collections::BTreeMap;

/// The reason that a mutation does not apply to a point.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    Serialize,
    Deserialize,
    thiserror::Error,
)]
#[serde(rename_all = "snake_case")]
pub enum Refusal {
    /// The rules permit no more elements.
    #[error("the lens has as many elements as the rules allow")]
    TooManyElements,
    /// The rules permit no fewer elements.
    #[error("the lens has as few elements as the rules ask for")]
    TooFewElements,
    /// No air gap may be changed.
    #[error("no air gap that the rules allow to change")]
    NoAirGap,
    /// No permitted glass is defined at all wavelengths.
    #[error("no glass of the rules has an index at every wavelength")]
    NoGlass,
    /// A finite object is too close.
    #[error("no room between the object and the lens")]
    NoRoomAtObject,
    /// No singlet may be removed.
    #[error("no singlet that may be removed: without the stop and without pickups")]
    NoSinglet,
    /// No cemented group may lose an outer piece.
    #[error("no cemented group whose outer piece may be removed")]
    NoCementedGroup,
    /// No two neighbours may be cemented.
    #[error(
        "no two elements of different glass whose plain surfaces face each other across a gap that \
         does not move"
    )]
    NoNeighbours,
    /// No cemented interface may be split.
    #[error("no plain cemented interface")]
    NoCementedInterface,
    /// No element may be bent.
    #[error("no element whose curvatures are free")]
    NoFreeCurvatures,
    /// A curvature would leave the bounds of its variable.
    #[error("a curvature would leave the bounds of its variable")]
    CurvatureBounds,
    /// No element may be reversed.
    #[error("no element that may be reversed")]
    NoReversibleElement,
    /// The length of an axial gradient depends on the zoom position.
    #[error("no element that may be reversed: the length of an axial gradient moves with the zoom")]
    GradientZooms,
    /// A pickup reads or sets an axial gradient.
    #[error("no element that may be reversed: a pickup refers to an axial gradient")]
    GradientHasPickup,
    /// An axial gradient cannot be expressed from its other end.
    #[error(
        "no element that may be reversed: an axial gradient has no base that a glass has at its \
         other end"
    )]
    GradientWithoutBase,
    /// No catalogue glass may be exchanged.
    #[error("no glass of the catalogue that may be exchanged")]
    NoExchangeableGlass,
    /// The only media that may be exchanged are gradient-index media.
    #[error("no glass of the catalogue that may be exchanged: a gradient has no neighbour there")]
    OnlyGradients,
    /// No other permitted glass is similar.
    #[error("no other glass of the rules is similar")]
    NoSimilarGlass,
    /// There is no other permitted glass.
    #[error("no other glass of the rules")]
    NoOtherGlass,
    /// The lens has no stop.
    #[error("there is no stop")]
    NoStop,
    /// The rules do not permit the stop to move.
    #[error("the rules do not allow the stop to move")]
    FixedStop,
    /// A pickup refers to a gap at the stop.
    #[error("a pickup refers to a gap at the stop")]
    StopHasPickup,
    /// The stop is the last surface.
    #[error("the stop is the last surface")]
    StopIsLast,
    /// The stop can move to no air gap.
    #[error("no air gap for the stop")]
    NoGapForStop,
    /// The axial beam has no height at the new stop.
    #[error("the axial beam has no height at the new stop")]
    NoAxialHeight,
    /// The rules permit no more aspheric surfaces.
    #[error("the lens has as many aspheric surfaces as the rules allow")]
    TooManyAspheres,
    /// No surface may be aspheric, or have a further power.
    #[error("no surface that may have a further aspheric number")]
    NoSurfaceForAsphere,
    /// No aspheric number promises a gain.
    #[error("no aspheric number promises a gain")]
    NoAsphereGain,
    /// No aspheric surface may become spherical.
    #[error("no aspheric surface that may change")]
    NoAsphere,
    /// The prescription is invalid or cannot be resolved.
    #[error("the lens cannot be resolved")]
    InvalidLens,
    /// The lens is afocal, so there is no focal length to preserve.
    #[error("the lens is afocal: it has no focal length to preserve")]
    Afocal,
    /// The projection has too few independent parameters.
    #[error("the variable parameters cannot preserve focal length and focus independently")]
    SingularProjection,
    /// The projection would move parameters out of their bounds.
    #[error("parameters would have to leave their bounds to preserve the focus")]
    ProjectionBounds,
    /// The projection does not converge.
    #[error("the projection does not converge")]
    ProjectionSteps,
    /// Neighbouring surfaces would cross on the axis.
    #[error("surfaces would cross on the axis")]
    CrossingSurfaces,
    /// The track would be longer than the rules permit.
    #[error("the lens would be longer than the rules allow")]
    TooLong,
    /// The back focal distance would be shorter than the rules permit.
    #[error("the back focus would be shorter than the rules ask for")]
    BackFocusTooShort,
    /// No light would reach the image.
    #[error("no light would get through")]
    NoLight,
    /// No random lens transmits light.
    #[error("no random lens transmits light")]
    NoRandomLens,
    /// All kinds of mutation have weight 0.
    #[error("every kind of mutation has weight 0")]
    AllExcluded,
    /// The kind of mutation has weight 0.
    #[error("it is excluded")]
    Excluded,
    /// The kind does not change a lens.
    #[error("it does not change a lens")]
    NotAMutation,
    /// The point has no such element.
    #[error("there is no such element")]
    NoElement,
    /// A variable would leave its range.
    #[error("a variable would leave its range")]
    OutOfRange,
    /// The reservoir is empty.
    #[error("the reservoir is empty")]
    EmptyReservoir,
    /// The loss after the mutation is not finite.
    #[error("the loss after it is not finite")]
    NoLoss,
    /// Another reason, recorded as text by an earlier version.
    #[error("another reason")]
    Other,
}

impl From<&ProjectionError> for Refusal {
    fn from(error: &ProjectionError) -> Self {
        match error {
            ProjectionError::Afocal(_) => Self::Afocal,
            ProjectionError::Singular => Self::SingularProjection,
            ProjectionError::Bounds(..) => Self::ProjectionBounds,
            ProjectionError::Steps(_) => Self::ProjectionSteps,
            ProjectionError::Lens(_) => Self::InvalidLens,
        }
    }
}

impl From<LensError> for Refusal {
    fn from(_: LensError) -> Self {
        Self::InvalidLens
    }
}

impl From<ParaxialError> for Refusal {
    fn from(_: ParaxialError) -> Self {
        Self::InvalidLens
    }
}

impl From<RayModelError> for Refusal {
    fn from(_: RayModelError) -> Self {
        Self::InvalidLens
    }
}

/// A mutation that does not apply to a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{kind}: {refusal}", kind = .kind.name())]
pub struct MutationError {
    /// The kind of mutation.
    pub kind: MutationKind,
    /// The reason.
    pub refusal: Refusal,
}

impl MutationError {
    /// A mutation that does not apply, with the reason.
    pub fn new(kind: MutationKind, refusal: Refusal) -> Self {
        Self { kind, refusal }
    }
}

/// Reads counts by reason. Earlier versions recorded reasons as text, which count as
/// [`Refusal::Other`].
pub(in crate::search) fn read_counts<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<BTreeMap<Refusal, u64>, D::Error> {
    let mut counts = BTreeMap::new();
    for (name, count) in BTreeMap::<String, u64>::deserialize(deserializer)? {
        let name: StringDeserializer<Error> = name.into_deserializer();
        let refusal = Refusal::deserialize(name).unwrap_or(Refusal::Other);
        *counts.entry(refusal).or_default() += count;
    }
    Ok(counts)
}
