//! The light of a wavefront or of an image of a point: one wavelength of the lens, or all of them.

use super::AnalysisKind;
use crate::analysis::ImageLight;
use crate::cli::error::CliError;
use crate::cli::input::LoadedLens;
use crate::cli::output::ShortNumber;
use crate::pupil::RayModel;
use std::str::FromStr;

/// The light that is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum AskedLight {
    /// The primary wavelength.
    Primary,
    /// All wavelengths by their weights.
    All,
    /// The wavelength of the lens nearest to this one, in um.
    Um(f64),
}

/// The largest difference of a wavelength from that of the lens, as a share: digits that were left out.
const ALIKE: f64 = 1e-3;

impl FromStr for AskedLight {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "primary" => Ok(Self::Primary),
            "all" => Ok(Self::All),
            _ => {
                let um = text.parse().ok().filter(|um: &f64| um.is_finite() && *um > 0.0);
                um.map(Self::Um).ok_or_else(|| {
                    "expected a wavelength in um as in `0.5876`, primary or all".to_owned()
                })
            }
        }
    }
}

impl AnalysisKind {
    /// True for an analysis whose light can be chosen.
    pub(super) const fn has_light(self) -> bool {
        self.sums_wavelengths() || matches!(self, Self::Wavefront | Self::OpdFan | Self::Zernike)
    }

    /// True if that light may be of several wavelengths.
    pub(super) const fn sums_wavelengths(self) -> bool {
        matches!(self, Self::Psf | Self::EncircledEnergy)
    }

    /// The light that is asked for, or the primary wavelength.
    pub(super) fn light(self, asked: Option<AskedLight>) -> Result<AskedLight, CliError> {
        match asked {
            Some(AskedLight::All) if !self.sums_wavelengths() => Err(CliError::Input(
                "--wavelength: found all; expected one wavelength: a wavefront has no other"
                    .to_owned(),
            )),
            Some(asked) => Ok(asked),
            None => Ok(AskedLight::Primary),
        }
    }
}

impl AskedLight {
    /// The wavelength of a lens in um; `None` for all of them.
    pub(super) fn um(self, opened: &LoadedLens) -> Result<Option<f64>, CliError> {
        let asked = match self {
            Self::All => return Ok(None),
            Self::Primary => return Ok(Some(opened.primary_um())),
            Self::Um(asked) => asked,
        };
        let known = || opened.lens.wavelengths.iter().map(|wavelength| wavelength.um);
        let nearest = known().min_by(|a, b| (a - asked).abs().total_cmp(&(b - asked).abs()));
        let found = nearest.filter(|um| (um - asked).abs() <= ALIKE * asked);
        found.map(Some).ok_or_else(|| {
            let list: Vec<String> = known().map(|um| ShortNumber(um).to_string()).collect();
            let expected = format!("one of {} in um, the wavelengths of the lens", list.join(", "));
            CliError::Input(format!("--wavelength: found {asked}; expected {expected}"))
        })
    }
}

/// The light of a ray model at a wavelength in um, all of it for `None`: the primary one if the model has no other.
pub(super) fn image_light(model: &RayModel, um: Option<f64>) -> ImageLight {
    let Some(um) = um else { return ImageLight::All };
    let place = model.channels.iter().position(|channel| channel.um == um);
    ImageLight::Wavelength(place.unwrap_or(model.primary))
}

/// The wavelengths of a result as words, with a hint if more of them can be summed.
pub(super) fn light_text(um: &[f64], can_be_more: bool) -> Option<String> {
    let list: Vec<String> = um.iter().map(|um| ShortNumber(*um).to_string()).collect();
    let hint = if can_be_more { "; --wavelength all sums all of them" } else { "" };
    match list.as_slice() {
        [] => None,
        [only] => Some(format!("at {only} um{hint}")),
        [..] => Some(format!("in the light of {} um by weight", list.join(", "))),
    }
}
