//! Compensators: what is adjusted after a lens is assembled, besides its focus.

use super::check::check_number;
use super::{LensError, Perturbation, PerturbationKind};
use serde::{Deserialize, Serialize};
use std::str::FromStr;

/// A part that is adjusted after assembly.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AdjustedPart {
    /// The position of the sensor along the axis, in mm.
    Focus,
    /// The tilt of the sensor about x at the axis, in radians; right-handed, as that of a surface.
    SensorTiltX,
    /// The tilt of the sensor about y at the axis, in radians.
    SensorTiltY,
    /// A gap, or the position of a surface or element: the same number as the error of making.
    Lens(Perturbation),
}

impl AdjustedPart {
    /// The name for tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Focus => "focus",
            Self::SensorTiltX => "sensor tilt x",
            Self::SensorTiltY => "sensor tilt y",
            Self::Lens(Perturbation { kind, .. }) => kind.name(),
        }
    }

    /// The name in files.
    pub fn key(self) -> &'static str {
        let own = CompensatorKind::of(self);
        let found = CompensatorKind::ALL.iter().find(|(kind, ..)| Some(*kind) == own);
        found.map_or("focus", |(_, name, _)| *name)
    }

    /// True for a tilt, whose travel is an angle.
    pub fn is_angle(self) -> bool {
        match self {
            Self::Focus => false,
            Self::SensorTiltX | Self::SensorTiltY => true,
            Self::Lens(part) => part.kind.is_angle(),
        }
    }

    /// The adjustment of the lens itself, as an error of making; `None` for focus and tilts of the sensor,
    /// which change no ray in front of it.
    pub fn in_lens(self) -> Option<Perturbation> {
        match self {
            Self::Lens(part) => Some(part),
            _ => None,
        }
    }
}

/// A part that is adjusted after assembly, and how far.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "CompensatorJson", into = "CompensatorJson")]
pub struct Compensator {
    /// The part; not the focus, whose travel is a number of its own.
    pub part: AdjustedPart,
    /// The largest adjustment to either side, in mm or radians.
    pub travel: f64,
}

/// The kinds of compensators in files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum CompensatorKind {
    SensorTiltX,
    SensorTiltY,
    Thickness,
    ThicknessAdjusted,
    SurfaceDecenterX,
    SurfaceDecenterY,
    ElementDecenterX,
    ElementDecenterY,
    ElementTiltX,
    ElementTiltY,
}

impl CompensatorKind {
    /// Every kind with its name in files, and the number of the lens that it changes.
    const ALL: [(Self, &'static str, Option<PerturbationKind>); 10] = [
        (Self::SensorTiltX, "sensor_tilt_x", None),
        (Self::SensorTiltY, "sensor_tilt_y", None),
        (Self::Thickness, "thickness", Some(PerturbationKind::Thickness)),
        (Self::ThicknessAdjusted, "thickness_adjusted", Some(PerturbationKind::ThicknessAdjusted)),
        (Self::SurfaceDecenterX, "surface_decenter_x", Some(PerturbationKind::SurfaceDecenterX)),
        (Self::SurfaceDecenterY, "surface_decenter_y", Some(PerturbationKind::SurfaceDecenterY)),
        (Self::ElementDecenterX, "element_decenter_x", Some(PerturbationKind::ElementDecenterX)),
        (Self::ElementDecenterY, "element_decenter_y", Some(PerturbationKind::ElementDecenterY)),
        (Self::ElementTiltX, "element_tilt_x", Some(PerturbationKind::ElementTiltX)),
        (Self::ElementTiltY, "element_tilt_y", Some(PerturbationKind::ElementTiltY)),
    ];

    /// The kind of a part; `None` for the focus.
    fn of(part: AdjustedPart) -> Option<Self> {
        match part {
            AdjustedPart::Focus => None,
            AdjustedPart::SensorTiltX => Some(Self::SensorTiltX),
            AdjustedPart::SensorTiltY => Some(Self::SensorTiltY),
            AdjustedPart::Lens(Perturbation { kind, .. }) => {
                let found = Self::ALL.iter().find(|(.., in_lens)| *in_lens == Some(kind));
                found.map(|(own, ..)| *own)
            }
        }
    }

    fn perturbation(self) -> Option<PerturbationKind> {
        Self::ALL.iter().find(|(kind, ..)| *kind == self).and_then(|(.., in_lens)| *in_lens)
    }
}

/// The keys of a compensator in a file: angles in degrees.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CompensatorJson {
    kind: CompensatorKind,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    first: Option<usize>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    last: Option<usize>,
    travel: f64,
}

impl TryFrom<CompensatorJson> for Compensator {
    type Error = String;

    fn try_from(keys: CompensatorJson) -> Result<Self, String> {
        let CompensatorJson { kind, first, last, travel } = keys;
        let part = match (kind.perturbation(), first) {
            (Some(kind), Some(first)) => {
                AdjustedPart::Lens(Perturbation { kind, first, last: last.unwrap_or(first) })
            }
            (Some(kind), None) => {
                let name = kind.name();
                return Err(format!("a compensator `{name}` without a surface; expected `first`"));
            }
            (None, None) if last.is_none() => match kind {
                CompensatorKind::SensorTiltY => AdjustedPart::SensorTiltY,
                _ => AdjustedPart::SensorTiltX,
            },
            (None, _) => {
                let text =
                    "a tilt of the sensor with a surface; expected neither `first` nor `last`";
                return Err(text.to_owned());
            }
        };
        let travel = if part.is_angle() { travel.to_radians() } else { travel };
        Ok(Self { part, travel })
    }
}

impl From<Compensator> for CompensatorJson {
    fn from(Compensator { part, travel }: Compensator) -> Self {
        let travel = if part.is_angle() { travel.to_degrees() } else { travel };
        let in_lens = part.in_lens();
        let last = in_lens.filter(|part| part.last != part.first).map(|part| part.last);
        let first = in_lens.map(|part| part.first);
        // A part of no kind is refused by the check of a lens.
        let kind = CompensatorKind::of(part).unwrap_or(CompensatorKind::SensorTiltX);
        Self { kind, first, last, travel }
    }
}

impl FromStr for Compensator {
    type Err = String;

    /// Reads `KIND=TRAVEL` or `KIND@FIRST-LAST=TRAVEL`, with surfaces counted from 1 and angles in degrees;
    /// `focus` is a kind too.
    fn from_str(text: &str) -> Result<Self, String> {
        let expected = || {
            let names: Vec<&str> = CompensatorKind::ALL.iter().map(|(_, name, _)| *name).collect();
            format!(
                "expected KIND=TRAVEL or KIND@SURFACES=TRAVEL, as in `sensor_tilt_x=0.2` or \
                 `element_decenter_y@3-4=0.1`; kinds: focus, {}",
                names.join(", ")
            )
        };
        let (what, travel) = text.split_once('=').ok_or_else(expected)?;
        let Ok(travel) = travel.trim().parse::<f64>() else { return Err(expected()) };
        let (name, place) = what.split_once('@').map_or((what, None), |(n, p)| (n, Some(p)));
        let name = name.trim().replace('-', "_");
        if name == "focus" && place.is_none() {
            return Ok(Self { part: AdjustedPart::Focus, travel });
        }
        let found = CompensatorKind::ALL.iter().find(|(_, own, _)| *own == name);
        let (kind, ..) = found.ok_or_else(expected)?;
        let number = |text: &str| {
            let number = text.trim().parse::<usize>().ok();
            number.and_then(|number| number.checked_sub(1)).ok_or_else(expected)
        };
        let place = place.map(|place| place.split_once('-').unwrap_or((place, place)));
        let (first, last) = match place {
            Some((first, last)) => (Some(number(first)?), Some(number(last)?)),
            None => (None, None),
        };
        match (kind.perturbation(), first) {
            (Some(_), None) => {
                Err(format!("{name} without a surface; expected {name}@SURFACES=TRAVEL"))
            }
            (None, Some(_)) => Err(format!("{name} of a surface; expected {name}=TRAVEL")),
            _ => CompensatorJson { kind: *kind, first, last, travel }.try_into(),
        }
    }
}

impl Compensator {
    /// Checks the travel and that the surfaces exist; `surfaces` is their number.
    pub(super) fn check(&self, surfaces: usize) -> Result<(), LensError> {
        let name = self.part.name();
        if CompensatorKind::of(self.part).is_none() {
            let text = format!("the compensator `{name}` is none that a list of them may name");
            return Err(LensError::Inconsistent(text));
        }
        let what = format_args!("travel of the compensator `{name}`");
        check_number(what, self.travel, self.travel >= 0.0, "zero or more")?;
        let Some(Perturbation { kind, first, last }) = self.part.in_lens() else { return Ok(()) };
        let alone = first == last || kind.moves_a_body();
        if first > last || last >= surfaces || !alone {
            let (first, last) = (first + 1, last + 1);
            return Err(LensError::Inconsistent(format!(
                "the compensator `{name}` names surfaces {first} to {last}; expected {} of 1 to \
                 {surfaces}",
                if alone { "surfaces in order" } else { "one" }
            )));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_compensator_is_read_as_it_is_written() {
        for text in [
            r#"{"kind":"sensor_tilt_y","travel":0.5}"#,
            r#"{"kind":"thickness","first":3,"travel":0.2}"#,
            r#"{"kind":"element_decenter_x","first":2,"last":3,"travel":0.1}"#,
        ] {
            let read: Compensator = serde_json::from_str(text).unwrap();
            assert_eq!(serde_json::to_string(&read).unwrap(), text);
        }
        for (text, words) in [
            (r#"{"kind":"curvature","first":3,"travel":0.2}"#, "unknown variant `curvature`"),
            (r#"{"kind":"thickness","travel":0.2}"#, "expected `first`"),
            (r#"{"kind":"sensor_tilt_x","first":3,"travel":0.2}"#, "neither `first` nor `last`"),
            (r#"{"kind":"sensor_tilt_x","travel":0.2,"play":1}"#, "unknown field `play`"),
        ] {
            let refused = serde_json::from_str::<Compensator>(text).unwrap_err().to_string();
            assert!(refused.contains(words), "{refused}");
        }
    }

    #[test]
    fn an_option_counts_surfaces_from_one() {
        let read = |text: &str| text.parse::<Compensator>();
        let kind = PerturbationKind::ElementDecenterY;
        let part = AdjustedPart::Lens(Perturbation { kind, first: 2, last: 3 });
        let expected = Compensator { part, travel: 0.1 };
        assert_eq!(read("element_decenter_y@3-4=0.1").unwrap(), expected);
        assert_eq!(read("element-decenter-y@3-4=0.1").unwrap(), expected);
        assert_eq!(read("focus=0.3").unwrap().part, AdjustedPart::Focus);
        let tilt = read("sensor_tilt_x=1").unwrap();
        assert!((tilt.travel - 1.0_f64.to_radians()).abs() < 1e-15);
        for text in ["focus", "thickness=0.1", "thickness@0=0.1", "index@1=0.1", "focus@1=0.1"] {
            assert!(read(text).is_err(), "{text}");
        }
    }
}
