//! The configuration: TOML with every key, as `tautscope config` prints it; with `[[dof]]`, missing keys have their defaults.

use std::ffi::{CStr, CString};

use serde::Deserialize;
use serde::de::DeserializeOwned;
use tautscope_axes::{AnyLoop, AxesSettings, Selection};
use tautscope_core as core;
use tautscope_vision::PixelFormat;
use toml::{Table, Value};

use crate::result::{TautscopeResult, failed};

/// What the detection reads beside the settings of the core.
#[derive(Debug, Deserialize)]
pub struct DetectionDocument {
    /// `[vision]`.
    pub vision: tautscope_vision::Settings,
    /// `[camera]`: the images' size.
    pub camera: ImageSize,
    /// `[experiment]`: the workspace.
    pub experiment: Experiment,
}

/// Size and format of the images, in `[camera]`.
#[derive(Debug, Deserialize)]
pub struct ImageSize {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Name of the format.
    pub pixel_format: String,
}

/// The motion of each DOF, `[experiment]`.
#[derive(Debug, Clone, Copy, Deserialize)]
pub struct Experiment {
    insertion: Sine,
    rotation: Sine,
    bending: Sine,
}

#[derive(Debug, Clone, Copy, Deserialize)]
struct Sine {
    centre: f64,
    amplitude: f64,
}

/// A loop at rest, as a configuration describes it.
pub struct LoopDocument {
    /// The loop.
    pub inner: AnyLoop,
    /// Of a loop with `[[dof]]`.
    pub sensors: Sensors,
    /// Control period in s.
    pub period: f64,
}

/// What the sensors of a loop with `[[dof]]` need, `[measurement]`.
#[derive(Debug, Default, Deserialize)]
pub struct Sensors {
    /// Standard deviation of a tip that is measured degree by degree, in `width_limit`.
    pub tip_deviation: f64,
    /// How much earlier than its time stamps say each sensor measures, in s.
    #[serde(default)]
    pub delays: Vec<f64>,
    /// `width_limit` of each degree of freedom [m or rad].
    #[serde(skip)]
    pub widths: Vec<f64>,
    /// Name and unit of each degree of freedom, also without `[[dof]]`.
    #[serde(skip)]
    pub names: Vec<[CString; 2]>,
}

impl LoopDocument {
    /// The loop of a configuration: with `[[dof]]` keys that are not in the text have their defaults.
    ///
    /// # Errors
    /// The text is not TOML in UTF-8, a value is of the wrong kind or out of range, or a key is missing; with `[[dof]]` also one
    /// that is unknown or of another instrument.
    pub fn new(text: &[u8]) -> Result<Self, TautscopeResult> {
        let wrong = |error: core::ConfigError| config(format_args!("{error}"));
        let selection: Selection = parsed(text)?;
        if selection.has_axes() {
            let (axes, mut sensors) = axes_document(text)?;
            sensors.widths = axes.dof.iter().map(|dof| dof.width_limit).collect();
            return Ok(Self {
                inner: axes.build(true).map_err(wrong)?,
                sensors,
                period: axes.control.period,
            });
        }
        let settings: core::Settings = parsed(text)?;
        Ok(Self {
            inner: selection.build_bands(&settings).map_err(wrong)?,
            sensors: Sensors {
                names: ARTICLE.map(|texts| texts.map(CString::from)).into(),
                ..Sensors::default()
            },
            period: settings.control.period,
        })
    }
}

/// Settings of a detector and the model it predicts the bands with.
///
/// # Errors
/// As [`LoopDocument::new`].
pub fn detector_settings(
    text: &[u8],
) -> Result<(DetectionDocument, core::FeatureModel, PixelFormat), TautscopeResult> {
    let document: DetectionDocument = parsed(text)?;
    let settings: core::Settings = parsed(text)?;
    let model = settings
        .feature_model()
        .map_err(|error| config(format_args!("{error}")))?;
    let size = &document.camera;
    let format = PixelFormat::named(&size.pixel_format)
        .and_then(|format| {
            format.check_sides([size.width, size.height].map(|side| side as usize))?;
            Ok(format)
        })
        .map_err(|error| config(format_args!("camera.{error}")))?;
    Ok((document, model, format))
}

const ARTICLE: [[&CStr; 2]; 3] = [
    [c"insertion", c"m"],
    [c"rotation", c"rad"],
    [c"bending", c"rad"],
];
/// A configuration of one degree of freedom with every default, written by `tests/config/test_axes_defaults.py`.
const DEFAULTS: &str = include_str!("defaults.toml");
/// Keys of `[[dof]]` without a default.
const OPTIONAL: [&str; 5] = ["name", "width_limit", "range", "speed", "expected_width"];

/// Settings of a loop with `[[dof]]`.
fn axes_document(text: &[u8]) -> Result<(AxesSettings, Sensors), TautscopeResult> {
    let wrong = |error: toml::de::Error| config(format_args!("configuration: {error}"));
    let given: Table = toml::from_str(utf8(text)?).map_err(wrong)?;
    let mut table: Table = toml::from_str(DEFAULTS).map_err(wrong)?;
    let entry = table
        .remove("dof")
        .and_then(|entries| entries.get(0).cloned());
    let mut entry = entry
        .and_then(|entry| entry.try_into::<Table>().ok())
        .unwrap_or_default();
    for key in ["name", "width_limit"] {
        entry.remove(key);
    }
    let (mut dofs, mut names) = (Vec::new(), Vec::<[CString; 2]>::new());
    for (name, value) in given {
        match (name.as_str(), value) {
            ("dof", Value::Array(entries)) => {
                for own in entries {
                    let mut dof = entry.clone();
                    merge(&mut dof, own, "dof", &OPTIONAL)?;
                    let text = |key| dof.get(key).and_then(Value::as_str).unwrap_or_default();
                    let (name, unit) = (text("name"), text("unit"));
                    let is_taken = |[other, _]: &[CString; 2]| other.to_str() == Ok(name);
                    if name.is_empty() || name.contains('\0') || names.iter().any(is_taken) {
                        return Err(config(format_args!(
                            "dof.name: got {name:?}, expected a name used once"
                        )));
                    }
                    if !["m", "rad"].contains(&unit) {
                        return Err(config(format_args!(
                            "dof.unit: got {unit:?}, expected \"m\" or \"rad\""
                        )));
                    }
                    names.push([name, unit].map(|text| CString::new(text).unwrap_or_default()));
                    dofs.push(Value::Table(dof));
                }
            }
            ("profile", value) => {
                table.insert(name, value);
            }
            ("kinematics", own) => {
                let kind = own.get("kind").map_or(Some("joints"), Value::as_str);
                if kind != Some("joints") {
                    let kind = kind.unwrap_or_default();
                    return Err(config(format_args!(
                        "kinematics.kind: got {kind:?}, expected \"joints\"; others are in Python only"
                    )));
                }
            }
            // Not used with `[[dof]]`, but for defaults.
            ("drives" | "insertion" | "rotation" | "bending", _) => {}
            (name, own) => match table.get_mut(name) {
                Some(Value::Table(section)) if SECTIONS.contains(&name) => {
                    merge(section, own, name, &[])?;
                }
                Some(_) => {}
                None => return Err(unknown(name)),
            },
        }
    }
    table.insert("dof".into(), Value::Array(dofs));
    let mut sensors: Sensors = table["measurement"].clone().try_into().map_err(wrong)?;
    sensors.names = names;
    Ok((table.try_into().map_err(wrong)?, sensors))
}

/// Sections that a loop with `[[dof]]` reads.
const SECTIONS: [&str; 5] = ["control", "safety", "law", "estimation", "measurement"];

/// Takes the values of a section.
fn merge(
    section: &mut Table,
    own: Value,
    name: &str,
    optional: &[&str],
) -> Result<(), TautscopeResult> {
    let Value::Table(own) = own else {
        return Err(config(format_args!(
            "{name}: got a {}, expected a table",
            own.type_str()
        )));
    };
    for (key, value) in own {
        let default = section.get(&key);
        if default.is_none() && !optional.contains(&key.as_str()) {
            return Err(unknown(&format!("{name}.{key}")));
        }
        let is_of_article = key == "frozen_travel"
            || default
                .and_then(Value::as_array)
                .is_some_and(|all| all.len() == 3);
        if is_of_article && default != Some(&value) {
            return Err(config(format_args!(
                "{name}.{key}: not used with [[dof]], which has its own"
            )));
        }
        section.insert(key, value);
    }
    Ok(())
}

fn unknown(name: &str) -> TautscopeResult {
    config(format_args!("{name}: unknown key"))
}

/// The error of a configuration.
pub fn config(message: std::fmt::Arguments<'_>) -> TautscopeResult {
    failed(TautscopeResult::Config, message)
}

fn parsed<T: DeserializeOwned>(text: &[u8]) -> Result<T, TautscopeResult> {
    toml::from_str(utf8(text)?).map_err(|error| {
        config(format_args!(
            "configuration: {error}every key is needed, as `tautscope config` prints them, or [[dof]]"
        ))
    })
}

fn utf8(text: &[u8]) -> Result<&str, TautscopeResult> {
    str::from_utf8(text).map_err(|error| config(format_args!("configuration: not UTF-8: {error}")))
}

impl Experiment {
    fn sines(self) -> [Sine; 3] {
        [self.insertion, self.rotation, self.bending]
    }

    /// States that cover the workspace, and standard deviations between them: `workspace_starts` of
    /// `python/tautscope/loop/vision.py`, to the bit.
    pub fn starts(self) -> (Vec<[f64; 3]>, [f64; 3]) {
        let sines = self.sines();
        let axes = std::array::from_fn(|dof| {
            let count = [2, 5, 2][dof];
            let Sine { centre, amplitude } = sines[dof];
            let end = 1.0 / f64::from(count);
            linspace(-1.0 + end, 1.0 - end, count)
                .map(|share| centre + amplitude * share)
                .collect()
        });
        let mut states = vec![sines.map(|sine| sine.centre)];
        states.extend(product(&axes));
        (states, sines.map(|sine| sine.amplitude))
    }

    /// Postures that cover the workspace: `_workspace` of the same file, to the bit.
    pub fn postures(self) -> Vec<[f64; 3]> {
        let sines = self.sines();
        product(&std::array::from_fn(|dof| {
            let Sine { centre, amplitude } = sines[dof];
            linspace(-1.0, 1.0, [13, 45, 23][dof])
                .map(|share| centre + 1.1 * amplitude * share)
                .collect()
        }))
        .collect()
    }
}

/// Evenly spaced numbers with both ends, as `numpy.linspace` rounds them.
fn linspace(start: f64, stop: f64, count: u32) -> impl Iterator<Item = f64> {
    let step = (stop - start) / f64::from(count - 1);
    (0..count).map(move |index| {
        if index + 1 == count {
            stop
        } else {
            f64::from(index) * step + start
        }
    })
}

/// Every combination, the last axis fastest.
fn product(axes: &[Vec<f64>; 3]) -> impl Iterator<Item = [f64; 3]> {
    let [first, second, third] = axes;
    first.iter().flat_map(move |a| {
        second
            .iter()
            .flat_map(move |b| third.iter().map(move |c| [*a, *b, *c]))
    })
}
