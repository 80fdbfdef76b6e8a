//! `TautscopeLoop` with `[[dof]]`: configurations and arguments that are refused, and a sensor of the caller's. Without files, also for Miri.
#![allow(unsafe_code)]

use std::ffi::{CStr, c_int, c_void};
use std::mem::MaybeUninit;
use std::ptr::{null, null_mut};

use crate::measurement::{is_covariance, tautscope_loop_on_measurement, tautscope_loop_on_tip};
use crate::reduction::{
    TautscopeLoop, tautscope_loop_create, tautscope_loop_destroy, tautscope_loop_dof,
    tautscope_loop_hysteresis, tautscope_loop_predicted_state, tautscope_loop_size,
    tautscope_loop_step,
};
use crate::result::{TautscopeResult, tautscope_error_message};
use crate::supervision::{tautscope_loop_raise_flag, tautscope_loop_set_compensation};
use crate::types::{TautscopeMeasurement, TautscopeStatus, TautscopeTipReport};

const ONE: &str = "[[dof]]\nname = \"a\"\nwidth_limit = 1.2\n";

fn message() -> String {
    // SAFETY: a text of the library, which ends with a zero.
    let text = unsafe { CStr::from_ptr(tautscope_error_message()) };
    text.to_str().unwrap().to_owned()
}

fn named(count: usize) -> String {
    let dof = |index| ONE.replace("\"a\"", &format!("\"a{index}\""));
    (0..count).map(dof).collect()
}

fn create(toml: &str) -> (TautscopeResult, *mut TautscopeLoop) {
    let mut handle = null_mut();
    // SAFETY: a text and its length.
    let result = unsafe { tautscope_loop_create(toml.as_ptr(), toml.len(), &raw mut handle) };
    (result, handle)
}

#[test]
fn any_count_of_dofs_from_one_to_eight_has_a_loop() {
    for count in 1..=8 {
        let (result, handle) = create(&named(count));
        assert_eq!(result, TautscopeResult::Ok, "{}", message());
        let (mut dofs, mut period) = (0, 0.0);
        // SAFETY: the handle is valid until it is destroyed.
        unsafe {
            let (mut name, mut unit) = (null(), null());
            for dof in 0..count {
                tautscope_loop_dof(handle, dof, &raw mut name, &raw mut unit);
                let texts = [name, unit].map(|text| CStr::from_ptr(text).to_str().unwrap());
                assert_eq!(texts, [format!("a{dof}").as_str(), "rad"]);
            }
            tautscope_loop_dof(handle, count, &raw mut name, &raw mut unit);
            assert!(name.is_null() && unit.is_null());
            tautscope_loop_size(handle, &raw mut dofs, &raw mut period);
            tautscope_loop_destroy(handle);
        }
        assert_eq!((dofs, period), (count, 0.005));
    }
}

unsafe extern "C" fn half(_: *mut c_void, q: *const f64, z: *mut f64, _: *mut f64) -> c_int {
    // SAFETY: the contract of `TautscopePredict`.
    unsafe { *z = 0.5 * *q };
    1
}

unsafe extern "C" fn nothing(calls: *mut c_void, _: *const f64, _: *mut f64, _: *mut f64) -> c_int {
    // SAFETY: the test passes a counter.
    unsafe { *calls.cast::<u32>() += 1 };
    0
}

fn measurement(values: &[f64], covariance: *const f64) -> TautscopeMeasurement {
    TautscopeMeasurement {
        values: values.as_ptr(),
        count: values.len(),
        covariance,
        captured_at: 0.0,
        sensor: 0,
        point: 0,
    }
}

/// Where a covariance was turned, entries beside large ones are rounded.
#[test]
fn a_covariance_is_symmetric_up_to_rounding() {
    assert!(is_covariance(&[1e-4, 1e-22, 0.0, 1e-4], 2));
    assert!(is_covariance(&[1e-4, 1e-10, -1e-10, 1e4], 2));
    assert!(!is_covariance(&[1e-4, 1e-9, 0.0, 1e-4], 2));
    assert!(!is_covariance(&[-1e-4, 0.0, 0.0, -1e-4], 2));
}

#[test]
fn arguments_that_are_wrong_change_nothing() {
    use TautscopeResult::{NullPointer, Ok, Signal, Size};
    let (_, handle) = create(ONE);
    let (mut command, reference, nan) = ([0.0], [0.1], f64::NAN);
    let good = measurement(&[0.1], &1e-4);
    let too_many = [0.0; 17];
    let (from, to) = (reference.as_ptr(), command.as_mut_ptr());
    // SAFETY: the handle is valid until it is destroyed; null is allowed.
    unsafe {
        let step = |count, from, time| tautscope_loop_step(handle, count, from, nan, time, to);
        assert_eq!(step(1, from, 0.0), Ok);
        assert_eq!(step(2, from, 0.0), Size);
        assert_eq!(step(1, null(), 0.0), NullPointer);
        assert_eq!(step(1, [nan].as_ptr(), 0.0), Signal);
        assert_eq!(step(1, from, nan), Signal);
        assert_eq!(
            tautscope_loop_step(handle, 1, from, nan, 0.0, null_mut()),
            NullPointer
        );
        assert_eq!(
            tautscope_loop_step(null_mut(), 1, from, nan, 0.0, to),
            NullPointer
        );
        assert_eq!(command.map(f64::to_bits), reference.map(f64::to_bits));

        let tip = |given: TautscopeMeasurement| {
            tautscope_loop_on_tip(handle, &raw const given, null_mut())
        };
        assert_eq!(tip(good), Ok);
        assert_eq!(
            tautscope_loop_on_tip(handle, null(), null_mut()),
            NullPointer
        );
        assert_eq!(
            tip(TautscopeMeasurement {
                values: null(),
                ..good
            }),
            NullPointer
        );
        assert_eq!(tip(measurement(&[0.0; 2], null())), Size);
        assert_eq!(tip(measurement(&too_many, null())), Size);
        assert_eq!(tip(TautscopeMeasurement { count: 0, ..good }), Size);
        assert_eq!(tip(measurement(&[nan], null())), Signal);
        assert_eq!(tip(measurement(&[f64::INFINITY], null())), Signal);
        for covariance in [0.0, -1.0, nan, f64::INFINITY] {
            assert_eq!(tip(measurement(&[0.1], &raw const covariance)), Signal);
        }
        assert_eq!(tip(TautscopeMeasurement { sensor: 4, ..good }), Signal);
        assert_eq!(
            tip(TautscopeMeasurement {
                captured_at: nan,
                ..good
            }),
            Signal
        );

        let own = |given: TautscopeMeasurement, predict| {
            tautscope_loop_on_measurement(handle, &raw const given, predict, null_mut(), null_mut())
        };
        assert_eq!(own(good, Some(half)), Ok);
        assert_eq!(own(good, None), NullPointer);
        assert_eq!(own(measurement(&[0.1], null()), Some(half)), NullPointer);
        let matrix = |off| [1.0, off, 0.5, 1.0];
        assert_eq!(
            own(measurement(&[0.1, 0.1], matrix(0.4).as_ptr()), Some(half)),
            Signal
        );
        assert_eq!(
            own(
                measurement(&[0.1, 0.1], [1.0, 2.0, 2.0, 1.0].as_ptr()),
                Some(half)
            ),
            Signal
        );

        let mut report = MaybeUninit::<TautscopeTipReport>::zeroed();
        assert_eq!(
            tautscope_loop_on_tip(handle, &raw const good, report.as_mut_ptr()),
            Size
        );
        assert_eq!(tautscope_loop_predicted_state(handle, 3, to), Size);
        assert_eq!(tautscope_loop_hysteresis(handle, null_mut()), NullPointer);
        assert_eq!(tautscope_loop_set_compensation(handle, 1.5), Signal);
        assert_eq!(tautscope_loop_raise_flag(handle, 99), Signal);
        tautscope_loop_destroy(handle);
        tautscope_loop_destroy(null_mut());
    }
}

#[test]
fn a_sensor_of_the_callers_measures_the_tip() {
    let (_, handle) = create(ONE);
    let mut command = [0.0];
    let mut calls = 0_u32;
    // As in C: only the size is set.
    let mut report = MaybeUninit::<TautscopeTipReport>::uninit();
    let place = report.as_mut_ptr();
    // SAFETY: the handle is valid until it is destroyed, and the places are writable.
    let report = unsafe {
        (&raw mut (*place).size).write(u32::try_from(size_of::<TautscopeTipReport>()).unwrap());
        tautscope_loop_step(
            handle,
            1,
            [0.2].as_ptr(),
            f64::NAN,
            0.0,
            command.as_mut_ptr(),
        );
        let seen = measurement(&[0.05], &1e-6);
        let context = (&raw mut calls).cast();
        let result =
            tautscope_loop_on_measurement(handle, &raw const seen, Some(nothing), context, place);
        assert_eq!(result, TautscopeResult::Ok);
        assert_ne!((*place).status, TautscopeStatus::Ok);
        let again = TautscopeMeasurement {
            captured_at: 0.001,
            ..seen
        };
        let result =
            tautscope_loop_on_measurement(handle, &raw const again, Some(half), null_mut(), place);
        assert_eq!(result, TautscopeResult::Ok);
        tautscope_loop_destroy(handle);
        report.assume_init()
    };
    assert!(calls > 0);
    assert_eq!(
        (report.status, report.captured_at),
        (TautscopeStatus::Ok, 0.001)
    );
    assert!((report.state_estimate[0] - 0.1).abs() < 0.01, "{report:?}");
    assert!(report.state_estimate[1].is_nan() && report.innovation[1].is_nan());
}
