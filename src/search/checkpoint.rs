//! Checkpoints: a run as a file, which resumes later bit for bit as if it had not been interrupted.
//!
//! The losses of a file are not trusted: those of its best points are computed again.

use super::sampler::race::Race;
use super::{
    Landscape, ReservoirEntry, SearchError, SearchMethod, SearchPoint, SearchRun, SearchSettings,
};
use crate::files::{CheckpointError, CheckpointFormat};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;

/// The format of the checkpoints of searches. Version 1 described mutations and refusals as text;
/// version 3 added the checksum.
pub const SEARCH_CHECKPOINT: CheckpointFormat =
    CheckpointFormat { key: "aplanat_search", version: 3, first_with_checksum: 3 };

/// The relative difference of two losses that may be rounding.
const LOSS_ROUNDING: f64 = 1e-6;
/// The relative difference of two numbers of a search up to which they are the same.
const NUMBER_ROUNDING: f64 = 1e-12;
/// The field of [`Landscape::fingerprint`] that holds the start of the search, if there is one.
const START: &str = "start";
/// The maximum number of characters of a value in a message.
const SHOWN: usize = 60;

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
        let fingerprint = landscape.fingerprint();
        let content = CheckpointContent {
            aplanat_search: SEARCH_CHECKPOINT.version,
            landscape: &fingerprint,
            run: self,
            beside,
        };
        let is_same = |read: &StoredCheckpoint<Self>| read.run == *self;
        Ok(SEARCH_CHECKPOINT.write(path, &content, is_same)?)
    }

    /// Loads a run, which continues where it was saved, on the same landscape and with the same
    /// settings. Only the limits [`SearchSettings::moves`] and [`SearchSettings::gradients`] may
    /// differ, except for brute force, which has already divided its gradients. Without a
    /// temperature in `settings` the run keeps its own.
    ///
    /// The best points are judged anew: a loss that the landscape does not confirm is replaced by
    /// the computed one.
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
        let read: StoredCheckpoint<Self> = SEARCH_CHECKPOINT.read(path)?;
        if let Err(what) = read.run.check_consistency() {
            return Err(CheckpointError::Corrupt { file, what }.into());
        }
        let temperature = settings.temperature.or(read.run.settings.temperature);
        let settings = SearchSettings { temperature, ..settings.clone() };
        let about = landscape.fingerprint();
        // The start is compared first: much else follows from it.
        let (start, own_start) = (&read.landscape[START], &about[START]);
        if let Some((name, found, expected)) = first_difference("landscape.start", start, own_start)
        {
            return Err(SearchError::OtherStart { file, name, found, expected });
        }
        let pairs = [
            ("landscape", read.landscape, about),
            ("settings", fixed_settings(read.run.settings())?, fixed_settings(&settings)?),
        ];
        for (name, found, expected) in pairs {
            if let Some((name, found, expected)) = first_difference(name, &found, &expected) {
                return Err(SearchError::OtherSearch { file, name, found, expected });
            }
        }
        let mut run = read.run;
        run.settings = settings;
        run.judge_anew(landscape);
        if run.start.loss.is_finite() {
            return Ok(run);
        }
        let what = format!("the loss of the start is {}", run.start.loss);
        Err(CheckpointError::Corrupt { file, what }.into())
    }

    /// Computes the losses of the best points again, and finds the best of them.
    fn judge_anew<L>(&mut self, landscape: &L)
    where
        L: Landscape<Point = P, Memory = M>,
    {
        for chain in &mut self.chains {
            if let Some(descent) = &mut chain.descent {
                let confirmed = confirmed_loss(landscape, &descent.best, descent.best_loss);
                descent.best_loss = confirmed;
            }
        }
        let single = [&mut self.start, &mut self.best].into_iter().chain(&mut self.pinned);
        for entry in single.chain(self.reservoir.entries_mut()) {
            let loss = confirmed_loss(landscape, &entry.point, entry.loss);
            *entry = ReservoirEntry::new(landscape, entry.number, loss, entry.point.clone());
        }
        self.reservoir.remove_non_finite();
        let others = self.reservoir.entries().iter().chain([&self.start]);
        if let Some(best) = others.min_by(|a, b| a.rank(b)).filter(|e| e.is_better_than(&self.best))
        {
            self.best = best.clone();
        }
    }

    /// Checks the consistency of a run that was read.
    fn check_consistency(&self) -> Result<(), String> {
        self.settings.check().map_err(|error| error.to_string())?;
        let numbers = self.lineage.nodes().iter().map(|node| node.number);
        if self.chains.len() != self.settings.chain_count() {
            let [found, expected] = [self.chains.len(), self.settings.chain_count()];
            return Err(format!("found {found} chains; expected {expected}"));
        }
        let is_iterated = self.settings.method == SearchMethod::IteratedLocalSearch;
        let held = self.chains.first().is_some_and(|chain| chain.descent.is_some());
        let is_sound = |race: &Race| held && race.is_of_chains(self.chains.len());
        if self.race.is_some() != is_iterated || !self.race.iter().all(is_sound) {
            return Err("the state of the races does not match the chains".to_owned());
        }
        if !numbers.clone().is_sorted_by(|a, b| a < b)
            || numbers.last().is_some_and(|last| last >= self.lineage.total())
        {
            return Err("the generations are out of order".to_owned());
        }
        Ok(())
    }
}

/// The loss of a point: the stored one if it is that of the landscape but for rounding.
fn confirmed_loss<L: Landscape>(landscape: &L, point: &L::Point, stored: f64) -> f64 {
    let loss = landscape.loss(point);
    let is_same = (loss - stored).abs() <= LOSS_ROUNDING * loss.abs().max(stored.abs());
    if is_same { stored } else { loss }
}

/// The settings that a resumed run may not change.
fn fixed_settings(settings: &SearchSettings) -> Result<Value, SearchError> {
    let mut fixed = settings.clone();
    if fixed.method != SearchMethod::BruteForce {
        (fixed.moves, fixed.gradients) = (None, None);
    }
    fixed.reservoir = Some(settings.reservoir_capacity());
    let corrupt = |error: serde_json::Error| CheckpointError::Corrupt {
        file: "settings".to_owned(),
        what: error.to_string(),
    };
    Ok(serde_json::to_value(fixed).map_err(corrupt)?)
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
        _ => (!is_same_scalar(a, b)).then(|| (name.to_owned(), abbreviate(a), abbreviate(b))),
    }
}

/// True for equal values, and for numbers that differ by rounding: some are computed from the start,
/// and another build may round them otherwise.
fn is_same_scalar(a: &Value, b: &Value) -> bool {
    let (Value::Number(x), Value::Number(y)) = (a, b) else { return a == b };
    let (Some(p), Some(q)) = (x.as_f64(), y.as_f64()) else { return a == b };
    let rounded =
        x.is_f64() && y.is_f64() && (p - q).abs() <= NUMBER_ROUNDING * p.abs().max(q.abs());
    rounded || a == b
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
