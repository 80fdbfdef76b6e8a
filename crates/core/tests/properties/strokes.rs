//! Tip and reference between their turning points: overcompensation, and limit cycles.

use crate::article::play::Play;
use crate::supervision::flags::{Flag, Flags};
use crate::supervision::motion_monitor::MotionMonitor;
use crate::supervision::turning_points::TurningPoints;
use proptest::prelude::*;

use super::config;
use super::support::{PERIOD, UNITS, dofs, safety};

/// One DOF, in units.
struct Bench {
    watch: MotionMonitor<3>,
    dof: usize,
    time: f64,
}

impl Bench {
    fn new(dof: usize) -> Self {
        Self {
            watch: MotionMonitor::new(&safety(), &dofs(), PERIOD).unwrap(),
            dof,
            // No time is near 0.
            time: 50.0,
        }
    }

    /// The next image, `seconds` later.
    fn look(&mut self, seconds: f64, reference: f64, tip: f64, (minus, plus): (f64, f64)) -> Flags {
        self.time += seconds;
        let unit = UNITS[self.dof];
        let [mut references, mut tips] = [[0.0; 3]; 2];
        references[self.dof] = reference * unit;
        tips[self.dof] = tip * unit;
        let play = Play::new(minus * unit, plus * unit).unwrap();
        self.watch
            .update_measurement(self.time, references, tips, [play; 3])
    }
}

/// In units: `ahead` of all DOFs.
const AHEAD: f64 = 3.0;
const NO_SLACK: (f64, f64) = (-5.0, 5.0);

proptest! {
    #![proptest_config(config())]

    #[test]
    fn a_tip_has_outrun_its_reference_by_share_by_way_and_by_place(
        dof in 0..3_usize,
        up in prop::bool::ANY,
        first in 5.0..20.0,
        lag in -12.0..12.0,
        images in prop::collection::vec((0.2..6.0, -10.0..30.0), 1..8),
    ) {
        let sign = if up { 1.0 } else { -1.0 };
        let mut bench = Bench::new(dof);
        bench.look(0.1, 0.0, 0.0, NO_SLACK);
        // Until the reference has turned it has no stroke to outrun, wherever the tip is.
        let farthest = -sign * first;
        let found = bench.look(0.1, farthest, farthest + lag, NO_SLACK);
        prop_assert_eq!(found, Flags::NONE);
        let mut travel = 1.5;
        bench.look(0.1, farthest + sign * travel, farthest + lag, NO_SLACK);
        for (further, gone) in images {
            travel += further;
            let found = bench.look(0.1, farthest + sign * travel, farthest + lag + sign * gone, NO_SLACK);
            let ahead: [f64; 3] = [gone - 1.5 * travel, gone - travel - AHEAD, gone - travel + sign * lag - AHEAD];
            prop_assume!(ahead.iter().all(|each| each.abs() > 1e-6));
            let expected = ahead.iter().all(|each| *each > 0.0);
            prop_assert_eq!(found.contains(Flag::Overcompensation), expected, "{} of {}, {}", gone, travel, lag);
        }
    }

    /// Of the contact that the stroke uses, and since its beginning.
    #[test]
    fn slack_is_unlearnt_beyond_twice_what_the_tip_may_be_ahead(
        dof in 0..3_usize, up in prop::bool::ANY, used in -9.0..9.0_f64, other in 0.0..9.0, first in 5.0..20.0,
    ) {
        prop_assume!(f64::abs(used - 2.0 * AHEAD) > 1e-6);
        let sign = if up { 1.0 } else { -1.0 };
        let before = (-10.0, 10.0);
        let after = if up { (-10.0 + other, 10.0 - used) } else { (-10.0 + used, 10.0 - other) };
        let mut bench = Bench::new(dof);
        let farthest = -sign * first;
        bench.look(0.1, 0.0, 0.0, (-30.0, 30.0));
        bench.look(0.1, farthest, farthest, (-20.0, 20.0));
        for travel in [1.5, 3.0] {
            let at = farthest + sign * travel;
            prop_assert_eq!(bench.look(0.1, at, at, before), Flags::NONE);
        }
        let at = farthest + sign * 4.0;
        let found = bench.look(0.1, at, at, after);
        prop_assert_eq!(found, Flags::when(used > 2.0 * AHEAD, Flag::Overcompensation));
    }

    /// Four that grow, of both, each within its time.
    #[test]
    fn a_limit_cycle_is_so_many_swings_in_a_row_that_grow_in_time(
        dof in 0..3_usize,
        legs in prop::collection::vec((prop_oneof![4 => 1.12..1.3, 1 => 0.8..1.08], prop_oneof![5 => 0.3..1.9, 1 => 2.1..3.0]), 4..16),
        of_tip in prop::option::of(0..8_usize),
    ) {
        let mut bench = Bench::new(dof);
        let (mut reference, mut tip, mut side, mut leg) = (0.0, 0.0, 1.0, 3.0);
        let (mut grown, mut shown) = ([0_u32; 2], 0_u32);
        let mut last = [(0.0, false); 2];
        bench.look(0.1, 0.0, 0.0, NO_SLACK);
        for (count, (growth, seconds)) in legs.into_iter().enumerate() {
            leg *= growth;
            // One swing of the tip, perhaps, is as short as the first.
            let tips = if of_tip == Some(count) { 2.0 } else { 0.8 * leg };
            reference += side * leg;
            tip += side * tips;
            side = -side;
            let found = bench.look(seconds, reference, tip, NO_SLACK);
            // The turn shows that the swing before it is over; of that, whether it had grown.
            for (grown, (last, now)) in grown.iter_mut().zip(last.iter_mut().zip([leg, tips])) {
                if shown > 1 {
                    *grown = if last.1 && seconds <= 2.0 { *grown + 1 } else { 0 };
                }
                *last = (now, shown > 0 && now >= 1.1 * last.0);
            }
            shown += 1;
            prop_assert_eq!(found.contains(Flag::LimitCycle), grown.iter().all(|each| *each >= 4), "leg {}", count);
        }
    }

    /// Of any path, the turns are those of the path through its turning points that are farther apart than the band.
    #[test]
    fn a_signal_turns_once_it_has_come_back_by_more_than_the_band(
        ways in prop::collection::vec(0.1..5.0_f64, 2..20), steps in 1..9_u32, band in 0.05..0.09,
    ) {
        let mut swings = TurningPoints::new(band);
        prop_assert_eq!((swings.update(7.0), swings.direction()), (None, 0.0));
        let (mut at, mut side) = (7.0, 1.0);
        for (count, way) in ways.iter().enumerate() {
            let from = at;
            let mut found = Vec::new();
            for step in 1..=steps {
                at = from + side * way * f64::from(step) / f64::from(steps);
                found.extend(swings.update(at));
                // Back within the band it turns nowhere.
                if swings.direction() == side {
                    prop_assert_eq!(swings.update(at - side * 0.9 * band), None);
                }
            }
            let expected = usize::from(count > 0);
            prop_assert_eq!(found.len(), expected, "leg {}", count);
            prop_assert!(found.iter().all(|swing| (swing - ways[count - 1]).abs() < 1e-9));
            prop_assert_eq!(swings.direction(), side);
            prop_assert!(swings.is_extreme(at) && !swings.is_extreme(from));
            side = -side;
        }
    }
}

#[test]
fn an_image_that_shows_no_tip_says_nothing_of_what_was_seen_before() {
    let mut bench = Bench::new(0);
    let (mut at, mut leg) = (0.0, 4.0);
    bench.look(0.1, 0.0, 0.0, NO_SLACK);
    let mut found = Flags::NONE;
    for _ in 0..10 {
        leg *= -1.2;
        at += leg;
        found = bench.look(0.5, at, at, NO_SLACK);
    }
    assert!(found.contains(Flag::LimitCycle));
    assert_eq!(bench.look(0.1, at, f64::NAN, NO_SLACK), Flags::NONE);
    assert_eq!(bench.look(0.1, f64::NAN, at, NO_SLACK), Flags::NONE);
    assert!(bench.look(0.1, at, at, NO_SLACK).contains(Flag::LimitCycle));
}

/// One tremor in any DOF is one.
#[test]
fn any_dof_may_tremble() {
    for dof in 0..3 {
        let mut watch = MotionMonitor::new(&safety(), &dofs(), PERIOD).unwrap();
        let mut all = Flags::NONE;
        for tick in 0..1000_u32 {
            let mut reference = [0.0; 3];
            reference[dof] = UNITS[dof] * if tick % 20 < 10 { 1.0 } else { -1.0 };
            all = all.union(watch.update_reference(reference));
        }
        assert_eq!(all, Flags::of(Flag::Tremor), "{dof}");
    }
}
