//! The lead law.

use proptest::prelude::*;
use tautscope_core::LeadLaw;

use crate::{close, config};

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

proptest! {
    #![proptest_config(config())]

    #[test]
    fn a_tick_may_be_split_anywhere(
        law in laws(), travel in 0.0..3.0, share in 0.0..1.0, gap in 0.0..5.0, missing in -3.0..5.0
    ) {
        let whole = law.gain(travel, gap, missing);
        let first = law.gain(share * travel, gap, missing);
        // While the free zone is crossed the gap closes by the command's travel.
        let crossed = if missing > 0.0 { share * travel + first } else { 0.0 };
        let left = if gap > 0.0 && crossed >= gap - 1e-12 { 0.0 } else { gap - crossed };
        let second = law.gain((1.0 - share) * travel, left, missing - first);
        prop_assert!((whole - first - second).abs() < 1e-8, "{} {} {}", whole, first, second);
    }

    #[test]
    fn the_lead_never_passes_what_is_missing_and_keeps_the_gain(
        law in laws(), travel in 0.0..3.0, gap in 0.0..5.0, missing in -3.0..5.0
    ) {
        let gained = law.gain(travel, gap, missing);
        prop_assert!(gained * missing >= 0.0);
        prop_assert!(gained.abs() <= missing.abs() * (1.0 + 1e-12));
        prop_assert!(gained <= (law.free_gain - 1.0) * travel * (1.0 + 1e-9) + 1e-12);
        prop_assert!(gained >= -travel * (1.0 + 1e-12));
    }

    #[test]
    fn without_gain_there_is_no_lead(travel in 0.0..3.0, gap in 0.0..5.0, missing in -3.0..5.0) {
        let law = LeadLaw { free_gain: 1.0, contact_gain: 1.0, taper: 0.5, settling: 0.5 };
        prop_assert!(close(law.gain(travel, gap, missing), 0.0));
    }

    #[test]
    fn a_long_way_closes_the_lead(law in laws(), gap in 0.0..5.0, missing in -3.0..5.0) {
        prop_assume!(law.contact_gain > 1.1);
        prop_assert!((law.gain(1e3, gap, missing) - missing).abs() < 1e-6);
    }
}
