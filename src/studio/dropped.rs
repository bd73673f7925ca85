//! Files that are dropped on the window: what each of them is, and what opens it.

use std::path::Path;

use super::actions::UiAction;
use super::panels::PanelKind;
use crate::files::{self, MAX_LENS_BYTES};
use crate::session::{Command, GrinCommand, PanelSetting, SceneFile, StructureSearchCommand};

/// A kind of file, by its extension and, for JSON, by its keys.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FileKind {
    Lens,
    Search,
    GrinField,
    Glasses,
    Picture,
}

/// The actions that open a file.
///
/// # Errors
/// A file that cannot be opened in the window, with its name and what can be.
pub(super) fn open_actions(path: &Path) -> Result<Vec<UiAction>, String> {
    let path = path.to_owned();
    let panel = |kind| UiAction::ShowPanel(kind);
    match file_kind(&path)? {
        FileKind::Lens => Ok(vec![Command::Open(path).into()]),
        FileKind::Search => {
            // It may be running: it is shown first, and goes on here when a person asks for it.
            let follow = StructureSearchCommand::Follow(path);
            Ok(vec![follow.into(), panel(PanelKind::Search)])
        }
        FileKind::GrinField => {
            Ok(vec![GrinCommand::OpenFile(path).into(), panel(PanelKind::Slice)])
        }
        FileKind::Glasses => Ok(vec![Command::AddGlasses(path).into()]),
        FileKind::Picture => {
            let file = SceneFile::read(&path).map_err(|why| format!("{why}."))?;
            let scene = Command::Show(PanelSetting::SceneFile(file));
            Ok(vec![scene.into(), panel(PanelKind::Picture)])
        }
    }
}

/// True for the checkpoint of a search.
pub(super) fn is_search(path: &Path) -> bool {
    file_kind(path).is_ok_and(|kind| kind == FileKind::Search)
}

fn refusal(path: &Path, why: &str) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    format!("`{name}` {why}.")
}

fn file_kind(path: &Path) -> Result<FileKind, String> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    match extension.as_str() {
        "zmx" | "zar" | "seq" | "len" | "roa" => Ok(FileKind::Lens),
        "npz" => Ok(FileKind::GrinField),
        "agf" | "yml" | "yaml" => Ok(FileKind::Glasses),
        "png" | "jpg" | "jpeg" => Ok(FileKind::Picture),
        "json" => json_kind(path),
        _ => Err(refusal(
            path,
            "is none of the files that the window opens: a lens (.json, .zmx, .zar, .seq, .len, .roa), a search (.json), a \
             gradient-index task (.json) or volume (.npz), a glass catalogue (.agf, .yml), a picture as a \
             scene (.png, .jpg)",
        )),
    }
}

/// The kind of a JSON file by the key that carries its version, or that a lens of Optiland has.
fn json_kind(path: &Path) -> Result<FileKind, String> {
    let bytes = files::read_file(path, MAX_LENS_BYTES).map_err(|why| why.to_string())?;
    let text = String::from_utf8_lossy(&bytes);
    let has = |key: &str| text.contains(&format!("\"{key}\""));
    if has("aplanat_grin") {
        Ok(FileKind::GrinField)
    } else if has("aplanat_search") {
        Ok(FileKind::Search)
    } else if has("aplanat") || has("surface_group") {
        Ok(FileKind::Lens)
    } else {
        Err(refusal(path, "is JSON without the key `aplanat`, which a lens of this program has"))
    }
}
