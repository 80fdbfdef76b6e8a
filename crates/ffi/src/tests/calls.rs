//! Errors of calls, names, and layouts.
#![allow(unsafe_code)]

use std::ffi::CStr;
use std::ptr::{null, null_mut};

use TautscopePixelFormat::{Bgr, Bgra, I420, Nv12, Rgb, Uyvy, Yuyv};
use tautscope_core as core;
use tautscope_vision::PixelFormat;

use crate::conversions::bits;
use crate::detector::{TautscopeDetector, tautscope_detector_create, tautscope_detector_destroy};
use crate::names::{tautscope_flag_name, tautscope_reaction_name, tautscope_version};
use crate::reduction::{
    TautscopeLoop, tautscope_loop_create, tautscope_loop_destroy, tautscope_loop_step,
};
use crate::result::{
    Handle, TautscopeResult, failed, guarded, tautscope_error_message, with_handle,
};
use crate::supervision::tautscope_loop_engage;
use crate::types::{TautscopeFlag, TautscopePixelFormat, TautscopeReport, TautscopeTipReport};

fn text(pointer: *const std::ffi::c_char) -> &'static str {
    // SAFETY: a text of the library, which ends with a zero.
    unsafe { CStr::from_ptr(pointer) }.to_str().unwrap()
}

fn message() -> String {
    text(tautscope_error_message()).to_owned()
}

struct Counter {
    calls: u32,
    is_broken: bool,
}

impl Handle for Counter {
    fn is_broken(&mut self) -> &mut bool {
        &mut self.is_broken
    }
}

#[test]
fn a_panic_becomes_an_error_and_the_handle_is_unusable() {
    let mut counter = Counter {
        calls: 0,
        is_broken: false,
    };
    let result = with_handle(Some(&mut counter), |_| panic!("part {} failed", 7));
    assert_eq!(result, TautscopeResult::Internal);
    assert!(message().contains("part 7 failed"), "{}", message());
    let result = with_handle(Some(&mut counter), |counter| {
        counter.calls += 1;
        Ok(())
    });
    assert_eq!((result, counter.calls), (TautscopeResult::Internal, 0));
}

#[test]
#[cfg_attr(miri, ignore = "leaks on purpose")]
fn a_panic_whose_value_panics_does_not_leave_the_library() {
    struct Again;
    impl Drop for Again {
        fn drop(&mut self) {
            panic!("again");
        }
    }
    let result = guarded(|| std::panic::panic_any(Again));
    assert_eq!(result, TautscopeResult::Internal);
    assert!(message().contains("unknown cause"), "{}", message());
}

#[test]
fn an_error_leaves_the_handle_usable() {
    let mut counter = Counter {
        calls: 0,
        is_broken: false,
    };
    let wrong = || failed(TautscopeResult::Signal, format_args!("wrong"));
    let result = with_handle(Some(&mut counter), |_| Err(wrong()));
    assert_eq!(result, TautscopeResult::Signal);
    let result = with_handle(Some(&mut counter), |_| Ok(()));
    assert_eq!(result, TautscopeResult::Ok);
}

#[test]
fn a_long_message_is_cut_between_characters() {
    failed(
        TautscopeResult::Signal,
        format_args!("{}", "ä".repeat(2000)),
    );
    assert_eq!(message(), "ä".repeat(511));
    failed(TautscopeResult::Signal, format_args!("short"));
    assert_eq!(message(), "short");
}

#[test]
fn messages_belong_to_their_thread() {
    failed(TautscopeResult::Signal, format_args!("mine"));
    let other = std::thread::spawn(message).join().unwrap();
    assert_eq!((other.as_str(), message().as_str()), ("", "mine"));
}

#[test]
fn null_pointers_are_errors() {
    let mut handle: *mut TautscopeLoop = null_mut();
    let mut detector: *mut TautscopeDetector = null_mut();
    let toml = "profile = \"best\"";
    // SAFETY: null is allowed everywhere here.
    unsafe {
        let reference = [0.0; 3];
        let mut command = [0.0; 3];
        for result in [
            tautscope_loop_create(null(), 3, &raw mut handle),
            tautscope_detector_create(null(), 3, &raw mut detector),
            tautscope_loop_step(
                null_mut(),
                3,
                reference.as_ptr(),
                f64::NAN,
                0.0,
                command.as_mut_ptr(),
            ),
            tautscope_loop_engage(null_mut()),
        ] {
            assert_eq!(result, TautscopeResult::NullPointer);
            assert!(message().contains("null pointer"), "{}", message());
        }
        tautscope_loop_destroy(null_mut());
        tautscope_detector_destroy(null_mut());
        let result = tautscope_loop_create(toml.as_ptr(), usize::MAX, &raw mut handle);
        assert_eq!(result, TautscopeResult::Size);
    }
    assert!(handle.is_null() && detector.is_null());
}

#[test]
fn a_configuration_that_cannot_be_read_is_an_error() {
    for (toml, expected) in [
        (&b"\xff\xfe"[..], "UTF-8"),
        (b"profile = ", "configuration"),
        (b"profile = \"worst\"", "`worst`"),
        (b"law.tip_gian = 3.0", "law.tip_gian: unknown key"),
    ] {
        let mut handle: *mut TautscopeLoop = null_mut();
        // SAFETY: a text and its length.
        let result = unsafe { tautscope_loop_create(toml.as_ptr(), toml.len(), &raw mut handle) };
        assert_eq!(result, TautscopeResult::Config);
        assert!(message().contains(expected), "{}", message());
        assert!(handle.is_null());
    }
}

#[test]
fn numbers_and_names_are_those_of_the_core() {
    assert_eq!(TautscopeFlag::FrameRate as usize + 1, core::Flag::ALL.len());
    for (index, flag) in (0..).zip(core::Flag::ALL) {
        assert_eq!(text(tautscope_flag_name(index)), flag.name());
        assert_eq!(bits(core::Flags::of(*flag)), 1 << index);
    }
    let last = u32::try_from(core::Flag::ALL.len()).unwrap();
    assert!(tautscope_flag_name(last).is_null());
    assert!(tautscope_reaction_name(8).is_null());
    assert_eq!(text(tautscope_version()), env!("CARGO_PKG_VERSION"));
    for (ours, format) in [Bgr, Rgb, Bgra, Yuyv, Uyvy, Nv12, I420]
        .iter()
        .zip(PixelFormat::ALL)
    {
        assert_eq!(*ours as u32, format as u32);
        assert_eq!(format!("{ours:?}").to_lowercase(), format.name());
    }
}

#[test]
fn the_report_has_no_padding() {
    assert_eq!(size_of::<TautscopeReport>(), 4 * 4 + 8 * 27 + 4 * 10);
}

#[test]
fn the_report_of_axes_has_no_padding() {
    assert_eq!(
        size_of::<TautscopeTipReport>(),
        4 * 4 + 8 * (1 + 5 * 8 + 2 * 16) + 4 * 24
    );
}

#[test]
fn a_call_that_succeeds_is_ok() {
    assert_eq!(guarded(|| Ok(())), TautscopeResult::Ok);
}
