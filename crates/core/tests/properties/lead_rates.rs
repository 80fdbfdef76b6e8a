//! The lead law against its rates, integrated in small steps.

use crate::adaptive::lead::LeadLaw;
use proptest::prelude::*;

use super::config;

const STEPS: u32 = 4000;

/// K in the free zone, a gap before the contact.
fn free(law: &LeadLaw, stretch: f64, gap: f64) -> f64 {
    let landing = (stretch * law.contact_gain).min(law.free_gain);
    landing + (law.free_gain - landing) * (gap / law.taper).min(1.0)
}

/// K - s in contact, with so much of the lead missing; never below K = 0.
fn settling(law: &LeadLaw, stretch: f64, missing: f64) -> f64 {
    let rate = law.contact_gain - 1.0;
    let rate = if missing < 0.0 { rate.min(1.0) } else { rate };
    stretch * rate * (missing / law.settling).clamp(-1.0, 1.0)
}

/// What the lead gains over a travel, by the midpoint rule.
fn by_small_steps(law: &LeadLaw, travel: f64, stretch: f64, gap: f64, missing: f64) -> f64 {
    let step = travel / f64::from(STEPS);
    let (mut gap, mut lead, mut left) = (gap, 0.0, travel);
    if missing > 0.0 {
        while gap > 0.0 && left > 0.0 {
            let half = gap - free(law, stretch, gap) * step / 2.0;
            let moved = free(law, stretch, half.max(0.0)) * step;
            // The step that reaches the contact ends there.
            let share = (gap / moved).min(1.0).min(left / step);
            gap -= share * moved;
            lead += share * (moved - step);
            left -= share * step;
            if gap < 1e-12 {
                gap = 0.0;
            }
        }
        if lead >= missing {
            return missing;
        }
    }
    let drift = (stretch - 1.0) * left;
    let wanted = missing - drift - lead;
    let (mut gained, step) = (0.0, left / f64::from(STEPS));
    for _ in 0..STEPS {
        let half = gained + settling(law, stretch, wanted - gained) * step / 2.0;
        gained += settling(law, stretch, wanted - half) * step;
    }
    lead + drift + gained
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..config() })]

    #[test]
    fn every_phase_is_solved_exactly(
        contact_gain in 1.0..2.5_f64,
        more in prop_oneof![1 => Just(0.0), 4 => 0.5..3.0],
        lengths in (0.2..2.0, 0.2..2.0),
        travel in 0.0..3.0,
        stretch in 0.6..1.6_f64,
        gap in prop_oneof![1 => Just(0.0), 3 => 0.0..5.0],
        missing in prop_oneof![-3.0..5.0, 5.0..15.0],
    ) {
        let (taper, settling) = lengths;
        let law = LeadLaw { free_gain: contact_gain + more, contact_gain, taper, settling };
        let stretch = stretch.clamp(1.0 / law.free_gain, law.free_gain);
        let expected = by_small_steps(&law, travel, stretch, gap, missing);
        let found = law.gain(travel, stretch, gap, missing);
        prop_assert!((found - expected).abs() < 1e-4, "{found}, by small steps {expected}");
    }

    /// A lead that is there need not be brought about: what of the free zone is left does not matter.
    #[test]
    fn where_nothing_is_missing_the_gap_is_of_no_account(
        travel in 0.0..3.0, stretch in 0.3..3.0, gap in 0.0..5.0, missing in prop_oneof![Just(0.0), -3.0..0.0],
    ) {
        let law = LeadLaw { free_gain: 5.0, contact_gain: 2.0, taper: 0.5, settling: 0.5 };
        let found = law.gain(travel, stretch, gap, missing);
        prop_assert_eq!(found, law.gain(travel, stretch, 0.0, missing));
    }

    /// Nothing is asked of a tip of a scale that the gain cannot give.
    #[test]
    fn a_stretch_beyond_the_gain_counts_as_the_gain(
        travel in 0.0..3.0, factor in 1.0..10.0, gap in 0.0..5.0, missing in -3.0..5.0,
    ) {
        let law = LeadLaw { free_gain: 5.0, contact_gain: 2.0, taper: 0.5, settling: 0.5 };
        for limit in [5.0, 0.2] {
            let beyond = if limit > 1.0 { limit * factor } else { limit / factor };
            let found = law.gain(travel, beyond, gap, missing);
            prop_assert_eq!(found, law.gain(travel, limit, gap, missing));
        }
    }
}

#[test]
fn settings_out_of_range_are_named() {
    type Change = fn(&mut LeadLaw);
    let sound = LeadLaw {
        free_gain: 1.0,
        contact_gain: 1.0,
        taper: 0.1,
        settling: 0.1,
    };
    assert_eq!(sound.checked().unwrap(), sound);
    let changes: [(&str, Change); 7] = [
        ("free_gain", |law| law.free_gain = 0.9),
        ("free_gain", |law| law.free_gain = f64::NAN),
        ("free_gain", |law| law.free_gain = f64::INFINITY),
        ("contact_gain", |law| law.contact_gain = 0.9),
        ("contact_gain", |law| law.contact_gain = 1.1),
        ("taper", |law| law.taper = 0.0),
        ("settling", |law| law.settling = f64::NAN),
    ];
    for (field, change) in changes {
        let mut wrong = sound;
        change(&mut wrong);
        assert_eq!(wrong.checked().unwrap_err().field, field);
    }
}

/// One that arrives in the free zone stays until the tick ends, also where it arrives with the contact; in numbers of
/// few bits.
#[test]
fn a_lead_that_arrives_with_the_contact_waits() {
    let law = LeadLaw {
        free_gain: 4.0,
        contact_gain: 2.0,
        taper: 1.0,
        settling: 0.5,
    };
    // A gap of 9 at K = 4, which is s contact_gain.
    assert_eq!(law.gain(3.0, 2.0, 9.0, 6.75), 6.75);
}
