//! The innovation gate: the bound of the innovation, and how its standard deviation adapts.

use crate::dof::PerDof;
use crate::estimation::posture::Belief;
use crate::supervision::flags::Flag;
use crate::supervision::frame_gate::FrameGate;
use crate::supervision::grip::Sighting;
use proptest::prelude::*;

use super::config;
use super::support::{dofs, safety};

/// The images of one DOF, with lengths in its least standard deviation.
struct Bench {
    gate: FrameGate,
    /// Least standard deviations.
    unit: PerDof<f64>,
    dof: usize,
    prediction: Belief,
    travel: PerDof<f64>,
}

impl Bench {
    fn new(dof: usize) -> Self {
        let unit = dofs().map(|dof| dof.start_deviation * safety().innovation_floor);
        Self {
            gate: FrameGate::new(&safety(), &dofs()).unwrap(),
            unit,
            dof,
            prediction: Belief {
                state: unit.map(|unit| -3.0 * unit),
                deviation: unit,
            },
            travel: unit.map(|unit| 7.0 * unit),
        }
    }

    fn seen(&self, innovation: f64, deviation: f64) -> PerDof<Sighting> {
        let unit = self.unit[self.dof];
        let mut seen = [0, 1, 2].map(|dof| Sighting {
            command: 0.0,
            travel: self.travel[dof],
            tip: f64::NAN,
            deviation: f64::NAN,
            offsets: (f64::NEG_INFINITY, f64::INFINITY),
        });
        seen[self.dof].tip = self.prediction.state[self.dof] + innovation * unit;
        seen[self.dof].deviation = deviation * unit;
        seen
    }

    fn refuses(&self, innovation: f64, deviation: f64) -> bool {
        let seen = self.seen(innovation, deviation);
        let flags = self
            .gate
            .check_innovation(&self.prediction, [1e3; 3], &seen);
        flags.contains(Flag::Innovation)
    }

    /// The standard deviation in use, found by the bound of an image that is exact.
    fn std(&self) -> f64 {
        let limit = safety().innovation_limit;
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
        self.travel[self.dof] += way * self.unit[self.dof];
    }

    /// Accept an image; the variance then.
    fn accept(&mut self, innovation: f64, way: f64) -> f64 {
        self.goes(way);
        let seen = self.seen(innovation, 0.1);
        self.gate.accept(&self.prediction, &seen);
        self.std().powi(2)
    }
}

fn near(found: f64, expected: f64) -> bool {
    (found - expected).abs() <= 1e-6 * expected.abs().max(1.0)
}

proptest! {
    #![proptest_config(config())]

    /// innovation^2 > `innovation_limit`^2 (std^2 + deviation^2), with the standard deviation of the start
    #[test]
    fn an_innovation_is_refused_beyond_its_limit_of_standard_deviations(
        dof in 0..3_usize, share in 0.1..2.0_f64, deviation in 0.0..30.0, above in prop::bool::ANY,
    ) {
        prop_assume!(f64::abs(share - 1.0) > 1e-6);
        let bench = Bench::new(dof);
        let start = 1.0 / safety().innovation_floor;
        let limit = safety().innovation_limit * f64::hypot(start, deviation);
        let innovation = if above { share * limit } else { -share * limit };
        prop_assert_eq!(bench.refuses(innovation, deviation), share > 1.0);
        // Without a standard deviation there is no bound.
        prop_assert!(!bench.refuses(innovation, f64::NAN));
        prop_assert!(!bench.refuses(f64::NAN, deviation));
    }

    /// The variance approaches that of the innovations by a constant factor per image.
    #[test]
    fn the_standard_deviation_grows_quickly_and_decays_slowly_with_motion(
        dof in 0..3_usize, large in 40.0..200.0, small in 2.0..5.0,
    ) {
        let mut bench = Bench::new(dof);
        let left = |bench: &mut Bench, innovation: f64, way: f64| {
            let before = bench.std().powi(2) - innovation * innovation;
            (bench.accept(innovation, way) - innovation * innovation) / before
        };
        let up = left(&mut bench, large, 0.0);
        prop_assert!((0.3..0.9).contains(&up), "{}", up);
        prop_assert!(near(left(&mut bench, -large, 5.0), up), "with motion as well as without");
        let rest = left(&mut bench, small, 0.0);
        prop_assert!(near(rest, 1.0), "no decay at rest: {}", rest);
        let down = left(&mut bench, small, 1.0);
        prop_assert!(down > up && down < 0.99, "{}", down);
        let far = left(&mut bench, -small, 9.0);
        prop_assert!(near(far, down), "an image counts once: {}, not {}", far, down);
        let half = left(&mut bench, small, 0.5);
        prop_assert!(near(half, f64::midpoint(1.0, down)), "{}, not half of {}", half, down);
    }

    /// Both bounds grow by `blind_growth` times the travel, to at most those of the start; motion before the last image does not count.
    #[test]
    fn the_bounds_widen_with_motion_without_a_marker(dof in 0..3_usize, ways in prop::collection::vec(0.0..20.0, 1..6)) {
        let mut bench = Bench::new(dof);
        for _ in 0..300 {
            bench.accept(0.5, 4.0);
        }
        let least = bench.std();
        prop_assert!(near(least, 1.0), "the least standard deviation: {}", least);
        let start = 1.0 / safety().innovation_floor;
        let mut blind = 0.0;
        for way in ways {
            bench.goes(way);
            blind += way * safety().blind_growth;
            bench.gate.miss(bench.travel);
            let std = bench.std();
            let expected = (1.0 + blind).min(start);
            prop_assert!(near(std, expected), "{}, not {}", std, expected);
            let reach = safety().jump[dof] / bench.unit[dof] + blind.min(start);
            for (far, jumps) in [(reach - 1e-6, false), (reach + 1e-6, true)] {
                let flags = bench.gate.check_innovation(&bench.prediction, [0.0; 3], &bench.seen(far, 0.0));
                prop_assert_eq!(flags.contains(Flag::Jump), jumps, "{}", far);
            }
        }
        // A standard deviation above that of the start, after large innovations, stays.
        let wide = bench.accept(50.0 * start, 0.0).sqrt();
        bench.goes(1.0);
        bench.gate.miss(bench.travel);
        prop_assert!(near(bench.std(), wide));
        bench.gate.reset();
        prop_assert!(near(bench.std(), start));
    }
}
