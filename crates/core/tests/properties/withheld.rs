//! What images teach of slack that is known is acted on no faster than a scope changes.

use crate::adaptive::withheld::{ChangeLimit, Withheld};
use crate::article::estimator::{Trigger, Triggers};
use proptest::prelude::*;

use super::config;

const LIMIT: ChangeLimit = ChangeLimit {
    rate: 1.4,
    spare: 0.6,
    known: 5.0,
};
const BOTH: Triggers = Triggers {
    minus: Some(Trigger::Contact),
    plus: Some(Trigger::Contact),
};
const TICK: f64 = 0.04;

/// Offsets that are known.
fn known() -> Withheld {
    let mut withheld = Withheld::new(LIMIT);
    withheld.learn([0.0; 2], [0.0; 2], BOTH, 5.0);
    withheld
}

proptest! {
    #![proptest_config(config())]

    /// Whatever is learnt, and it comes back: what is acted on stays within what a scope can do.
    #[test]
    fn no_image_changes_known_slack_faster_than_may_be(
        lies in prop::collection::vec((-20.0..20.0, -20.0..20.0), 1..50)
    ) {
        let mut withheld = known();
        let mut learnt = [-10.0, 10.0];
        let mut time = 0.0;
        for (minus, plus) in lies {
            withheld.pass(TICK);
            time += TICK;
            let lie = [minus, plus];
            withheld.learn(learnt, lie, BOTH, 0.1);
            learnt = lie;
            let most = LIMIT.rate * time + LIMIT.spare + 1e-9;
            for (acted_on, true_one) in withheld.trusted(learnt).into_iter().zip([-10.0, 10.0]) {
                prop_assert!((acted_on - true_one).abs() <= most, "{acted_on} after {time} s");
            }
        }
        withheld.pass(TICK);
        withheld.learn(learnt, [-10.0, 10.0], BOTH, 0.1);
        let most = LIMIT.rate * time + 1e-9;
        let [minus, plus] = withheld.trusted([-10.0, 10.0]);
        prop_assert!((minus + 10.0).abs() <= most && (plus - 10.0).abs() <= most);
    }

    /// Within the spare, and as slowly as a scope, nothing is withheld to the last bit.
    #[test]
    fn what_a_scope_can_do_is_acted_on_at_once(
        steps in prop::collection::vec(-1.0..1.0, 1..200)
    ) {
        let mut withheld = known();
        let mut learnt = [-10.0, 10.0];
        for step in steps {
            withheld.pass(TICK);
            let change = step * LIMIT.rate * TICK;
            let next = learnt.map(|offset| offset + change);
            withheld.learn(learnt, next, BOTH, 0.1);
            learnt = next;
            prop_assert_eq!(withheld.trusted(learnt), learnt);
        }
    }

    #[test]
    fn unknown_offsets_are_learnt_at_once(jump in -20.0..20.0) {
        let mut withheld = Withheld::new(LIMIT);
        let one = Triggers { minus: None, ..BOTH };
        for _ in 0..100 {
            withheld.learn([0.0; 2], [jump; 2], one, 1.0);
        }
        prop_assert_eq!(withheld.trusted([jump; 2]), [jump; 2]);
    }
}

#[test]
fn a_change_that_lasts_is_acted_on() {
    let mut withheld = known();
    withheld.learn([-10.0, 10.0], [-5.0, 5.0], BOTH, 0.1);
    for _ in 0..100 {
        withheld.pass(TICK);
        withheld.learn([-5.0, 5.0], [-5.0, 5.0], BOTH, 0.1);
    }
    assert_eq!(withheld.trusted([-5.0, 5.0]), [-5.0, 5.0]);
}
