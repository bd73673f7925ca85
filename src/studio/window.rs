//! Opening a window: wgpu first, plain OpenGL if that cannot start, and where neither can, an
//! error that says what is missing and what works without a window.

use std::sync::Arc;

use eframe::egui_wgpu::{RenderState, WgpuConfiguration, WgpuSetup, WgpuSetupCreateNew};
use eframe::{App, CreationContext, NativeOptions, Renderer};

use super::draw::{PicturePass, RenderBackend, install_gpu_cache};
use super::theme;
use crate::picture::install_picture_device;

/// An error that keeps the studio from opening.
#[derive(Debug, thiserror::Error)]
pub enum StudioError {
    /// Nothing to show a window on.
    #[error(
        "no window can open: no display was found ({0})\n\
         expected DISPLAY (X11) or WAYLAND_DISPLAY to name a running display, with its libraries:\n  \
         apt-get install libx11-6 libx11-xcb1 libxcursor1 libxi6 libxkbcommon0 libxkbcommon-x11-0\n\
         {WITHOUT_WINDOW}"
    )]
    NoDisplay(String),
    /// A display, but nothing to draw with.
    #[error(
        "no window can open: neither Vulkan nor OpenGL can draw in it\n  \
         Vulkan or OpenGL through wgpu: {wgpu}\n  OpenGL alone: {glow}\n\
         a software renderer is enough:\n  \
         apt-get install libvulkan1 mesa-vulkan-drivers libegl1 libgl1 libgl1-mesa-dri\n\
         {WITHOUT_WINDOW}"
    )]
    NoRenderer {
        /// The message of wgpu.
        wgpu: String,
        /// The message of OpenGL.
        glow: String,
    },
    /// The display has refused the window, or the studio could not start in it.
    #[error("the window cannot open: {0}\n{WITHOUT_WINDOW}")]
    Window(String),
}

const WITHOUT_WINDOW: &str = "the same work without a window: \
    `aplanat info LENS`, `aplanat analyze LENS spot`, `aplanat optimize LENS --out FILE`, \
    `aplanat convert IN OUT`; `aplanat --help` lists all";

/// The choice whether size and panels of the window are restored at the next start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Persistence {
    /// It does.
    Enabled,
    /// It starts as new and leaves nothing behind.
    Disabled,
}

/// The content of a window, or an error.
pub type AppResult = Result<Box<dyn App>, Box<dyn std::error::Error + Send + Sync>>;

/// Opens a window and returns once it is closed. `start` makes its content; it may be called a
/// second time when the first renderer fails.
pub fn open_window(
    memory: Persistence,
    start: impl Fn(&CreationContext<'_>, RenderBackend) -> AppResult,
) -> Result<(), StudioError> {
    let wgpu = match open_with(Renderer::Wgpu, memory, &start) {
        Err(eframe::Error::Wgpu(error)) => without_source_location(&error.to_string()),
        Err(error) => return Err(error.into()),
        Ok(()) => return Ok(()),
    };
    log::warn!("wgpu cannot start ({wgpu}); trying OpenGL");
    open_with(Renderer::Glow, memory, &start).map_err(|error| match error {
        eframe::Error::Glutin(_)
        | eframe::Error::NoGlutinConfigs(..)
        | eframe::Error::OpenGL(_) => StudioError::NoRenderer { wgpu, glow: error.to_string() },
        other => other.into(),
    })
}

impl From<eframe::Error> for StudioError {
    fn from(error: eframe::Error) -> Self {
        match error {
            eframe::Error::WinitEventLoop(reason) => {
                Self::NoDisplay(without_source_location(&reason.to_string()))
            }
            other => Self::Window(other.to_string()),
        }
    }
}

/// A library's message without the place in its source and without unfilled placeholders.
fn without_source_location(message: &str) -> String {
    let after_place = message.split_once(".rs:").and_then(|(_, rest)| rest.split_once(": "));
    after_place.map_or(message, |(_, rest)| rest).trim_end_matches(": {}").to_owned()
}

fn open_with(
    renderer: Renderer,
    memory: Persistence,
    start: &impl Fn(&CreationContext<'_>, RenderBackend) -> AppResult,
) -> eframe::Result {
    let create = |context: &CreationContext<'_>| {
        let backend = match &context.wgpu_render_state {
            Some(state) => {
                report_errors(state);
                install_gpu_cache(state);
                make_pictures_on(state);
                RenderBackend::Gpu
            }
            None => RenderBackend::Software,
        };
        theme::apply(&context.egui_ctx);
        start(context, backend)
    };
    eframe::run_native("Aplanat", options(renderer, memory), Box::new(create))
}

fn options(renderer: Renderer, memory: Persistence) -> NativeOptions {
    let persists = memory == Persistence::Enabled;
    NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title("Aplanat")
            .with_app_id(if persists { "aplanat" } else { "aplanat-measure" })
            .with_inner_size([1280.0, 800.0])
            .with_min_inner_size([480.0, 320.0]),
        renderer,
        persist_window: persists,
        dithering: false,
        wgpu_options: WgpuConfiguration {
            wgpu_setup: wgpu_setup(),
            ..WgpuConfiguration::default()
        },
        ..NativeOptions::default()
    }
}

/// Asks for all that the adapter can do: the usual request leaves old OpenGL without its abilities.
fn wgpu_setup() -> WgpuSetup {
    let mut setup = WgpuSetupCreateNew::without_display_handle();
    setup.device_descriptor = Arc::new(|adapter| wgpu::DeviceDescriptor {
        label: Some("studio"),
        required_limits: adapter.limits(),
        ..wgpu::DeviceDescriptor::default()
    });
    WgpuSetup::CreateNew(setup)
}

/// Logs errors of the graphics card, which would otherwise end the program.
/// Lets pictures be made on the graphics card; one in software is slower than the processor's own way.
fn make_pictures_on(state: &RenderState) {
    let pass = PicturePass::new(&state.adapter, &state.device, &state.queue);
    if !pass.is_software() {
        install_picture_device(Some(Arc::new(pass)));
    }
}

fn report_errors(state: &RenderState) {
    state.device.on_uncaptured_error(Arc::new(|error| log::error!("graphics card: {error}")));
    state.device.set_device_lost_callback(|reason, message| {
        log::error!("graphics card lost ({reason:?}): {message}");
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_of_libraries_lose_their_source_places() {
        let winit = "os error at /x/linux/mod.rs:765: DISPLAY is not set";
        assert_eq!(without_source_location(winit), "DISPLAY is not set");
        assert_eq!(
            without_source_location("Failed to create surface: {}"),
            "Failed to create surface"
        );
        assert_eq!(
            without_source_location("glutin error: [a7] GLXBadFBConfig"),
            "glutin error: [a7] GLXBadFBConfig"
        );
    }

    #[test]
    fn an_error_names_packages_and_what_works_without_a_window() {
        let errors = [
            StudioError::NoDisplay("DISPLAY is not set".into()),
            StudioError::NoRenderer { wgpu: "no driver".into(), glow: "no config".into() },
        ];
        for message in errors.map(|error| error.to_string()) {
            for part in ["apt-get install", "aplanat optimize LENS --out FILE", "no "] {
                assert!(message.contains(part), "{part} is missing in: {message}");
            }
        }
    }
}
