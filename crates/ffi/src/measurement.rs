//! Updates of `TautscopeLoop` by measurements: of the tip degree by degree, or of a sensor with a model of the caller's.
#![allow(unsafe_code)]

use std::ffi::{c_int, c_void};

use tautscope_core as core;
use tautscope_core::{DOFS, SENSORS, VALUES};

use crate::document::Sensors;
use crate::pointers::{check_report, numbers, read, write_report};
use crate::reduction::{TautscopeLoop, check_finite};
use crate::result::{TautscopeResult, failed, null, with_handle};
use crate::types::{TautscopeMeasurement, TautscopeTipReport};

/// Step of a central difference, in `width_limit`.
const STEP: f64 = 1e-5;

/// What a sensor would measure in a state: its values and their derivatives.
///
/// `state` is (n,) [m or rad], `values` the place for the measurement's count m of values, `jacobian` that for dz/dq (m, n) row by
/// row. If it leaves NaN in `jacobian`, as it was, central differences are used; they call it twice per degree of freedom.
///
/// It returns 0 where the sensor sees nothing. It must not call functions with the same handle.
pub type TautscopePredict = Option<
    unsafe extern "C" fn(
        context: *mut c_void,
        state: *const f64,
        values: *mut f64,
        jacobian: *mut f64,
    ) -> c_int,
>;

/// A measurement with its pointers checked.
struct Checked<'a> {
    values: &'a [f64],
    covariance: Option<&'a [f64]>,
    point: usize,
    captured_at: f64,
    sensor: usize,
}

impl<'a> Checked<'a> {
    /// # Safety
    /// The caller's contract of `tautscope_loop_on_measurement`.
    unsafe fn new(
        measurement: *const TautscopeMeasurement,
        sensors: &Sensors,
    ) -> Result<Self, TautscopeResult> {
        // SAFETY: the caller's contract.
        let given = unsafe { read("measurement", measurement) }?;
        let count = given.count;
        if !(1..=VALUES).contains(&count) {
            return Err(failed(
                TautscopeResult::Size,
                format_args!("measurement.count: got {count}, expected 1 to {VALUES}"),
            ));
        }
        // SAFETY: the caller's contract.
        let values: &'a [f64] = unsafe { numbers("measurement.values", given.values, count) }?;
        if values.iter().any(|value| value.is_infinite()) || values.iter().all(|v| v.is_nan()) {
            return Err(signal(format_args!(
                "measurement.values: got {values:?}, expected finite numbers, NaN for those not measured"
            )));
        }
        let name = "measurement.covariance";
        let covariance: Option<&'a [f64]> = if given.covariance.is_null() {
            None
        } else {
            // SAFETY: the caller's contract.
            Some(unsafe { numbers(name, given.covariance, count * count) }?)
        };
        if covariance.is_some_and(|matrix| !is_covariance(matrix, count)) {
            return Err(signal(format_args!(
                "{name}: expected a symmetric and positive definite matrix of {count} rows"
            )));
        }
        if given.sensor as usize >= SENSORS {
            let found = given.sensor;
            return Err(signal(format_args!(
                "measurement.sensor: got {found}, expected 0 to 3"
            )));
        }
        check_finite("measurement.captured_at", given.captured_at)?;
        let sensor = given.sensor as usize;
        Ok(Self {
            values,
            covariance,
            point: given.point.max(1) as usize,
            captured_at: given.captured_at - sensors.delays.get(sensor).unwrap_or(&0.0),
            sensor,
        })
    }

    fn update(
        &self,
        axes: &mut dyn core::Axes,
        covariance: &[f64],
        model: &dyn core::Predict,
    ) -> TautscopeTipReport {
        let report = axes.on_reading(&core::Reading {
            values: self.values,
            covariance,
            point: self.point,
            captured_at: self.captured_at,
            sensor: self.sensor,
            model,
        });
        TautscopeTipReport::new(&report, axes, self.captured_at)
    }
}

/// A sensor of the tip, degree by degree.
struct Tip;

impl core::Predict for Tip {
    fn predict(&self, state: &[f64], values: &mut [f64], jacobian: &mut [f64]) -> bool {
        values.copy_from_slice(state);
        for (index, entry) in jacobian.iter_mut().enumerate() {
            *entry = f64::from(index % (state.len() + 1) == 0);
        }
        true
    }
}

/// A sensor whose model is a function of the caller's.
struct Own {
    function: unsafe extern "C" fn(*mut c_void, *const f64, *mut f64, *mut f64) -> c_int,
    context: *mut c_void,
    steps: [f64; DOFS],
}

impl Own {
    fn call(&self, state: &[f64], values: &mut [f64], jacobian: &mut [f64]) -> bool {
        let (values, jacobian) = (values.as_mut_ptr(), jacobian.as_mut_ptr());
        // SAFETY: the contract of `tautscope_loop_on_measurement`; the arrays have the lengths it states.
        unsafe { (self.function)(self.context, state.as_ptr(), values, jacobian) != 0 }
    }

    /// dz/dq by central differences, as `jacobian_by_differences` of `python/tautscope/loop/kinematics.py`, to the bit.
    fn differences(&self, state: &[f64], count: usize, jacobian: &mut [f64]) -> bool {
        let (dofs, mut unused) = (state.len(), [f64::NAN; VALUES * DOFS]);
        for (dof, step) in self.steps.iter().take(dofs).enumerate() {
            let mut values = [[f64::NAN; VALUES]; 2];
            for (values, step) in values.iter_mut().zip([*step, -step]) {
                let mut moved = [0.0; DOFS];
                moved[..dofs].copy_from_slice(state);
                moved[dof] += step;
                if !self.call(&moved[..dofs], values, &mut unused) {
                    return false;
                }
            }
            let [ahead, behind] = values;
            for value in 0..count {
                jacobian[value * dofs + dof] = (ahead[value] - behind[value]) / (2.0 * step);
            }
        }
        true
    }
}

impl core::Predict for Own {
    fn predict(&self, state: &[f64], values: &mut [f64], jacobian: &mut [f64]) -> bool {
        values.fill(f64::NAN);
        jacobian.fill(f64::NAN);
        self.call(state, values, jacobian)
            && (!jacobian.iter().any(|entry| entry.is_nan())
                || self.differences(state, values.len(), jacobian))
    }
}

/// Update of a loop with `[[dof]]` by the tip measured degree by degree. It does not allocate.
///
/// `measurement` has n values [m or rad]; without a covariance `measurement.tip_deviation` of the configuration is used. `report`
/// may be null.
///
/// # Safety
/// The handle is valid and used by this thread only; `measurement` and what it points to are readable; `report` is null or points to
/// as many writable bytes as its member `size` states.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_loop_on_tip(
    handle: *mut TautscopeLoop,
    measurement: *const TautscopeMeasurement,
    report: *mut TautscopeTipReport,
) -> TautscopeResult {
    let update = |handle: &mut TautscopeLoop, checked: &Checked<'_>| {
        let dofs = checked.values.len();
        handle.check_dofs("measurement.count", dofs)?;
        let (axes, sensors) = handle.axes()?;
        let mut covariance = [0.0; DOFS * DOFS];
        for (dof, width) in sensors.widths.iter().enumerate() {
            let std = sensors.tip_deviation * width;
            covariance[dof * (dofs + 1)] = std * std;
        }
        let covariance = checked.covariance.unwrap_or(&covariance[..dofs * dofs]);
        Ok(checked.update(axes, covariance, &Tip))
    };
    // SAFETY: the caller's contract.
    unsafe { report_update(handle.as_mut(), measurement, report, update) }
}

/// Update of a loop with `[[dof]]` by any measurement of the tip: `predict` is what the sensor would measure in a state. It does
/// not allocate.
///
/// `measurement` has up to 16 values and a covariance. `predict` is called several times, with `context`, before this returns.
/// `report` may be null.
///
/// # Safety
/// As `tautscope_loop_on_tip`; `predict` keeps to `TautscopePredict` and throws no exception.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tautscope_loop_on_measurement(
    handle: *mut TautscopeLoop,
    measurement: *const TautscopeMeasurement,
    predict: TautscopePredict,
    context: *mut c_void,
    report: *mut TautscopeTipReport,
) -> TautscopeResult {
    let update = |handle: &mut TautscopeLoop, checked: &Checked<'_>| {
        let (axes, sensors) = handle.axes()?;
        let covariance = checked.covariance;
        let covariance = covariance.ok_or_else(|| null("measurement.covariance"))?;
        let mut steps = [0.0; DOFS];
        for (step, width) in steps.iter_mut().zip(&sensors.widths) {
            *step = STEP * width;
        }
        let model = Own {
            function: predict.ok_or_else(|| null("predict"))?,
            context,
            steps,
        };
        Ok(checked.update(axes, covariance, &model))
    };
    // SAFETY: the caller's contract.
    unsafe { report_update(handle.as_mut(), measurement, report, update) }
}

/// Updates a loop by a measurement, and writes the report.
///
/// # Safety
/// The caller's contract of `tautscope_loop_on_tip`.
unsafe fn report_update(
    handle: Option<&mut TautscopeLoop>,
    measurement: *const TautscopeMeasurement,
    report: *mut TautscopeTipReport,
    update: impl FnOnce(&mut TautscopeLoop, &Checked<'_>) -> Result<TautscopeTipReport, TautscopeResult>,
) -> TautscopeResult {
    with_handle(handle, |handle| {
        // SAFETY: the caller's contract.
        unsafe { check_report(report) }?;
        // SAFETY: the caller's contract.
        let checked = unsafe { Checked::new(measurement, &handle.sensors) }?;
        let done = update(handle, &checked)?;
        // SAFETY: checked above.
        unsafe { write_report(report, &done) };
        Ok(())
    })
}

fn signal(message: std::fmt::Arguments<'_>) -> TautscopeResult {
    failed(TautscopeResult::Signal, message)
}

/// Whether a matrix is symmetric up to rounding, in standard deviations, and has a factor by Cholesky.
pub(crate) fn is_covariance(matrix: &[f64], count: usize) -> bool {
    let mut factor = [[0.0; VALUES]; VALUES];
    for row in 0..count {
        for column in 0..=row {
            let (entry, mirrored) = (matrix[row * count + column], matrix[column * count + row]);
            let scale = (matrix[row * (count + 1)] * matrix[column * (count + 1)]).sqrt();
            let pairs = factor[row].iter().zip(&factor[column]).take(column);
            let rest = entry - pairs.map(|(a, b)| a * b).sum::<f64>();
            let is_pivot = row == column;
            let is_symmetric = (entry - mirrored).abs() <= 1e-6 * scale;
            if !is_symmetric || !rest.is_finite() || (is_pivot && rest <= 0.0) {
                return false;
            }
            factor[row][column] = if is_pivot {
                rest.sqrt()
            } else {
                rest / factor[column][column]
            };
        }
    }
    true
}
