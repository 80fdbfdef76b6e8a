//! Sliding of a shaft under friction, against its laws and against an explicit integration of its flow rule.

use crate::article::play::{Play, PlayState};
use crate::model::friction::slide;
use proptest::prelude::*;

use super::config;

type Pair = [f64; 2];

/// Deflections of length at most 1: within, and on the limit.
fn deflections() -> impl Strategy<Value = Pair> {
    let size = prop_oneof![1 => Just(1.0), 2 => 0.0..1.0];
    (size, -3.2..3.2_f64).prop_map(|(size, angle)| [size * angle.cos(), size * angle.sin()])
}

fn motions() -> impl Strategy<Value = Pair> {
    let part = || prop_oneof![1 => Just(0.0), 6 => -3.0..3.0, 1 => -1e-4..1e-4];
    [part(), part()]
}

fn ratios() -> impl Strategy<Value = f64> {
    prop_oneof![1 => Just(1.0), 4 => 0.05..20.0]
}

fn distance(a: Pair, b: Pair) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

fn times(factor: f64, [a, b]: Pair) -> Pair {
    [factor * a, factor * b]
}

/// Sliding of the shaft (dq1, r dq2) during a motion, in units of h1; r h2 is h1 / k.
fn sliding(before: Pair, after: Pair, motion: Pair, ratio: f64) -> Pair {
    let slid = [0, 1].map(|dof| motion[dof] - (after[dof] - before[dof]));
    [slid[0], slid[1] / ratio]
}

/// The flow rule by explicit steps: n moves with the command, and where it leaves the limit it is brought back along the
/// sliding (dq1, r dq2) = n dl, which is (k n1, n2) dl in units of the half widths over r h2.
fn integrated(mut n: Pair, motion: Pair, ratio: f64, steps: u32) -> Pair {
    let step = times(1.0 / f64::from(steps), motion);
    for _ in 0..steps {
        n = [n[0] + step[0], n[1] + step[1]];
        let excess = 0.5 * (n[0] * n[0] + n[1] * n[1] - 1.0);
        if excess > 0.0 {
            // (1/k) n1 and k n2 in units of h1 and of h2, up to a common factor.
            let flow = [n[0], ratio * n[1]];
            let slope = n[0] * flow[0] + n[1] * flow[1];
            n = [
                n[0] - excess / slope * flow[0],
                n[1] - excess / slope * flow[1],
            ];
        }
    }
    n
}

proptest! {
    #![proptest_config(config())]

    /// Rate independence: a straight motion may be divided anywhere.
    #[test]
    fn a_divided_motion_is_the_whole_one(
        n in deflections(), d in motions(), ratio in ratios(), share in 0.0..1.0,
    ) {
        let whole = slide(n, d, ratio);
        let half = slide(n, times(share, d), ratio);
        let both = slide(half, times(1.0 - share, d), ratio);
        prop_assert!(distance(whole, both) <= 1e-10, "{whole:?} {both:?}");
    }

    /// |n| <= 1, and the friction only takes work: it is against the sliding.
    #[test]
    fn friction_is_limited_and_dissipates(n in deflections(), d in motions(), ratio in ratios()) {
        let (mut at, steps) = (n, 50);
        let step = times(1.0 / f64::from(steps), d);
        for _ in 0..steps {
            let next = slide(at, step, ratio);
            prop_assert!(next[0].hypot(next[1]) <= 1.0 + 1e-12, "{next:?}");
            let [s1, s2] = sliding(at, next, step, ratio);
            let middle = [f64::midpoint(at[0], next[0]), f64::midpoint(at[1], next[1])];
            let work = middle[0] * s1 + middle[1] * s2;
            prop_assert!(work >= -1e-12, "{work}");
            // Nothing slides while the force is below its limit.
            if next[0].hypot(next[1]) < 1.0 - 1e-9 && at[0].hypot(at[1]) < 1.0 - 1e-9 {
                let free = [at[0] + step[0], at[1] + step[1]];
                prop_assert!(free[0].hypot(free[1]) > 1.0 || distance(free, next) <= 1e-15);
            }
            at = next;
        }
    }

    /// One DOF alone is Eq. (1).
    #[test]
    fn a_dof_alone_is_the_play(
        ways in prop::collection::vec(-3.0..3.0, 1..20), dof in 0..2_usize, ratio in ratios(),
    ) {
        let play = Play::new(-1.0, 1.0).unwrap();
        let (mut tip, mut n, mut command) = (PlayState { output: 0.0 }, [0.0; 2], 0.0);
        for way in ways {
            let mut d = [0.0; 2];
            d[dof] = way;
            n = slide(n, d, ratio);
            command += way;
            play.step(&mut tip, command);
            prop_assert!((command - tip.output - n[dof]).abs() <= 1e-12);
            prop_assert_eq!(n[1 - dof], 0.0);
        }
    }

    /// No axis and no direction is preferred; exchanged axes exchange h1 and r h2.
    #[test]
    fn axes_and_signs_may_be_exchanged(n in deflections(), d in motions(), ratio in ratios()) {
        let found = slide(n, d, ratio);
        let mirrored = slide([-n[0], n[1]], [-d[0], d[1]], ratio);
        prop_assert!(distance([-mirrored[0], mirrored[1]], found) <= 1e-10);
        let [b, a] = slide([n[1], n[0]], [d[1], d[0]], 1.0 / ratio);
        prop_assert!(distance([a, b], found) <= 1e-9, "{found:?} {:?}", [a, b]);
    }

    /// With r h2 = h1 the tip is a tractrix: tan(phi / 2) = tan(phi0 / 2) exp(-s), with the angle phi between n and d.
    #[test]
    fn equal_axes_follow_the_tractrix(angle in 0.01..3.1_f64, heading in -3.0..3.0_f64, length in 0.01..3.0_f64) {
        let d = [length * heading.cos(), length * heading.sin()];
        let n = [(heading + angle).cos(), (heading + angle).sin()];
        let [c, s] = slide(n, d, 1.0);
        // It slides from where n has come round to the side of d.
        let (start, free) = if angle > std::f64::consts::FRAC_PI_2 {
            (std::f64::consts::PI - angle, -2.0 * angle.cos())
        } else {
            (angle, 0.0_f64)
        };
        prop_assume!(length > free);
        let turned = 2.0 * ((0.5 * start).tan() * (free - length).exp()).atan();
        let expected = [(heading + turned).cos(), (heading + turned).sin()];
        prop_assert!(distance([c, s], expected) <= 1e-10, "{:?} {expected:?}", [c, s]);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..config() })]

    /// Ten times as many steps leave a tenth of the error.
    #[test]
    fn fine_steps_of_the_flow_rule_approach_the_solution(
        n in deflections(), d in motions(), ratio in 0.1..10.0,
    ) {
        let exact = slide(n, d, ratio);
        let [coarse, fine] = [10_000, 100_000].map(|steps| distance(integrated(n, d, ratio, steps), exact));
        prop_assert!(fine <= 1e-4, "{fine}");
        prop_assert!(fine <= 0.2 * coarse + 1e-9, "{coarse} {fine}");
    }
}
