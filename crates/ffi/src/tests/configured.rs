//! Tests with the recordings of `examples/cpp/record.py`; `examples/cpp/tests` has more, in C++. Those of a loop are for Miri:
//!
//! ```sh
//! export TAUTSCOPE_RECORDINGS=$PWD/target/cpp/recordings MIRIFLAGS=-Zmiri-disable-isolation
//! cargo +nightly miri test --package tautscope-ffi a_loop -- --ignored
//! ```
#![allow(unsafe_code)]

use std::mem::MaybeUninit;
use std::path::Path;
use std::ptr::null_mut;

use crate::document::{LoopDocument, detector_settings};
use crate::image_update::{tautscope_loop_on_features, tautscope_loop_predict_state};
use crate::reduction::{tautscope_loop_create, tautscope_loop_destroy, tautscope_loop_step};
use crate::result::TautscopeResult;
use crate::supervision::{
    tautscope_loop_engage, tautscope_loop_raise_flag, tautscope_loop_supervision,
};
use crate::types::{
    TautscopeFlag, TautscopeReaction, TautscopeReport, TautscopeStatePrediction,
    TautscopeSupervision,
};

fn recorded(file: &str) -> Vec<u8> {
    let folder = std::env::var_os("TAUTSCOPE_RECORDINGS").unwrap();
    std::fs::read(Path::new(&folder).join(file)).unwrap()
}

#[test]
#[ignore = "needs the folder of record.py in TAUTSCOPE_RECORDINGS"]
fn what_python_writes_of_its_configurations_is_read() {
    let folder = std::env::var_os("TAUTSCOPE_RECORDINGS").unwrap();
    let files = std::fs::read_dir(Path::new(&folder).join("configs")).unwrap();
    let mut read = 0;
    for path in files.map(|file| file.unwrap().path()) {
        let text = std::fs::read(&path).unwrap();
        let is_of_python = String::from_utf8_lossy(&text).contains("\"two_planes\"");
        let is_read = LoopDocument::new(&text).is_ok();
        assert_eq!(is_read, !is_of_python, "{}", path.display());
        read += u32::from(is_read);
    }
    assert!(read > 4);
}

#[test]
#[ignore = "needs the folder of record.py in TAUTSCOPE_RECORDINGS"]
fn the_workspace_is_that_of_python() {
    let Ok((document, _, _)) = detector_settings(&recorded("frames.toml")) else {
        panic!("the configuration is read");
    };
    let (starts, std) = document.experiment.starts();
    let postures = document.experiment.postures();
    let ours = [starts, vec![std], postures].concat();
    let bytes: Vec<u8> = ours
        .into_iter()
        .flatten()
        .flat_map(f64::to_le_bytes)
        .collect();
    assert!(bytes == recorded("frames.workspace"));
}

#[test]
#[ignore = "needs the folder of record.py in TAUTSCOPE_RECORDINGS"]
fn a_loop_is_created_used_and_destroyed() {
    let toml = recorded("paper.toml");
    let mut handle = null_mut();
    // SAFETY: the handle is valid until it is destroyed, and the places are writable.
    unsafe {
        let ok = TautscopeResult::Ok;
        assert_eq!(
            tautscope_loop_create(toml.as_ptr(), toml.len(), &raw mut handle),
            ok
        );
        let mut time = 0.0;
        let mut command = [f64::NAN; 3];
        for step in 0..4 {
            time = 0.001 * f64::from(step);
            let reference = [0.025 + time, 0.0, 0.9];
            let (from, to) = (reference.as_ptr(), command.as_mut_ptr());
            assert_eq!(tautscope_loop_step(handle, 3, from, f64::NAN, time, to), ok);
        }
        assert!(command.iter().all(|value| value.is_finite()));

        // As in C: only the size is set.
        let mut report = MaybeUninit::<TautscopeReport>::uninit();
        (&raw mut (*report.as_mut_ptr()).size)
            .write(u32::try_from(size_of::<TautscopeReport>()).unwrap());
        let features = [350.0, 260.0, 345.0, 190.0];
        let result =
            tautscope_loop_on_features(handle, features.as_ptr(), 0.002, report.as_mut_ptr());
        assert_eq!(result, ok);
        let report = report.assume_init();
        assert_eq!((report.captured_at, report.reserved), (0.002, 0));
        assert_eq!(
            tautscope_loop_on_features(handle, std::ptr::null(), time, null_mut()),
            ok
        );

        let mut prediction = MaybeUninit::<TautscopeStatePrediction>::uninit();
        assert_eq!(
            tautscope_loop_predict_state(handle, 0.002, prediction.as_mut_ptr()),
            ok
        );
        assert_eq!(prediction.assume_init().is_known, 1);

        assert_eq!(
            tautscope_loop_raise_flag(handle, TautscopeFlag::DriveFault as u32),
            ok
        );
        let mut now = MaybeUninit::<TautscopeSupervision>::uninit();
        assert_eq!(tautscope_loop_supervision(handle, now.as_mut_ptr()), ok);
        assert_eq!(now.assume_init().reaction, TautscopeReaction::QuickStop);
        assert_eq!(tautscope_loop_engage(handle), ok);
        tautscope_loop_destroy(handle);
    }
}
