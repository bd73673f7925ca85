//! The glass catalogues that a person has added: files `.agf` in a folder of the settings, and folders of
//! materials `.yml`, one for each maker. A list of prices lies beside them.

use super::agf::{AgfCatalogue, parse_agf, read_agf, write_agf};
use super::atomic::write_atomic;
use super::bounded::{MAX_LENS_BYTES, read_file};
use super::error::FileError;
use super::glass_prices::read_prices;
use super::yaml_glass::{
    is_material, maker_of_folder, material_files, parse_material, read_materials,
};
use super::zar;
use crate::lens::glass::{self, Glass};
use std::env;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Once;

/// The variable of the environment that names another folder.
const FOLDER_VARIABLE: &str = "APLANAT_GLASSES";
/// The list of prices.
const PRICES: &str = "prices.csv";
/// The catalogue of melts, which stands for their maker.
const MELTS: &str = "MELT";
/// The largest catalogue, in bytes.
pub(super) const MAX_CATALOGUE_BYTES: u64 = 256 << 20;

/// The folder of the catalogues that a person has added: `aplanat/glasses` in the folder of the
/// settings, or that of the variable `APLANAT_GLASSES`; `None` without a home.
pub fn glass_folder() -> Option<PathBuf> {
    let own = env::var_os(FOLDER_VARIABLE).filter(|folder| !folder.is_empty());
    own.map(PathBuf::from).or_else(|| Some(dirs::config_dir()?.join("aplanat").join("glasses")))
}

/// The catalogues that a person has added, by name.
pub fn own_catalogues() -> Vec<PathBuf> {
    let Some(entries) = glass_folder().and_then(|folder| fs::read_dir(folder).ok()) else {
        return Vec::new();
    };
    let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let is_catalogue = |path: &PathBuf| is_agf(path) || !material_files(path).is_empty();
    let mut paths: Vec<PathBuf> = paths.filter(is_catalogue).collect();
    paths.sort();
    paths
}

/// Makes the glasses of all catalogues that a person has added known, and the prices of the person's list,
/// when it is called first; returns the errors of those that cannot be read.
pub fn load_own_glasses() -> Vec<FileError> {
    static ONCE: Once = Once::new();
    let mut errors = Vec::new();
    ONCE.call_once(|| {
        for path in own_catalogues() {
            match read_own(&path) {
                Ok(catalogue) => add_glasses(&catalogue),
                Err(error) => errors.push(error),
            }
        }
        match glass_folder().map_or(Ok(None), |folder| read_prices(&folder.join(PRICES))) {
            Ok(prices) => prices.into_iter().for_each(glass::set_prices),
            Err(error) => errors.push(error),
        }
    });
    errors
}

fn read_own(path: &Path) -> Result<AgfCatalogue, FileError> {
    if path.is_dir() { Ok(read_materials(path)) } else { read_agf(path) }
}

/// Adds a material for good, beside those of the same maker.
fn add_material(path: &Path, file: &str) -> Result<(AgfCatalogue, Vec<PathBuf>), FileError> {
    let refuse = |found: String, expected: &str| {
        let (file, expected) = (file.to_owned(), expected.to_owned());
        Err(FileError::Unsuitable { file, found, expected })
    };
    let bytes = read_file(path, MAX_LENS_BYTES)?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    let parent = fs::canonicalize(parent.unwrap_or(Path::new(".")));
    let maker = maker_of_folder(&parent.map_err(|source| {
        let file = file.to_owned();
        FileError::Unreadable { file, source }
    })?);
    if maker.is_empty() {
        let found = "a material in the root folder".to_owned();
        return refuse(found, "one in a folder with the name of its maker");
    }
    let added = match parse_material(&bytes, &maker, &name) {
        Ok(material) => material,
        Err(found) => return refuse(found, "a material with a formula"),
    };
    let settings = folder_for_writing(file)?;
    if own_catalogues().iter().any(|known| is_agf(known) && maker_of(known) == maker) {
        let found = format!("a material of {maker}, of which a catalogue .agf was added");
        return refuse(found, "a maker without a catalogue; `aplanat glass --remove` removes one");
    }
    let folder = settings.join(&maker);
    let unwritable = |source| FileError::Unwritable { file: folder.display().to_string(), source };
    fs::create_dir_all(&folder).map_err(unwritable)?;
    let target = folder.join(format!("{name}.yml"));
    write_atomic(&target, &bytes)?;
    add_glasses(&read_materials(&folder));
    Ok((added, vec![target]))
}

/// Adds a catalogue for good: it is copied into the folder of the settings, in place of one of the same
/// name, and its glasses are known from now on. Of an archive `.zar` all catalogues are added, and a
/// material `.yml` is added to those of its folder. Returns what they hold, and where they are kept.
///
/// # Errors
/// A file that is no catalogue, an archive without one, or a folder that cannot be written.
pub fn add_catalogue(path: &Path) -> Result<(AgfCatalogue, Vec<PathBuf>), FileError> {
    let file = path.display().to_string();
    if is_material(path) {
        return add_material(path, &file);
    }
    let bytes = read_file(path, MAX_CATALOGUE_BYTES)?;
    let folder = folder_for_writing(&file)?;
    let catalogues = catalogues_in(bytes, path, &file)?;
    let parse = |(name, bytes): (String, Vec<u8>)| {
        check_maker(&name, &folder, &file)?;
        Ok((parse_agf(&bytes, &name, &file)?, folder.join(format!("{name}.agf")), bytes))
    };
    // Nothing is written unless all of it can be used.
    let parsed: Vec<_> = catalogues.into_iter().map(parse).collect::<Result<_, FileError>>()?;
    let mut found = AgfCatalogue::default();
    let mut saved = Vec::new();
    for (catalogue, target, bytes) in parsed {
        write_atomic(&target, &bytes)?;
        add_glasses(&catalogue);
        found.append(catalogue);
        saved.push(target);
    }
    Ok((found, saved))
}

/// Adds the glass of a melt for good, to the catalogue `MELT` in the folder of the settings; one of the same
/// name is replaced. Returns the file.
///
/// # Errors
/// A catalogue that cannot be read or written, or a glass that no catalogue can hold.
pub fn add_melt(melt: &Glass) -> Result<PathBuf, FileError> {
    let target = folder_for_writing(&melt.name)?.join(format!("{MELTS}.agf"));
    let mut glasses = if target.exists() { read_agf(&target)?.glasses } else { Vec::new() };
    glasses.retain(|other| other.name != melt.name);
    glasses.push(Glass { manufacturer: MELTS.to_owned(), ..melt.clone() });
    let export = write_agf(&glasses, &target)?;
    if let Some((name, why)) = export.refused.first() {
        let (file, found) = (target.display().to_string(), format!("{name}: {why}"));
        let expected = "a glass that an .agf can hold".to_owned();
        return Err(FileError::Unsuitable { file, found, expected });
    }
    add_glasses(&read_agf(&target)?);
    Ok(target)
}

/// Refuses a catalogue whose name is no name of a file, or that of materials that were added.
fn check_maker(name: &str, folder: &Path, file: &str) -> Result<(), FileError> {
    let is_wrong = |letter: char| letter.is_control() || matches!(letter, ':' | '/' | '\\');
    let (found, expected) = if name.is_empty() || name.contains(is_wrong) {
        (format!("a catalogue named `{}`", name.escape_debug()), "the name of a maker")
    } else if folder.join(name).is_dir() {
        let found = format!("a catalogue of {name}, of which materials .yml were added");
        (found, "a maker without materials; `aplanat glass --remove` removes them")
    } else {
        return Ok(());
    };
    let (file, expected) = (file.to_owned(), expected.to_owned());
    Err(FileError::Unsuitable { file, found, expected })
}

/// The makers and the bytes of the catalogues of a file: itself, or those of an archive.
fn catalogues_in(
    bytes: Vec<u8>,
    path: &Path,
    file: &str,
) -> Result<Vec<(String, Vec<u8>)>, FileError> {
    if !zar::is_archive(&bytes) {
        return Ok(vec![(maker_of(path), bytes)]);
    }
    let members = zar::members(&bytes, file)?;
    let mut found: Vec<(String, Vec<u8>)> = Vec::new();
    let mut total = 0;
    for member in members.iter().filter(|member| member.has_extension("agf")) {
        let bytes = member.contents(file)?;
        total += bytes.len() as u64;
        let name = maker_of(Path::new(&member.name()));
        if total > MAX_CATALOGUE_BYTES || found.iter().any(|(other, _)| *other == name) {
            let found = format!("too long a catalogue or a second one: {name}");
            let (file, expected) = (file.to_owned(), "each maker once, 256 MB in all".to_owned());
            return Err(FileError::Unsuitable { file, found, expected });
        }
        found.push((name, bytes));
    }
    if found.is_empty() {
        let (found, expected) = ("an archive without catalogues", "one with a catalogue .agf");
        let (file, found, expected) = (file.to_owned(), found.to_owned(), expected.to_owned());
        return Err(FileError::Unsuitable { file, found, expected });
    }
    Ok(found)
}

/// Removes the catalogue of a name from the folder of the settings; returns its path.
///
/// # Errors
/// There is none of this name, or it cannot be removed.
pub fn remove_catalogue(name: &str) -> Result<PathBuf, FileError> {
    let known = own_catalogues();
    let found = known.iter().find(|path| maker_of(path) == name.to_uppercase());
    let Some(path) = found else {
        let names: Vec<String> = known.iter().map(|path| maker_of(path)).collect();
        let expected = if names.is_empty() {
            "one that was added; there is none".to_owned()
        } else {
            format!("one of {}", names.join(", "))
        };
        let (file, found) = ("the catalogues".to_owned(), format!("`{name}`"));
        return Err(FileError::Unsuitable { file, found, expected });
    };
    let refuse = |source| FileError::Unwritable { file: path.display().to_string(), source };
    if path.is_dir() && !path.is_symlink() {
        for material in material_files(path) {
            fs::remove_file(material).map_err(refuse)?;
        }
        match fs::remove_dir(path) {
            // Files that this program did not put there stay.
            Err(why) if why.kind() == io::ErrorKind::DirectoryNotEmpty => {}
            removed => removed.map_err(refuse)?,
        }
    } else {
        fs::remove_file(path).map_err(refuse)?;
    }
    Ok(path.clone())
}

/// The maker of the glasses of a catalogue or of a folder of materials.
fn maker_of(path: &Path) -> String {
    if path.is_dir() { maker_of_folder(path) } else { maker(path) }
}

/// The maker of the glasses of a catalogue: the name of its file in capitals.
pub(super) fn maker(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().to_uppercase()
}

fn add_glasses(catalogue: &AgfCatalogue) {
    glass::add(catalogue.glasses.clone());
}

fn folder_for_writing(file: &str) -> Result<PathBuf, FileError> {
    let refuse = |file: String, source| FileError::Unwritable { file, source };
    let folder = glass_folder().ok_or_else(|| {
        let text = format!("no folder for settings; expected one in {FOLDER_VARIABLE}");
        refuse(file.to_owned(), io::Error::new(io::ErrorKind::NotFound, text))
    })?;
    fs::create_dir_all(&folder).map_err(|why| refuse(folder.display().to_string(), why))?;
    Ok(folder)
}

fn is_agf(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("agf"))
}
