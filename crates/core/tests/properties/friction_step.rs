//! One step of the friction, of any length, against the equations it solves.

use crate::adaptive::friction::{Friction, FrictionSettings};
use proptest::prelude::*;

use super::config;

/// n after a pull from n: where it is, or n1 / (1 + l), n2 / (1 + ease l) with the l that makes |n| = 1.
pub fn slid(n: [f64; 2], ease: f64) -> [f64; 2] {
    let at = |way: f64| [n[0] / (1.0 + way), n[1] / (1.0 + ease * way)];
    let size = |[a, b]: [f64; 2]| a.hypot(b);
    if size(n) <= 1.0 {
        return n;
    }
    let (mut least, mut most) = (0.0, 1.0);
    while size(at(most)) > 1.0 {
        most *= 2.0;
    }
    for _ in 0..100 {
        let middle = f64::midpoint(least, most);
        if size(at(middle)) > 1.0 {
            least = middle;
        } else {
            most = middle;
        }
    }
    at(most)
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn a_pull_slides_until_the_friction_holds_it(
        pulls in prop::collection::vec((-4.0..4.0, -4.0..4.0), 1..6),
        arm in 1e-3..3e-3, half in (1e-3..10e-3, 0.2..1.5), deviation in 0.05..0.5,
    ) {
        let mut friction = Friction::new(FrictionSettings { arm, memory: 0.2e-3, deviation }).unwrap();
        let half = [half.0, half.1];
        let mut command = [0.03, -0.7];
        friction.step([0.0; 2], command, half);
        let mut n = [0.0; 2];
        for (along, around) in pulls {
            command = [command[0] + along * half[0], command[1] + around * half[1]];
            n = slid([n[0] + along, n[1] + around], half[0] / (arm * half[1]));
            let parts = friction.step([0.0; 2], command, half);
            for (part, other) in parts.iter().zip([n[1], n[0]]) {
                // The share of what is nearly all gone changes fast: its square does not.
                let left = 1.0 - other * other;
                prop_assert!((part.now * part.now - left).abs() < 1e-6, "{part:?}, not {left}");
                prop_assert!((part.deviation - deviation * other.abs()).abs() < 1e-6, "{part:?}");
                // The references have not moved.
                prop_assert_eq!(part.aimed, 1.0);
            }
        }
    }

    /// w goes to the direction of each increment by 1 - exp(-travel / memory), in the surface's own lengths.
    #[test]
    fn the_way_it_is_to_slide_is_averaged_over_the_travel(
        ways in prop::collection::vec((-0.5..0.5_f64, -0.5..0.5_f64), 1..8), arm in 1e-3..3e-3, memory in 0.1e-3..1e-3,
    ) {
        let mut friction = Friction::new(FrictionSettings { arm, memory, deviation: 0.25 }).unwrap();
        let mut reference = [0.02, 0.3];
        let mut mean = [0.0; 2];
        friction.step(reference, [0.0; 2], [5e-3, 0.9]);
        for (along, around) in ways {
            let travel = along.hypot(around);
            prop_assume!(travel > 1e-3);
            reference = [reference[0] + along * memory, reference[1] + around * memory / arm];
            let kept = (-travel).exp();
            mean = [
                kept * mean[0] + (1.0 - kept) * along / travel,
                kept * mean[1] + (1.0 - kept) * around / travel,
            ];
            let parts = friction.step(reference, [0.0; 2], [5e-3, 0.9]);
            let size = mean[0].hypot(mean[1]);
            prop_assume!(size > 1e-6);
            for (part, way) in parts.iter().zip(mean) {
                prop_assert!((part.aimed - way.abs() / size).abs() < 1e-6, "{part:?}, {mean:?}");
                prop_assert_eq!(part.now, 1.0);
            }
        }
    }
}

/// What is no number moves nothing, and the next increment counts from there on.
#[test]
fn what_is_no_number_is_no_way() {
    let mut friction = Friction::new(FrictionSettings {
        arm: 1.75e-3,
        memory: 0.2e-3,
        deviation: 0.25,
    })
    .unwrap();
    let half = [5e-3, 0.9];
    friction.step([0.0, 0.0], [0.0, 0.0], half);
    let [before, _] = friction.step([1e-3, 0.0], [0.0, 0.0], half);
    for reference in [[f64::INFINITY, 0.0], [f64::NAN, 0.0], [2e-3, 0.0]] {
        let [after, _] = friction.step(reference, [0.0, 0.0], half);
        assert_eq!(after, before, "{reference:?}");
    }
    let [insertion, rotation] = friction.step([2e-3, 10.0], [0.0, 0.0], half);
    assert!(rotation.aimed > 0.999 && insertion.aimed < 1e-3);
}
