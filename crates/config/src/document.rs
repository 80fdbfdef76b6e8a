//! The configuration as text: TOML, in which missing keys have their defaults.

use serde::de::DeserializeOwned;
use tautscope_core as core;
use toml::{Table, Value};

use crate::any_loop::{AnyLoop, Selection};
use crate::axes::{AxesSettings, AxisSettings, ROUNDING};
use crate::error::Error;
use crate::ranges::{Number, Ranges};

/// A configuration with every key that the loop and the marker detection read.
#[derive(Debug, Clone)]
pub struct Configuration {
    table: Table,
    dofs: Vec<Dof>,
}

/// A degree of freedom.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Dof {
    /// Its name, used once.
    pub name: String,
    /// "m" or "rad".
    pub unit: String,
}

/// The defaults, with a degree of freedom of `[[dof]]`; written by `tests/config/test_rust_defaults.py`.
const DEFAULTS: &str = include_str!("defaults.toml");
/// Keys of `[[dof]]` without a default.
const OPTIONAL: [&str; 6] = [
    "name",
    "width_limit",
    "range",
    "speed",
    "expected_width",
    "command_speed",
];
/// Sections of which a loop of the article's instrument and its marker detection read every key.
const OF_ARTICLE: [&str; 11] = [
    "control",
    "safety",
    "law",
    "estimation",
    "insertion",
    "rotation",
    "bending",
    "instrument",
    "camera",
    "vision",
    "experiment",
];
/// Sections that a loop with `[[dof]]` reads.
const OF_AXES: [&str; 5] = ["control", "safety", "law", "estimation", "measurement"];
/// Sections that only the other kind of loop uses, with `[[dof]]` and without.
const UNUSED_BY_AXES: [&str; 4] = ["insertion", "rotation", "bending", "instrument"];
const UNUSED_BY_ARTICLE: [&str; 2] = ["kinematics", "measurement"];
/// Keys of `[estimation]` of the bands of an image.
const OF_IMAGES: [&str; 5] = [
    "marker_deviation",
    "shape_deviation",
    "image_deviation",
    "misfit_deviation",
    "misfit_travel",
];
/// Most characters of a name, as in `python/tautscope/config/axes.py`.
const MOST_CHARACTERS: usize = 32;

impl Configuration {
    /// A configuration from TOML: of the article's instrument, or with `[[dof]]` of a robot of yours.
    ///
    /// # Errors
    /// The text is not TOML, a key is unknown, of Python only or, with `[[dof]]`, of another instrument, or a degree of freedom has no
    /// name or a wrong unit; or a number is not finite, or out of its range and not named in `safety.unusual`. Other values are checked
    /// where they are read.
    pub fn parse(text: &str) -> Result<Self, Error> {
        let mut given: Table = toml::from_str(text)?;
        let mut table: Table = toml::from_str(DEFAULTS)?;
        let entry = table.remove("dof").and_then(|mut entries| {
            let entries = entries.as_array_mut()?;
            entries.pop().and_then(|entry| entry.try_into().ok())
        });
        let entries = match given.remove("dof") {
            Some(Value::Array(entries)) => entries,
            Some(other) => {
                return Err(Error(format!(
                    "dof: got {}, expected [[dof]]",
                    other.type_str()
                )));
            }
            None => Vec::new(),
        };
        let has_axes = !entries.is_empty();
        let read: &[&str] = if has_axes { &OF_AXES } else { &OF_ARTICLE };
        let ranges = Ranges::new()?;
        for (name, own) in given {
            let name = name.as_str();
            match table.get_mut(name) {
                Some(default) if !default.is_table() => *default = own,
                // It has no defaults, and only Python reads it.
                _ if name == "drives" && own.is_table() => {}
                _ if name == "drives" => return Err(no_table(name, &own)),
                _ if name == "actuators" => check_actuators(&own)?,
                None => return Err(unknown(name)),
                Some(section) => {
                    let is_read = read.contains(&name);
                    if has_axes && name == "kinematics" {
                        check_kinematics(&own)?;
                    } else if !is_read {
                        check_unused(name, &own, section, has_axes)?;
                    }
                    merge(section, &own, name, &ranges.optional, has_axes && is_read)?;
                }
            }
        }
        let dofs = if has_axes {
            let (entries, dofs) = axes(entries, entry.unwrap_or_default())?;
            table.insert("dof".into(), entries);
            dofs
        } else {
            let names = [("insertion", "m"), ("rotation", "rad"), ("bending", "rad")];
            names.map(|(name, unit)| Dof::new(name, unit)).into()
        };
        ranges.check(&table)?;
        let configuration = Self { table, dofs };
        configuration.check()?;
        Ok(configuration)
    }

    /// Relations between values, of which an error of the core would not name the degree of freedom.
    fn check(&self) -> Result<(), Error> {
        self.check_references()?;
        if !self.has_axes() {
            return self.check_article();
        }
        let Relations {
            control,
            safety,
            measurement,
        } = self.read()?;
        let mut dofs = Vec::<AxisSettings>::new();
        for (index, entry) in self.table["dof"]
            .as_array()
            .into_iter()
            .flatten()
            .enumerate()
        {
            let path = format!("dof[{index}].");
            let dof: AxisSettings = entry
                .clone()
                .try_into()
                .map_err(|error| Error::of_value(&error, &path))?;
            dof.check(entry["unit"].as_str() == Some("m"), &safety)
                .map_err(|error| Error(format!("{path}{error}")))?;
            dofs.push(dof);
        }
        check_friction(&dofs)?;
        let mut limits = vec![("control.history", control.history)];
        if !safety.off.contains(core::Flag::Late) {
            limits.push(("safety.frame_age", safety.frame_age));
        }
        for (index, delay) in measurement.delays.iter().enumerate() {
            for (name, limit) in &limits {
                if delay > limit {
                    return Err(Error(format!(
                        "measurement.delays[{index}]: got {delay}, expected at most {name} = {limit}"
                    )));
                }
            }
        }
        Ok(())
    }

    /// References that are followed, and noise that is not taken for contact.
    fn check_references(&self) -> Result<(), Error> {
        let References { safety, experiment } = self.read()?;
        let Safety { safety: limits } = self.read()?;
        let sines = [
            ("insertion", experiment.insertion),
            ("rotation", experiment.rotation),
            ("bending", experiment.bending),
        ];
        for (index, (name, sine)) in sines.into_iter().enumerate() {
            let least = 2.0 * std::f64::consts::PI * sine.amplitude / limits.reference_speed[index];
            if sine.period < least && !limits.off.contains(core::Flag::ReferenceFast) {
                return Err(Error(format!(
                    "experiment.{name}.period: got {}, expected at least {least}: safety.reference_speed limits faster references",
                    sine.period
                )));
            }
            let dof = self.article_dof(name)?;
            let (noise, tolerance) = (
                safety.state_noise[index],
                dof.contact_tolerance * dof.update_distance,
            );
            if !(noise >= 0.0 && 3.0 * noise < tolerance) {
                return Err(Error(format!(
                    "safety.state_noise[{index}]: got {noise}, expected less than a third of {name}.contact_tolerance times {name}.update_distance = {tolerance}"
                )));
            }
        }
        Ok(())
    }

    fn article_dof(&self, name: &str) -> Result<core::DofSettings, Error> {
        let own = self.table[name].clone();
        own.try_into()
            .map_err(|error| Error::of_value(&error, &format!("{name}.")))
    }

    fn check_article(&self) -> Result<(), Error> {
        self.check_bands()?;
        let Safety { safety } = self.read()?;
        let is_limited = !safety.off.contains(core::Flag::WidthLimit);
        for (Dof { name, .. }, limit) in self.dofs.iter().zip(safety.offset_limit) {
            let dof = self.article_dof(name)?;
            check_dof(&dof).map_err(|error| Error(format!("{name}.{error}")))?;
            let offsets = [
                ("delta_minus", dof.delta_minus),
                ("delta_plus", dof.delta_plus),
            ];
            for (key, offset) in offsets {
                if is_limited && offset.abs() > limit * ROUNDING {
                    return Err(Error(format!(
                        "{name}.{key}: got {offset}, expected at most safety.offset_limit = {limit} from 0"
                    )));
                }
            }
        }
        for (index, (low, high)) in safety.command_travel.iter().enumerate() {
            if low >= high {
                return Err(Error(format!(
                    "safety.command_travel[{index}]: got [{low}, {high}], expected the lower limit, then the upper"
                )));
            }
        }
        Ok(())
    }

    /// Both bands are on the tip, one behind the other.
    fn check_bands(&self) -> Result<(), Error> {
        let Instrument { instrument: own } = self.read()?;
        let (a, b, half) = (own.marker_a, own.marker_b, own.band_length / 2.0);
        if !(half <= a && a <= b - 2.0 * half) {
            return Err(Error(format!(
                "instrument.marker_a: got {a}, expected a band on the tip, proximal of marker_b's band and not overlapping it"
            )));
        }
        if b + half > own.tip_length {
            return Err(Error(format!(
                "instrument.marker_b: got {b}, expected a band within tip_length"
            )));
        }
        Ok(())
    }

    fn has_axes(&self) -> bool {
        self.table.contains_key("dof")
    }

    /// The degrees of freedom in the order of every array.
    pub fn dofs(&self) -> &[Dof] {
        &self.dofs
    }

    /// Any of its keys, as `tautscope_core::Settings` or [`AxesSettings`].
    ///
    /// # Errors
    /// A value is of the wrong kind.
    pub fn read<T: DeserializeOwned>(&self) -> Result<T, Error> {
        Ok(self.table.clone().try_into()?)
    }

    /// The loop at rest, of its `profile`.
    ///
    /// # Errors
    /// A value is of the wrong kind or out of range.
    pub fn build(&self) -> Result<AnyLoop, Error> {
        let selection: Selection = self.read()?;
        let made = if selection.has_axes() {
            self.read::<AxesSettings>()?.build(true)
        } else {
            selection.build_bands(&self.read()?)
        };
        made.map_err(|error| self.locate(error))
    }

    /// An error of the core with the key from the root: the first with its name and value, else with its name.
    pub fn locate(&self, error: core::ConfigError) -> Error {
        let read: &[&str] = if self.has_axes() {
            &OF_AXES
        } else {
            &OF_ARTICLE
        };
        let mut numbers = Vec::new();
        for (name, value) in &self.table {
            if name == "dof" || read.contains(&name.as_str()) {
                Number::collect(value, name.clone(), name.clone(), None, &mut numbers);
            }
        }
        numbers.retain(|number| number.key.rsplit('.').next() == Some(error.field));
        #[expect(clippy::float_cmp, reason = "the value of the table")]
        let same = numbers.iter().find(|number| number.value == error.value);
        let path = same
            .or(numbers.first())
            .map_or(error.field, |own| &own.path);
        let core::ConfigError { value, allowed, .. } = error;
        Error(format!("{path}: got {value}, expected {allowed}"))
    }
}

#[derive(serde::Deserialize)]
struct Relations {
    control: core::ControlSettings,
    safety: core::SafetySettings,
    measurement: Measurement,
}

#[derive(serde::Deserialize)]
struct Measurement {
    delays: Vec<f64>,
}

#[derive(serde::Deserialize)]
struct Instrument {
    instrument: Bands,
}

#[derive(serde::Deserialize)]
struct Bands {
    marker_a: f64,
    marker_b: f64,
    band_length: f64,
    tip_length: f64,
}

#[derive(serde::Deserialize)]
struct References {
    safety: StateNoise,
    experiment: Experiment,
}

#[derive(serde::Deserialize)]
struct StateNoise {
    state_noise: [f64; 3],
}

#[derive(serde::Deserialize)]
struct Experiment {
    insertion: Sine,
    rotation: Sine,
    bending: Sine,
}

#[derive(serde::Deserialize)]
struct Sine {
    amplitude: f64,
    period: f64,
}

#[derive(serde::Deserialize)]
struct Safety {
    safety: core::SafetySettings,
}

fn check_dof(dof: &core::DofSettings) -> Result<(), core::ConfigError> {
    let width = dof.expected_width;
    if width <= 0.0 {
        return Err(core::ConfigError {
            field: "expected_width",
            value: width,
            allowed: "above 0",
        });
    }
    core::Play::new(dof.delta_minus, dof.delta_plus)?;
    core::Compensator::new(dof.free_gain, dof.gain_limit)?.with_recovery(dof.recovery)?;
    core::Estimator::new(
        dof.update_distance,
        dof.contact_tolerance,
        dof.smoothing_factor,
    )?;
    Ok(())
}

impl Dof {
    fn new(name: &str, unit: &str) -> Self {
        let [name, unit] = [name, unit].map(String::from);
        Self { name, unit }
    }
}

/// Entries of `[[dof]]` with every default, and what they are called.
fn axes(entries: Vec<Value>, mut default: Table) -> Result<(Value, Vec<Dof>), Error> {
    for key in ["name", "width_limit"] {
        default.remove(key);
    }
    let (mut all, mut dofs) = (Vec::new(), Vec::<Dof>::new());
    for (index, own) in entries.into_iter().enumerate() {
        let path = format!("dof[{index}]");
        let mut entry = Value::Table(default.clone());
        let optional = OPTIONAL.map(|key| format!("{path}.{key}"));
        merge(&mut entry, &own, &path, &optional, true)?;
        if entry.get("width_limit").is_none() {
            return Err(Error(format!(
                "{path}.width_limit: expected a value: it has no default"
            )));
        }
        let text = |key| entry.get(key).and_then(Value::as_str).unwrap_or_default();
        let (name, unit) = (text("name"), text("unit"));
        if !is_name(name) || dofs.iter().any(|dof| dof.name == name) {
            return Err(Error(format!(
                "{path}.name: got {name:?}, expected a name used once, of 1 to {MOST_CHARACTERS} of a-z, 0-9 and _, a-z first"
            )));
        }
        if !["m", "rad"].contains(&unit) {
            return Err(Error(format!(
                "{path}.unit: got {unit:?}, expected \"m\" or \"rad\""
            )));
        }
        dofs.push(Dof::new(name, unit));
        all.push(entry);
    }
    Ok((Value::Array(all), dofs))
}

/// Whether a text is `Name` of `python/tautscope/config/axes.py`.
fn is_name(text: &str) -> bool {
    let is_allowed = |one| matches!(one, 'a'..='z' | '0'..='9' | '_');
    text.len() <= MOST_CHARACTERS
        && text.starts_with(|first: char| first.is_ascii_lowercase())
        && text.chars().all(is_allowed)
}

fn check_actuators(own: &Value) -> Result<(), Error> {
    if own.as_table().is_some_and(Table::is_empty) {
        return Ok(());
    }
    Err(Error(
        "actuators: got keys, expected none: rigs whose motors are not the degrees of freedom are in Python only".into(),
    ))
}

/// Refuses the name of a friction that none shares, and a lever without one.
fn check_friction(dofs: &[AxisSettings]) -> Result<(), Error> {
    for (index, dof) in dofs.iter().enumerate() {
        let (path, name, lever) = (format!("dof[{index}]"), &dof.friction, dof.lever);
        let count = dofs.iter().filter(|other| other.friction == *name).count();
        #[expect(clippy::float_cmp, reason = "the default")]
        if name.is_empty() && lever != 1.0 {
            return Err(Error(format!(
                "{path}.lever: got {lever}, expected its default: {path} shares no friction"
            )));
        }
        if !name.is_empty() && count == 1 {
            return Err(Error(format!(
                "{path}.friction: got {name:?}, expected the name of two or more DOFs"
            )));
        }
    }
    Ok(())
}

/// Refuses values other than the defaults in a section of the other kind of loop.
fn check_unused(name: &str, own: &Value, default: &Value, has_axes: bool) -> Result<(), Error> {
    let (unused, with): (&[&str], _) = if has_axes {
        (&UNUSED_BY_AXES, "with")
    } else {
        (&UNUSED_BY_ARTICLE, "without")
    };
    for (key, value) in own.as_table().into_iter().flatten() {
        if unused.contains(&name) && default.get(key) != Some(value) {
            return Err(Error(format!("{name}.{key}: not used {with} [[dof]]")));
        }
    }
    Ok(())
}

fn check_kinematics(own: &Value) -> Result<(), Error> {
    match own.get("kind").map_or(Some("joints"), Value::as_str) {
        Some("joints") => Ok(()),
        kind => Err(Error(format!(
            "kinematics.kind: got {:?}, expected \"joints\"; others are in Python only",
            kind.unwrap_or_default()
        ))),
    }
}

/// Takes the values of a section; one that is empty among the defaults has keys of the user's. `optional` has those without a default.
fn merge(
    section: &mut Value,
    own: &Value,
    name: &str,
    optional: &[String],
    has_axes: bool,
) -> Result<(), Error> {
    let (Value::Table(own), Some(section)) = (own, section.as_table_mut()) else {
        return Err(no_table(name, own));
    };
    let is_free = section.is_empty();
    for (key, value) in own {
        let path = format!("{name}.{key}");
        let default = section.get_mut(key);
        let is_of_article = key == "frozen_travel"
            || default
                .as_ref()
                .and_then(|default| default.as_array())
                .is_some_and(|all| all.len() == 3);
        let is_of_images = name == "estimation" && OF_IMAGES.contains(&key.as_str());
        if has_axes && is_of_images && default.as_deref() != Some(value) {
            return Err(Error(format!("{path}: not used with [[dof]]")));
        }
        if has_axes && is_of_article && default.as_deref() != Some(value) {
            return Err(Error(format!(
                "{path}: not used with [[dof]], which has its own"
            )));
        }
        match default {
            Some(default) if default.is_table() => {
                merge(default, value, &path, optional, has_axes)?;
            }
            Some(default) if kind(default) != kind(value) => {
                let found = value.as_str().map(|text| format!("{text:?}"));
                let found = found.unwrap_or_else(|| value.type_str().into());
                let kind = kind(default);
                return Err(Error(format!("{path}: got {found}, expected {kind}")));
            }
            None if !is_free && !optional.contains(&path) => return Err(unknown(&path)),
            _ => {
                section.insert(key.clone(), value.clone());
            }
        }
    }
    Ok(())
}

/// The type of a value; a number is a whole one or not.
fn kind(value: &Value) -> &'static str {
    match value {
        Value::Integer(_) | Value::Float(_) => "a number",
        other => other.type_str(),
    }
}

fn no_table(name: &str, own: &Value) -> Error {
    Error(format!("{name}: got {}, expected a table", own.type_str()))
}

fn unknown(name: &str) -> Error {
    Error(format!("{name}: unknown key"))
}
