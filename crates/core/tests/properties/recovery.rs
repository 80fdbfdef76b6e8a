//! A wrong prediction with right images: the loop uses the images again once they have lasted, and never refuses them
//! for ever.

use crate::dof::PerDof;
use crate::r#loop::any_loop::{BandLoop as _, Loop as _};
use crate::r#loop::profile::BandProfile;
use crate::r#loop::report::Status;
use crate::supervision::reactions::Reaction;

use super::support::loops::{Loop, best, model};
use super::support::plays::{WIDTH, reference};
use super::support::{PERIOD, UNITS};
use crate::article::play::{Play, PlayState};

/// Three plays whose tips are pushed by `displacement` [m, rad, rad] after 30 s.
fn recovers<P: BandProfile>(mut reduction: Loop<P>, displacement: PerDof<f64>, tolerance: f64) {
    let plays = UNITS.map(|unit| Play::new(-0.4 * WIDTH * unit, 0.6 * WIDTH * unit).unwrap());
    let mut tips = reference(0.0).map(|output| PlayState { output });
    let (mut used, mut errors, mut images) = (0, [0.0; 3], 0);
    let mut worst = Reaction::None;
    for tick in 0..16_000_u32 {
        let time = PERIOD * f64::from(tick);
        let command = reduction.step(reference(time), None, time);
        let mut tip = [0.0; 3];
        for dof in 0..3 {
            tip[dof] = plays[dof].step(&mut tips[dof], command[dof]);
            if time >= 30.0 {
                tip[dof] += displacement[dof];
            }
        }
        if !tick.is_multiple_of(8) {
            continue;
        }
        let features = model().predict(tip).map(|seen| seen.features);
        let report = reduction.on_features(features, None, time, Some(u64::from(tick)));
        if time >= 30.0 {
            worst = worst.max(report.supervision.reaction);
        }
        if time >= 60.0 {
            images += 1;
            used += u32::from(!matches!(
                report.status,
                Status::Refused | Status::NoMarkers
            ));
            for dof in 0..3 {
                errors[dof] += (reduction.predicted_state()[dof] - tip[dof]).abs() / UNITS[dof];
            }
        }
    }
    let errors = errors.map(|error| error / f64::from(images));
    let supervision = reduction.supervision();
    println!("{displacement:?}: {used} of {images}, {errors:?}, {worst:?}, {supervision:?}");
    assert!(
        3 * used > 2 * images,
        "{displacement:?}: {used} of {images} images used"
    );
    assert!(
        supervision.reaction < Reaction::HoldEstimate,
        "{supervision:?}"
    );
    assert!(worst < Reaction::HoldMotion, "{worst:?}");
    assert!(
        errors.iter().all(|error| *error < tolerance),
        "{displacement:?}: {errors:?}"
    );
}

/// With the largest mean error of the predicted tip in [`UNITS`]: a part of a lasting push looks like a shift of the image.
const DISPLACEMENTS: [(PerDof<f64>, f64); 4] = [
    ([5e-3, 0.0, 0.0], 7.5),
    ([0.0, 0.6, 0.0], 5.0),
    ([0.0, 0.0, 0.3], 5.0),
    ([4e-3, 0.4, -0.3], 5.0),
];

#[test]
fn profile_best_uses_images_again_after_the_tip_was_pushed() {
    for (displacement, tolerance) in DISPLACEMENTS {
        recovers(best(), displacement, tolerance);
    }
}
