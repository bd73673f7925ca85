//! Checkpoints: a run as a file, which resumes later bit for bit as if it had not been interrupted.

use super::{Landscape, SearchError, SearchMethod, SearchPoint, SearchRun, SearchSettings};
use crate::files;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// The version of the file format.
const VERSION: u32 = 1;

/// The field of [`Landscape::fingerprint`] that holds the start of the search, if there is one.
const START: &str = "start";
/// The maximum number of characters of a value in a message.
const SHOWN: usize = 60;

/// The header that all versions of the file share.
#[derive(Deserialize)]
struct CheckpointHeader {
    aplanat_search: u32,
}

#[derive(Serialize)]
struct CheckpointContent<'a, R> {
    aplanat_search: u32,
    landscape: &'a Value,
    run: &'a R,
    #[serde(skip_serializing_if = "Value::is_null")]
    beside: &'a Value,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredCheckpoint<R> {
    #[serde(rename = "aplanat_search")]
    _version: u32,
    landscape: Value,
    run: R,
    /// Data of the program that saved it.
    #[serde(default, rename = "beside")]
    _beside: Value,
}

impl<P: SearchPoint, M: SearchPoint + Default> SearchRun<P, M> {
    /// Saves the run; on failure an existing file is left untouched.
    ///
    /// # Errors
    /// The file cannot be written, or the run would not read back unchanged.
    pub fn save<L>(&self, landscape: &L, path: &Path) -> Result<(), SearchError>
    where
        L: Landscape<Point = P, Memory = M>,
    {
        self.save_with_sidecar(landscape, path, &Value::Null)
    }

    /// Saves the run together with other data under the key `beside`, on which the run does not
    /// depend.
    ///
    /// # Errors
    /// As those of [`SearchRun::save`].
    pub fn save_with_sidecar<L>(
        &self,
        landscape: &L,
        path: &Path,
        beside: &Value,
    ) -> Result<(), SearchError>
    where
        L: Landscape<Point = P, Memory = M>,
    {
        let about = landscape.fingerprint();
        let written =
            CheckpointContent { aplanat_search: VERSION, landscape: &about, run: self, beside };
        let file = path.display().to_string();
        let unproven = |what: String| SearchError::RoundTripFailed { file: file.clone(), what };
        let bytes = serde_json::to_vec(&written).map_err(|error| unproven(error.to_string()))?;
        let read: Result<StoredCheckpoint<Self>, _> = serde_json::from_slice(&bytes);
        let read = read.map_err(|error| unproven(error.to_string()))?;
        if read.run != *self {
            return Err(unproven("it reads back as another run".to_owned()));
        }
        Ok(files::write_atomic(path, &bytes)?)
    }

    /// Loads a run, which continues where it was saved, on the same landscape and with the same
    /// settings. Only the limits [`SearchSettings::moves`] and [`SearchSettings::gradients`] may
    /// differ, except for brute force, which has already divided its gradients.
    ///
    /// # Errors
    /// The file cannot be read, is damaged, has an unknown version, or belongs to another search;
    /// the first difference is named.
    pub fn load<L>(
        landscape: &L,
        settings: &SearchSettings,
        path: &Path,
    ) -> Result<Self, SearchError>
    where
        L: Landscape<Point = P, Memory = M>,
    {
        settings.check()?;
        let file = path.display().to_string();
        let unreadable = |source| files::FileError::Unreadable { file: file.clone(), source };
        let bytes = fs::read(path).map_err(unreadable)?;
        let corrupt = |what: String| SearchError::Corrupt { file: file.clone(), what };
        let head: CheckpointHeader =
            serde_json::from_slice(&bytes).map_err(|e| corrupt(e.to_string()))?;
        if head.aplanat_search != VERSION {
            let (found, expected) = (head.aplanat_search, VERSION);
            return Err(SearchError::UnsupportedVersion { file, found, expected });
        }
        let mut read: StoredCheckpoint<Self> =
            serde_json::from_slice(&bytes).map_err(|e| corrupt(e.to_string()))?;
        read.run.check_consistency().map_err(corrupt)?;
        let about = landscape.fingerprint();
        // The start is compared first: much else follows from it.
        let (start, own_start) = (&read.landscape[START], &about[START]);
        if let Some((name, found, expected)) = first_difference("landscape.start", start, own_start)
        {
            return Err(SearchError::OtherStart { file, name, found, expected });
        }
        let pairs = [
            ("landscape", read.landscape, about),
            ("settings", fixed_settings(read.run.settings())?, fixed_settings(settings)?),
        ];
        for (name, found, expected) in pairs {
            if let Some((name, found, expected)) = first_difference(name, &found, &expected) {
                return Err(SearchError::OtherSearch { file, name, found, expected });
            }
        }
        read.run.settings = settings.clone();
        Ok(read.run)
    }

    /// Checks the consistency of a run that was read.
    fn check_consistency(&self) -> Result<(), String> {
        self.settings.check().map_err(|error| error.to_string())?;
        let numbers = self.tree.nodes().iter().map(|node| node.number);
        if self.chains.len() != self.settings.chains {
            let [found, expected] = [self.chains.len(), self.settings.chains];
            return Err(format!("found {found} chains; expected {expected}"));
        }
        if !numbers.clone().is_sorted_by(|a, b| a < b)
            || numbers.last().is_some_and(|last| last >= self.tree.total())
        {
            return Err("the generations are out of order".to_owned());
        }
        Ok(())
    }
}

/// The settings that a resumed run may not change.
fn fixed_settings(settings: &SearchSettings) -> Result<Value, SearchError> {
    let mut fixed = settings.clone();
    if fixed.method != SearchMethod::BruteForce {
        (fixed.moves, fixed.gradients) = (None, None);
    }
    let unwritable = |error: serde_json::Error| SearchError::Corrupt {
        file: "settings".to_owned(),
        what: error.to_string(),
    };
    serde_json::to_value(fixed).map_err(unwritable)
}

/// The first difference of two values: its path and both values. Scalars are compared before arrays
/// and objects, since they give shorter messages.
fn first_difference(name: &str, a: &Value, b: &Value) -> Option<(String, String, String)> {
    match (a, b) {
        (Value::Object(a), Value::Object(b)) => {
            let keys: BTreeSet<&String> = a.keys().chain(b.keys()).collect();
            let of = |map: &serde_json::Map<String, Value>, key: &String| {
                map.get(key).cloned().unwrap_or_default()
            };
            let pairs = keys.into_iter().map(|key| (key, of(a, key), of(b, key)));
            let (nested, plain): (Vec<_>, Vec<_>) =
                pairs.partition(|(_, a, b)| is_nested(a) || is_nested(b));
            let mut all = plain.into_iter().chain(nested);
            all.find_map(|(key, a, b)| first_difference(&format!("{name}.{key}"), &a, &b))
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            let mut pairs = a.iter().zip(b).enumerate();
            pairs.find_map(|(i, (a, b))| first_difference(&format!("{name}[{i}]"), a, b))
        }
        _ => (a != b).then(|| (name.to_owned(), abbreviate(a), abbreviate(b))),
    }
}

fn is_nested(value: &Value) -> bool {
    value.is_object() || value.is_array()
}

/// A value, abbreviated.
fn abbreviate(value: &Value) -> String {
    if let Value::Array(entries) = value {
        return format!("a list of {}", entries.len());
    }
    let text = value.to_string();
    if text.chars().count() <= SHOWN {
        return text;
    }
    text.chars().take(SHOWN).chain("...".chars()).collect()
}
