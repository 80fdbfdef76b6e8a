//! The configuration as text: TOML, in which missing keys have their defaults.

use std::fmt;

use serde::de::DeserializeOwned;
use tautscope_core as core;
use toml::{Table, Value};

use crate::any_loop::{AnyLoop, Selection};
use crate::axes::AxesSettings;

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

/// Why a text is no configuration: the key, what came, and what may come.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Error(String);

impl fmt::Display for Error {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str(&self.0)
    }
}

impl std::error::Error for Error {}

impl From<core::ConfigError> for Error {
    fn from(error: core::ConfigError) -> Self {
        Self(error.to_string())
    }
}

impl From<toml::de::Error> for Error {
    fn from(error: toml::de::Error) -> Self {
        Self(format!("configuration: {error}"))
    }
}

/// The defaults, with a degree of freedom of `[[dof]]`; written by `tests/config/test_rust_defaults.py`.
const DEFAULTS: &str = include_str!("defaults.toml");
/// Ranges of the numbers; written by the same test.
const RANGES: &str = include_str!("ranges.toml");
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
/// Sections without defaults that only Python reads.
const OF_PYTHON: [&str; 2] = ["drives", "actuators"];

impl Configuration {
    /// A configuration from TOML: of the article's instrument, or with `[[dof]]` of a robot of yours.
    ///
    /// # Errors
    /// The text is not TOML, a key is unknown or, with `[[dof]]`, of another instrument, or a degree of freedom has no name or a wrong
    /// unit; or a number is not finite, or out of its range and not named in `safety.unusual`. Other values are checked where they are
    /// read.
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
        for (name, own) in given {
            let name = name.as_str();
            match table.get_mut(name) {
                Some(default) if !default.is_table() => *default = own,
                _ if OF_PYTHON.contains(&name) => {}
                None => return Err(unknown(name)),
                Some(_) if has_axes && name == "kinematics" => check_kinematics(&own)?,
                Some(section) if read.contains(&name) => {
                    merge(section, &own, name, &[], has_axes)?;
                }
                Some(_) => {}
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
        let ranges: Ranges = toml::from_str(RANGES)?;
        let unusual = ranges.named(&table)?;
        for (name, value) in &table {
            ranges.check(value, name, &unusual)?;
        }
        Ok(Self { table, dofs })
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
        Ok(if selection.has_axes() {
            self.read::<AxesSettings>()?.build(true)?
        } else {
            selection.build_bands(&self.read()?)?
        })
    }
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
    for own in entries {
        let mut entry = Value::Table(default.clone());
        merge(&mut entry, &own, "dof", &OPTIONAL, true)?;
        let text = |key| entry.get(key).and_then(Value::as_str).unwrap_or_default();
        let (name, unit) = (text("name"), text("unit"));
        if name.is_empty() || name.contains('\0') || dofs.iter().any(|dof| dof.name == name) {
            return Err(Error(format!(
                "dof.name: got {name:?}, expected a name used once"
            )));
        }
        if !["m", "rad"].contains(&unit) {
            return Err(Error(format!(
                "dof.unit: got {unit:?}, expected \"m\" or \"rad\""
            )));
        }
        dofs.push(Dof::new(name, unit));
        all.push(entry);
    }
    Ok((Value::Array(all), dofs))
}

/// Least and largest values by key: a pair, or one for each item of a list.
#[derive(serde::Deserialize)]
struct Ranges {
    /// Of the keys that `safety.unusual` may name.
    usual: Table,
    always: Table,
}

impl Ranges {
    /// The keys that `safety.unusual` names.
    fn named(&self, table: &Table) -> Result<Vec<String>, Error> {
        let names = table.get("safety").and_then(|own| own.get("unusual"));
        let names: Vec<String> = names.cloned().map_or(Ok(Vec::new()), Value::try_into)?;
        match names.iter().find(|name| !self.usual.contains_key(*name)) {
            Some(name) => Err(Error(format!(
                "safety.unusual: got {name:?}, expected the key of a number with a usual range"
            ))),
            None => Ok(names),
        }
    }

    /// No comparison with a number that is not finite would hold, so that each check with it would be off; a wrong unit does the same.
    fn check(&self, value: &Value, name: &str, unusual: &[String]) -> Result<(), Error> {
        match value {
            Value::Table(own) => own
                .iter()
                .try_for_each(|(key, value)| self.check(value, &format!("{name}.{key}"), unusual)),
            Value::Array(all) if all.iter().all(Value::is_table) => all
                .iter()
                .try_for_each(|value| self.check(value, name, unusual)),
            _ if unusual.iter().any(|key| key == name) => check_number(value, name, None, ""),
            _ => match self.usual.get(name) {
                None => check_number(value, name, self.always.get(name), ""),
                range => check_number(value, name, range, ", or named in safety.unusual"),
            },
        }
    }
}

/// A number, or each of a list.
fn check_number(
    value: &Value,
    name: &str,
    range: Option<&Value>,
    waiver: &str,
) -> Result<(), Error> {
    #[expect(clippy::cast_precision_loss, reason = "compared with a limit")]
    let number = match value {
        Value::Array(all) => {
            let ranges = range.and_then(Value::as_array);
            let of_items = ranges.filter(|ranges| ranges.iter().all(Value::is_array));
            return all.iter().enumerate().try_for_each(|(index, value)| {
                let own = of_items.map_or(range, |ranges| ranges.get(index));
                check_number(value, name, own, waiver)
            });
        }
        Value::Float(number) => *number,
        Value::Integer(number) => *number as f64,
        _ => return Ok(()),
    };
    if !number.is_finite() {
        return Err(Error(format!(
            "{name}: got {number}, expected a finite number"
        )));
    }
    let Some((low, high)) = range.and_then(|range| range.clone().try_into::<(f64, f64)>().ok())
    else {
        return Ok(());
    };
    if (low..=high).contains(&number) {
        Ok(())
    } else {
        Err(Error(format!(
            "{name}: got {number}, expected {low} to {high}{waiver}"
        )))
    }
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

/// Takes the values of a section.
fn merge(
    section: &mut Value,
    own: &Value,
    name: &str,
    optional: &[&str],
    has_axes: bool,
) -> Result<(), Error> {
    let (Value::Table(own), Some(section)) = (own, section.as_table_mut()) else {
        return Err(Error(format!(
            "{name}: got {}, expected a table",
            own.type_str()
        )));
    };
    for (key, value) in own {
        let default = section.get_mut(key);
        let is_of_article = key == "frozen_travel"
            || default
                .as_ref()
                .and_then(|default| default.as_array())
                .is_some_and(|all| all.len() == 3);
        if has_axes && is_of_article && default.as_deref() != Some(value) {
            return Err(Error(format!(
                "{name}.{key}: not used with [[dof]], which has its own"
            )));
        }
        match default {
            Some(default) if default.is_table() => {
                merge(default, value, &format!("{name}.{key}"), &[], has_axes)?;
            }
            None if !optional.contains(&key.as_str()) => {
                return Err(unknown(&format!("{name}.{key}")));
            }
            _ => {
                section.insert(key.clone(), value.clone());
            }
        }
    }
    Ok(())
}

fn unknown(name: &str) -> Error {
    Error(format!("{name}: unknown key"))
}
