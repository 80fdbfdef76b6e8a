//! The lead law.

use crate::adaptive::lead::LeadLaw;
use proptest::prelude::*;

use super::{close, config};

fn laws() -> impl Strategy<Value = LeadLaw> {
    (1.0..3.0, 0.0..3.0, 0.01..2.0, 0.01..2.0).prop_map(
        |(contact_gain, more, taper, settling): (f64, f64, f64, f64)| LeadLaw {
            free_gain: contact_gain + more,
            contact_gain,
            taper,
            settling,
        },
    )
}

fn within(law: &LeadLaw, stretch: f64) -> f64 {
    stretch.clamp(1.0 / law.free_gain, law.free_gain)
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn a_tick_may_be_split_anywhere(
        law in laws(), travel in 0.0..3.0, share in 0.0..1.0, stretch in 0.6..2.0,
        gap in prop_oneof![Just(0.0), 0.0..5.0], missing in -3.0..5.0
    ) {
        // A lead that arrives in the free zone waits for the tick's end, where its target then is.
        let arrives = gap > 0.0 && missing - travel < 4.0 * gap;
        let stretch = if arrives { 1.0 } else { within(&law, stretch) };
        // What the target gains while the reference travels.
        let drift = (stretch - 1.0) * travel;
        let whole = law.gain(travel, stretch, gap, missing + drift);
        let first = law.gain(share * travel, stretch, gap, missing + share * drift);
        // While the free zone is crossed the gap closes by the command's travel.
        let crossed = if missing > 0.0 { share * travel + first } else { 0.0 };
        let left = if gap > 0.0 && crossed >= gap - 1e-12 { 0.0 } else { gap - crossed };
        let second = law.gain((1.0 - share) * travel, stretch, left, missing + drift - first);
        prop_assert!((whole - first - second).abs() < 1e-8, "{} {} {}", whole, first, second);
    }

    #[test]
    fn the_lead_never_passes_what_is_missing_and_keeps_the_gain(
        law in laws(), travel in 0.0..3.0, gap in 0.0..5.0, missing in -3.0..5.0
    ) {
        let gained = law.gain(travel, 1.0, gap, missing);
        prop_assert!(gained * missing >= 0.0);
        prop_assert!(gained.abs() <= missing.abs() * (1.0 + 1e-12));
        prop_assert!(gained <= (law.free_gain - 1.0) * travel * (1.0 + 1e-9) + 1e-12);
        prop_assert!(gained >= -travel * (1.0 + 1e-12));
    }

    #[test]
    fn without_gain_there_is_no_lead(travel in 0.0..3.0, stretch in 0.1..4.0, gap in 0.0..5.0, missing in -3.0..5.0) {
        let law = LeadLaw { free_gain: 1.0, contact_gain: 1.0, taper: 0.5, settling: 0.5 };
        prop_assert!(close(law.gain(travel, stretch, gap, missing), 0.0));
    }

    #[test]
    fn a_long_way_closes_the_lead(law in laws(), gap in 0.0..5.0, missing in -3.0..5.0) {
        prop_assume!(law.contact_gain > 1.1);
        prop_assert!((law.gain(1e3, 1.0, gap, missing) - missing).abs() < 1e-6);
    }

    /// A tip of another scale is followed at that scale, the lead it has notwithstanding.
    #[test]
    fn a_lead_that_has_arrived_stays_where_it_should_be(
        law in laws(), travel in 0.0..3.0, stretch in 0.5..2.0
    ) {
        let stretch = within(&law, stretch);
        let drift = (stretch - 1.0) * travel;
        prop_assert!(close(law.gain(travel, stretch, 0.0, drift), drift));
    }
}
