//! Silence of the graphics layer where there is no display.
//!
//! A layer of Mesa that puts the card of the display first asks the display for it as soon as a program looks for a
//! graphics card. Without a display it prints lines about `XDG_RUNTIME_DIR`, which say nothing of the program and
//! which nobody can act on.

/// The variable that switches the layer off, by the file that registers it.
#[cfg(target_os = "linux")]
const SWITCH: &str = "NODEVICE_SELECT";
/// A display is there if one of these is set, and the layer has work of its own with the last one.
#[cfg(target_os = "linux")]
const REASONS: [&str; 4] =
    ["WAYLAND_DISPLAY", "WAYLAND_SOCKET", "DISPLAY", "MESA_VK_DEVICE_SELECT"];

/// Lets the graphics layer look for no display where there is none; to be called before the first thread.
pub(super) fn look_for_no_display() {
    #[cfg(target_os = "linux")]
    if REASONS.iter().all(|name| std::env::var_os(name).is_none()) {
        #[expect(unsafe_code, reason = "the layer reads its switch from the environment alone")]
        // SAFETY: the program has one thread so far, so nothing reads the environment at the same time.
        unsafe {
            std::env::set_var(SWITCH, "1");
        }
    }
}
