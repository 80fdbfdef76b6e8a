//! Whether a frame may teach: how far it may be from what is expected.

use crate::dof::PerDof;
use crate::estimation::posture::Belief;
use crate::supervision::flags::Flag;
use crate::supervision::frame_gate::{FrameGate, FrameGateSettings};
use crate::supervision::grip::Sighting;
use proptest::prelude::*;

use super::config;
use super::support::monitors;

/// The images of one DOF, with lengths in its least spread.
struct Bench {
    watch: FrameGate,
    settings: FrameGateSettings,
    dof: usize,
    belief: Belief,
    travel: PerDof<f64>,
}

impl Bench {
    fn new(dof: usize) -> Self {
        let settings = monitors().frames;
        let unit = settings.least_deviation;
        Self {
            watch: FrameGate::new(settings).unwrap(),
            settings,
            dof,
            belief: Belief {
                state: unit.map(|unit| -3.0 * unit),
                deviation: unit,
            },
            travel: unit.map(|unit| 7.0 * unit),
        }
    }

    fn seen(&self, surprise: f64, deviation: f64) -> PerDof<Sighting> {
        let unit = self.settings.least_deviation[self.dof];
        let mut seen = [0, 1, 2].map(|dof| Sighting {
            command: 0.0,
            travel: self.travel[dof],
            tip: f64::NAN,
            deviation: f64::NAN,
            offsets: (f64::NEG_INFINITY, f64::INFINITY),
        });
        seen[self.dof].tip = self.belief.state[self.dof] + surprise * unit;
        seen[self.dof].deviation = deviation * unit;
        seen
    }

    fn refuses(&self, surprise: f64, deviation: f64) -> bool {
        let seen = self.seen(surprise, deviation);
        let doubts = self.watch.doubts(&self.belief, [1e3; 3], &seen);
        doubts.has(Flag::Innovation)
    }

    /// Found from what an image without deviation of its own may say.
    fn spread(&self) -> f64 {
        let limit = self.settings.innovation_limit;
        let (mut fits, mut refused) = (0.0, 1e4);
        for _ in 0..60 {
            let middle = f64::midpoint(fits, refused);
            if self.refuses(middle * limit, 0.0) {
                refused = middle;
            } else {
                fits = middle;
            }
        }
        fits
    }

    fn goes(&mut self, way: f64) {
        self.travel[self.dof] += way * self.settings.least_deviation[self.dof];
    }

    /// An image that is believed; the square of the spread then.
    fn accept(&mut self, surprise: f64, way: f64) -> f64 {
        self.goes(way);
        let seen = self.seen(surprise, 0.1);
        self.watch.accept(&self.belief, &seen);
        self.spread().powi(2)
    }
}

fn near(found: f64, expected: f64) -> bool {
    (found - expected).abs() <= 1e-6 * expected.abs().max(1.0)
}

proptest! {
    #![proptest_config(config())]

    /// surprise^2 > limit^2 (spread^2 + deviation^2), with the spread of the start
    #[test]
    fn an_innovation_is_refused_beyond_so_many_deviations(
        dof in 0..3_usize, share in 0.1..2.0_f64, deviation in 0.0..30.0, above in prop::bool::ANY,
    ) {
        prop_assume!(f64::abs(share - 1.0) > 1e-6);
        let bench = Bench::new(dof);
        let start = bench.settings.start_deviation[dof] / bench.settings.least_deviation[dof];
        let limit = bench.settings.innovation_limit * f64::hypot(start, deviation);
        let surprise = if above { share * limit } else { -share * limit };
        prop_assert_eq!(bench.refuses(surprise, deviation), share > 1.0);
        // Of what has no deviation nothing is said.
        prop_assert!(!bench.refuses(surprise, f64::NAN));
        prop_assert!(!bench.refuses(f64::NAN, deviation));
    }

    /// The square of the spread goes to that of the innovations, by the same share of what is left each time.
    #[test]
    fn the_spread_follows_innovations_up_at_once_and_down_slowly_with_motion(
        dof in 0..3_usize, large in 40.0..200.0, small in 2.0..5.0,
    ) {
        let mut bench = Bench::new(dof);
        let left = |bench: &mut Bench, surprise: f64, way: f64| {
            let before = bench.spread().powi(2) - surprise * surprise;
            (bench.accept(surprise, way) - surprise * surprise) / before
        };
        let up = left(&mut bench, large, 0.0);
        prop_assert!((0.3..0.9).contains(&up), "{}", up);
        prop_assert!(near(left(&mut bench, -large, 5.0), up), "with motion as well as without");
        let rest = left(&mut bench, small, 0.0);
        prop_assert!(near(rest, 1.0), "at rest nothing is learnt: {}", rest);
        let down = left(&mut bench, small, 1.0);
        prop_assert!(down > up && down < 0.99, "{}", down);
        let far = left(&mut bench, -small, 9.0);
        prop_assert!(near(far, down), "an image counts once: {}, not {}", far, down);
        let half = left(&mut bench, small, 0.5);
        prop_assert!(near(half, f64::midpoint(1.0, down)), "{}, not half of {}", half, down);
    }

    /// Both grow by `blind_growth` of the travel, and no farther than at the start; motion already seen counts no more.
    #[test]
    fn what_is_not_seen_may_be_farther_off(dof in 0..3_usize, ways in prop::collection::vec(0.0..20.0, 1..6)) {
        let mut bench = Bench::new(dof);
        for _ in 0..300 {
            bench.accept(0.5, 4.0);
        }
        let least = bench.spread();
        prop_assert!(near(least, 1.0), "the least spread there is: {}", least);
        let start = bench.settings.start_deviation[dof] / bench.settings.least_deviation[dof];
        let mut blind = 0.0;
        for way in ways {
            bench.goes(way);
            blind += way * bench.settings.blind_growth;
            bench.watch.miss(bench.travel);
            let spread = bench.spread();
            let expected = (1.0 + blind).min(start);
            prop_assert!(near(spread, expected), "{}, not {}", spread, expected);
            let reach = bench.settings.jump[dof] / bench.settings.least_deviation[dof] + blind.min(start);
            for (far, jumps) in [(reach - 1e-6, false), (reach + 1e-6, true)] {
                let doubts = bench.watch.doubts(&bench.belief, [0.0; 3], &bench.seen(far, 0.0));
                prop_assert_eq!(doubts.has(Flag::Jump), jumps, "{}", far);
            }
        }
        // A wider spread than the start's, which large innovations have taught, stays.
        let wide = bench.accept(50.0 * start, 0.0).sqrt();
        bench.goes(1.0);
        bench.watch.miss(bench.travel);
        prop_assert!(near(bench.spread(), wide));
        bench.watch.forget();
        prop_assert!(near(bench.spread(), start));
    }
}
