//! The prediction monitor: which errors of the predicted tip are conspicuous.

use crate::dof::PerDof;
use crate::supervision::prediction_monitor::PredictionMonitor;
use proptest::prelude::*;

use super::config;

/// Half of `width_limit`, and the limits in it.
const UNIT: PerDof<f64> = [6e-3, 1.3, 0.75];
const LIMIT: PerDof<f64> = [0.13, 0.3, 0.13];
const TIME: f64 = 0.15;

/// Whether each of some images is conspicuous, the first of which has no error; errors are of one DOF, in its unit.
fn conspicuous(dof: usize, interval: f64, errors: &[f64]) -> Vec<bool> {
    let mut monitor = PredictionMonitor::new(LIMIT, UNIT);
    let start = 2.0;
    assert!(!monitor.update(start, [0.0; 3], [0.0; 3]));
    let images = errors.iter().zip(1_u32..);
    images
        .map(|(error, count)| {
            let predicted = [0.02, -0.4, 0.9];
            let mut measured = predicted;
            measured[dof] += error * UNIT[dof];
            monitor.update(start + interval * f64::from(count), predicted, measured)
        })
        .collect()
}

proptest! {
    #![proptest_config(config())]

    /// A lasting error is conspicuous once error (1 - exp(-t / 0.15 s)) is above its limit, and never if it is smaller.
    #[test]
    fn a_lasting_error_is_found_when_the_low_pass_reaches_the_limit(
        dof in 0..3_usize, error in -0.6..0.6_f64, interval in 0.01..0.14_f64,
    ) {
        let found = conspicuous(dof, interval, &[error; 60]);
        for (found, count) in found.into_iter().zip(1_u32..) {
            let passed = error.abs() * (1.0 - (-f64::from(count) * interval / TIME).exp());
            prop_assume!((passed - LIMIT[dof]).abs() > 1e-9);
            prop_assert_eq!(found, passed > LIMIT[dof]);
        }
    }

    /// One wrong image among right ones counts for its share, and after a gap for at most that of 0.15 s.
    #[test]
    fn a_single_error_counts_for_at_most_1_less_1_over_e(
        dof in 0..3_usize, share in 0.01..0.999_f64, gap in 0.0..10.0_f64,
    ) {
        let weight = 1.0 - (-gap.min(TIME) / TIME).exp();
        let error = share * LIMIT[dof] / weight.max(1e-9);
        prop_assert!(!conspicuous(dof, gap, &[error])[0]);
        if gap > 0.01 {
            prop_assert!(conspicuous(dof, gap, &[error / share * 1.001])[0]);
        }
    }

    /// Neither a DOF that is not known, nor a clock that stands or is set back, raises or hides anything.
    #[test]
    fn what_is_not_known_changes_nothing(time in -5.0..2.0_f64, error in 0.3..5.0_f64) {
        let mut monitor = PredictionMonitor::new(LIMIT, UNIT);
        let off = [error * UNIT[0], 0.0, 0.0];
        prop_assert!(!monitor.update(2.0, [0.0; 3], off));
        prop_assert!(!monitor.update(2.5, [f64::NAN; 3], off));
        prop_assert!(!monitor.update(3.0, [0.0; 3], [f64::NAN; 3]));
        prop_assert!(!monitor.update(time, [0.0; 3], off));
    }
}
