//! One friction for two motions: what holds whatever the commands, and what it says of a sliding shaft.

use crate::adaptive::friction::{Friction, FrictionSettings, SlackShare};
use proptest::prelude::*;

use super::config;

/// Of a shaft of 3.5 mm.
fn friction() -> Friction {
    Friction::new(FrictionSettings {
        arm: 1.75e-3,
        memory: 0.2e-3,
        deviation: 0.25,
    })
    .unwrap()
}

/// Of a shaft of 3.5 mm with 10 mm and 1.8 rad of slack.
const ARM: f64 = 1.75e-3;
const HALF: [f64; 2] = [5e-3, 0.9];

/// References and commands that move alike, by so much in every tick.
fn slide(
    friction: &mut Friction,
    from: [f64; 2],
    by: [f64; 2],
    ticks: u32,
) -> ([f64; 2], [SlackShare; 2]) {
    let mut at = from;
    let mut parts = friction.step(at, at, HALF);
    for _ in 0..ticks {
        at = [at[0] + by[0], at[1] + by[1]];
        parts = friction.step(at, at, HALF);
    }
    (at, parts)
}

/// The same law, integrated in small steps from its rates: slide along n as far as the pull goes along n.
fn by_small_steps(path: &[[f64; 2]]) -> [f64; 2] {
    let mut n = [0.0_f64; 2];
    let relax = [1.0 / HALF[0], 1.0 / (ARM * HALF[1])];
    for pair in path.windows(2) {
        let pulled = [0, 1].map(|i| (pair[1][i] - pair[0][i]) / HALF[i] / 200.0);
        for _ in 0..200 {
            let outwards = n[0] * pulled[0] + n[1] * pulled[1];
            let slid = if n[0] * n[0] + n[1] * n[1] >= 1.0 && outwards > 0.0 {
                outwards / (relax[0] * n[0] * n[0] + relax[1] * n[1] * n[1])
            } else {
                0.0
            };
            for i in [0, 1] {
                n[i] += pulled[i] - slid * relax[i] * n[i];
            }
            let size = n[0].hypot(n[1]);
            if size > 1.0 + 1e-3 {
                n = n.map(|value| value / size);
            }
        }
    }
    [n[1], n[0]].map(|other| (1.0 - other * other).max(0.0).sqrt())
}

proptest! {
    #![proptest_config(config())]

    /// Whatever comes in, shares stay shares.
    #[test]
    fn shares_are_shares(
        ticks in prop::collection::vec((prop::array::uniform6(prop_oneof![
            8 => -1.0..1.0, 1 => Just(0.0), 1 => -1e300..1e300, 1 => Just(f64::NAN), 1 => Just(f64::INFINITY),
        ]), 0_u8..2), 1..50),
    ) {
        let mut friction = friction();
        for ([a, b, c, d, e, f], sound) in ticks {
            let half = if sound == 0 { HALF } else { [e, f] };
            for part in friction.step([a, b], [c, d], half) {
                prop_assert!((0.0..=1.0).contains(&part.now), "{part:?}");
                prop_assert!((0.0..=1.0 + 1e-12).contains(&part.aimed), "{part:?}");
                prop_assert!((0.0..=0.25 + 1e-12).contains(&part.deviation), "{part:?}");
            }
        }
    }

    /// It opposes the way the surface slides: a steady slide shares it like the speeds of the surface.
    #[test]
    fn a_steady_slide_shares_it_like_the_speeds(angle in 0.0..core::f64::consts::TAU) {
        let (around, along) = angle.sin_cos();
        let by = [1e-4 * along, 1e-4 / ARM * around];
        let (_, parts) = slide(&mut friction(), [0.02, 0.3], by, 2000);
        for (part, share) in parts.iter().zip([along.abs(), around.abs()]) {
            prop_assert!((part.now - share).abs() < 1e-3, "{part:?}, {share}");
            prop_assert!((part.aimed - share).abs() < 1e-9, "{part:?}, {share}");
        }
    }

    /// The step of any length agrees with the law in small steps.
    #[test]
    fn agrees_with_its_rates(
        ways in prop::collection::vec((-1.0..1.0, -1.0..1.0), 2..6),
    ) {
        let mut path = vec![[0.0, 0.0]];
        for (along, around) in ways {
            let [x, y] = path[path.len() - 1];
            path.extend((1..=40).map(|tick| {
                let part = f64::from(tick) / 40.0;
                [x + part * 12e-3 * along, y + part * 2.0 * around]
            }));
        }
        let mut friction = friction();
        let mut last = [SlackShare::WHOLE; 2];
        for at in &path {
            last = friction.step(*at, *at, HALF);
        }
        // Compared by n: the share of what is nearly all gone changes fast.
        let square = |share: f64| share * share;
        for (part, share) in last.iter().zip(by_small_steps(&path)) {
            prop_assert!((square(part.now) - square(share)).abs() < 0.05, "{last:?}, {share}");
        }
    }

    /// Where nothing moves nothing changes.
    #[test]
    fn at_rest_nothing_changes(along in -1e-4..1e-4, around in -0.1..0.1, ticks in 1_u32..200) {
        let mut friction = friction();
        let (at, before) = slide(&mut friction, [0.0, 0.0], [along, around], ticks);
        for _ in 0..10 {
            prop_assert_eq!(friction.step(at, at, HALF), before);
        }
    }
}

#[test]
fn who_moves_alone_has_it_all() {
    let mut friction = friction();
    let (at, [insertion, rotation]) = slide(&mut friction, [0.02, 0.3], [1e-4, 0.0], 1000);
    assert_eq!(insertion, SlackShare::WHOLE);
    // What would turn now turned freely.
    assert!(rotation.now < 1e-3, "{rotation:?}");
    let (_, [insertion, rotation]) = slide(&mut friction, at, [0.0, 0.01], 5000);
    assert!(
        rotation.now > 0.999 && rotation.aimed > 0.999,
        "{rotation:?}"
    );
    assert!(insertion.now < 0.05, "{insertion:?}");
}

#[test]
fn without_slack_there_is_nothing_to_share() {
    let mut friction = friction();
    for tick in 0..100 {
        let at = [1e-4 * f64::from(tick), 0.01 * f64::from(tick)];
        for half in [[0.0, 0.9], [5e-3, 0.0], [0.0, 0.0]] {
            assert_eq!(
                friction.step(at, at, half).map(|part| part.now),
                [1.0; 2],
                "{half:?}"
            );
        }
    }
}

#[test]
fn settings_out_of_range_are_refused() {
    let sound = FrictionSettings {
        arm: ARM,
        memory: 0.2e-3,
        deviation: 0.25,
    };
    for (settings, field) in [
        (FrictionSettings { arm: 0.0, ..sound }, "friction_arm"),
        (
            FrictionSettings {
                memory: f64::NAN,
                ..sound
            },
            "friction_memory",
        ),
        (
            FrictionSettings {
                deviation: -0.1,
                ..sound
            },
            "friction_deviation",
        ),
    ] {
        let error = Friction::new(settings).unwrap_err();
        assert!(error.to_string().contains(field), "{error}");
    }
}
