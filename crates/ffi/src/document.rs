//! The configuration, in TOML.

use std::ffi::CString;

use serde::Deserialize;
use tautscope_config::{AnyLoop, Configuration};
use tautscope_core as core;
use tautscope_vision::PixelFormat;

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
    /// What its sensors need.
    pub sensors: Sensors,
    /// Control period in s.
    pub period: f64,
}

/// What the sensors of a loop with `[[dof]]` need.
#[derive(Debug)]
pub struct Sensors {
    /// Standard deviation of a tip that is measured degree by degree, in `width_limit`.
    pub tip_deviation: f64,
    /// How much earlier than its time stamps say each sensor measures, in s.
    pub delays: Vec<f64>,
    /// `width_limit` of each degree of freedom [m or rad]; empty without `[[dof]]`.
    pub widths: Vec<f64>,
    /// Name and unit of each degree of freedom, also without `[[dof]]`.
    pub names: Vec<[CString; 2]>,
}

#[derive(Debug, Deserialize)]
struct LoopSections {
    control: core::ControlSettings,
    measurement: Measurement,
    #[serde(default)]
    dof: Vec<Width>,
}

#[derive(Debug, Deserialize)]
struct Measurement {
    tip_deviation: f64,
    #[serde(default)]
    delays: Vec<f64>,
}

#[derive(Debug, Deserialize)]
struct Width {
    width_limit: f64,
}

impl LoopDocument {
    /// The loop of a configuration: keys that are not in the text have their defaults.
    ///
    /// # Errors
    /// The text is not TOML in UTF-8, a key is unknown, or a value of the wrong kind or out of range.
    pub fn new(text: &[u8]) -> Result<Self, TautscopeResult> {
        let configuration = parsed(text)?;
        let inner = configuration.build().map_err(wrong)?;
        let sections: LoopSections = configuration.read().map_err(wrong)?;
        let std = sections.measurement.tip_deviation;
        if std <= 0.0 {
            return Err(config(format_args!(
                "measurement.tip_deviation: got {std}, expected above 0"
            )));
        }
        let named = |text: &str| CString::new(text).unwrap_or_default();
        let dofs = configuration.dofs().iter();
        Ok(Self {
            inner,
            sensors: Sensors {
                tip_deviation: sections.measurement.tip_deviation,
                delays: sections.measurement.delays,
                widths: sections.dof.iter().map(|dof| dof.width_limit).collect(),
                names: dofs
                    .map(|dof| [named(&dof.name), named(&dof.unit)])
                    .collect(),
            },
            period: sections.control.period,
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
    let configuration = parsed(text)?;
    let document: DetectionDocument = configuration.read().map_err(wrong)?;
    let settings: core::Settings = configuration.read().map_err(wrong)?;
    let model = settings.feature_model();
    let model = model.map_err(|error| wrong(configuration.locate(error)))?;
    let size = &document.camera;
    let format = PixelFormat::named(&size.pixel_format)
        .and_then(|format| {
            format.check_sides([size.width, size.height].map(|side| side as usize))?;
            Ok(format)
        })
        .map_err(|error| config(format_args!("camera.{error}")))?;
    Ok((document, model, format))
}

/// The error of a configuration.
pub fn config(message: std::fmt::Arguments<'_>) -> TautscopeResult {
    failed(TautscopeResult::Config, message)
}

fn wrong(error: impl std::fmt::Display) -> TautscopeResult {
    config(format_args!("{error}"))
}

fn parsed(text: &[u8]) -> Result<Configuration, TautscopeResult> {
    let text = str::from_utf8(text)
        .map_err(|error| config(format_args!("configuration: not UTF-8: {error}")))?;
    Configuration::parse(text).map_err(wrong)
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
