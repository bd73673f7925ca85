//! The device that quick pictures are made on: a graphics card where there is one.

use crate::cli::error::CliError;
use crate::picture::{PictureDevice, install_picture_device};
use std::path::Path;
use std::sync::Arc;

/// The device of quick pictures that a person asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub(in crate::cli) enum DeviceChoice {
    /// A graphics card where there is one, else the processor.
    #[default]
    Auto,
    /// A graphics card, or software in its place.
    Gpu,
    /// The processor.
    Cpu,
}

/// The files by which Linux shows graphics cards: of all with a driver of the kernel, of NVIDIA, of a Windows host, and of
/// mobile ones.
const CARDS: [&str; 5] = ["/dev/dri", "/dev/nvidiactl", "/dev/dxg", "/dev/mali0", "/dev/kgsl-3d0"];

/// False if there is certainly no graphics card.
fn may_have_card() -> bool {
    cfg!(not(target_os = "linux")) || CARDS.iter().any(|card| Path::new(card).exists())
}

/// A device, and true if it is the processor in disguise.
type FoundDevice = (Arc<dyn PictureDevice>, bool);

impl DeviceChoice {
    /// Lets pictures use this device.
    ///
    /// # Errors
    /// A graphics card is asked for, and there is none.
    pub(in crate::cli) fn install(self) -> Result<(), CliError> {
        let found = match self {
            Self::Cpu => None,
            // A search where there is no card costs time, and some drivers print what nobody can act on.
            Self::Auto if !may_have_card() => None,
            Self::Auto => find().ok().filter(|(_, is_software)| !is_software),
            Self::Gpu => {
                let refuse = |why| CliError::Failed(format!("--device gpu: {why}"));
                Some(find().map_err(refuse)?)
            }
        };
        install_picture_device(found.map(|(device, _)| device));
        Ok(())
    }
}

#[cfg(feature = "studio")]
fn find() -> Result<FoundDevice, String> {
    let pass = pollster::block_on(crate::studio::draw::PicturePass::headless());
    let pass = pass.map_err(|error| error.to_string())?;
    let is_software = pass.is_software();
    Ok((Arc::new(pass), is_software))
}

#[cfg(not(feature = "studio"))]
fn find() -> Result<FoundDevice, String> {
    Err("this program was built without the studio, which knows graphics cards".to_owned())
}
