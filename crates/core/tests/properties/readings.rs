//! Measurements of any sensor that cannot be used.

use crate::dof::Friction;
use crate::estimation::history::Entry;
use crate::r#loop::axes::{Axes, Predict, Reading, Repeats, StateFromSensor, VALUES};
use crate::r#loop::paper::Paper;
use crate::r#loop::reduction::HysteresisReduction;
use crate::r#loop::report::Status;
use crate::r#loop::settings::LoopSettings;

use super::support::{PERIOD, UNITS, dofs_in, safety, safety_in, settings};

/// Covariance of two values.
const WHOLE: [f64; 4] = [1e-6, 0.0, 0.0, 1e-6];

/// A sensor that measures the tip degree by degree.
struct Tip;

impl Predict for Tip {
    fn predict(&self, state: &[f64], values: &mut [f64], jacobian: &mut [f64]) -> bool {
        for (index, value) in values.iter_mut().enumerate() {
            *value = state[index % state.len()];
        }
        for (index, entry) in jacobian.iter_mut().enumerate() {
            let [row, column] = [index / state.len(), index % state.len()];
            *entry = f64::from(row % state.len() == column);
        }
        true
    }
}

/// Status of a measurement by a loop of two DOFs at rest.
fn status(values: &[f64], covariance: &[f64], sensor: usize) -> Status {
    let units = [UNITS[1], UNITS[2]];
    let of_bands = settings(&safety());
    let settings = LoopSettings {
        dofs: dofs_in(units),
        friction: Friction::new([0, 1], [1.0; 2]).unwrap(),
        control: of_bands.control,
        safety: safety_in(units),
        law: of_bands.law,
        estimation: of_bands.estimation,
    };
    let storage = vec![Entry::BLANK; of_bands.history_entries()];
    let mut reduction =
        HysteresisReduction::<Paper<2, StateFromSensor<2>>, _, Repeats<2>, 2>::of_axes(
            &settings, storage,
        )
        .unwrap();
    for tick in 0..40 {
        let time = PERIOD * f64::from(tick);
        reduction.step([0.0; 2], None, time);
    }
    let report = reduction.on_reading(&Reading {
        values,
        covariance,
        point: 1,
        captured_at: 0.1,
        sensor,
        model: &Tip,
    });
    report.status
}

#[test]
fn a_covariance_of_another_length_or_another_sensor_is_not_used() {
    assert_eq!(status(&[0.0; 2], &WHOLE, 3), Status::Ok);
    for covariance in [
        &WHOLE[..0],
        &WHOLE[..1],
        &[1e-6; 2],
        &WHOLE[..3],
        &[1e-6; 9],
    ] {
        assert_eq!(status(&[0.0; 2], covariance, 0), Status::NoMarkers);
    }
    assert_eq!(status(&[0.0; 2], &WHOLE, 4), Status::NoMarkers);
    let many = [0.0; VALUES + 1];
    assert_eq!(
        status(&many, &[0.0; (VALUES + 1) * (VALUES + 1)], 0),
        Status::NoMarkers
    );
}
