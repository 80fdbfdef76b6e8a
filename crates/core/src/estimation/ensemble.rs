//! Ensemble of hypotheses about tip and hysteresis.

use core::array;

use crate::dof::PerDof;
use crate::estimation::centre_map::CentreMap;
use crate::math::random::Normal;
use crate::model::hysteresis::{Hysteresis, PlayPosition};

/// Number of members.
pub const MEMBERS: usize = 64;
/// [`MEMBERS`] in sums.
const COUNT: f64 = 64.0;
/// Largest lag in s.
const LARGEST_LAG: f64 = 0.4;
/// Length of a member's state.
pub const STATE: usize = 15;
/// What an entry of a state describes.
#[derive(Debug, Clone, Copy)]
enum Local {
    /// Position of the tip.
    Position,
    /// Hysteresis of insertion with rotation.
    Shaft,
    /// Hysteresis of bending.
    Bending,
}
/// What each entry of a state describes.
const LOCAL: [Local; STATE] = {
    use Local::{Bending, Position, Shaft};
    [
        Position, Position, Position, Position, Position, Shaft, Shaft, Bending, Shaft, Shaft,
        Bending, Shaft, Shaft, Shaft, Bending,
    ]
};

/// State of a member: output of the plays (3,) and of the shaft (2,), ln half width (3,), centre (3,) without the map,
/// share of the friction that the DOFs have in common, and lag (3,) of the tip behind the plays in s.
pub type State = [f64; STATE];

/// Hypotheses, each a complete state that the exact plays propagate.
#[derive(Debug, Clone, PartialEq)]
pub struct Ensemble {
    members: [State; MEMBERS],
    random: Normal,
}

/// One scalar measurement of the outputs of the plays, whose error has the standard deviation 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScalarMeasurement {
    /// Derivative by the output of each DOF.
    pub output: PerDof<f64>,
    /// Derivative by the lag of each DOF.
    pub lag: PerDof<f64>,
    /// The measured value.
    pub value: f64,
}

impl Ensemble {
    /// Members drawn from independent normal distributions.
    pub fn new(mean: &State, std: &State, seed: u64) -> Self {
        let mut ensemble = Self {
            members: [*mean; MEMBERS],
            random: Normal::new(seed),
        };
        ensemble.add_noise(std);
        // Without a motion so far, the shaft is where the output is.
        for [q1, q2, _, shaft1, shaft2, ..] in &mut ensemble.members {
            (*shaft1, *shaft2) = (*q1, *q2);
        }
        ensemble
    }

    /// Adds independent normal noise to each entry; shaft and output move together.
    pub fn add_noise(&mut self, std: &State) {
        for member in &mut self.members {
            for (entry, std) in member.iter_mut().zip(std) {
                if *std > 0.0 {
                    *entry += std * self.random.draw();
                }
            }
        }
    }

    /// Moves output and shaft of insertion, rotation and bending together, by independent normal noise.
    pub fn disturb_position(&mut self, [d1, d2, d3]: PerDof<f64>) {
        for [q1, q2, q3, shaft1, shaft2, ..] in &mut self.members {
            let (z1, z2) = (d1 * self.random.draw(), d2 * self.random.draw());
            *q1 += z1;
            *q2 += z2;
            *q3 += d3 * self.random.draw();
            *shaft1 += z1;
            *shaft2 += z2;
        }
    }

    /// Propagates every member along a path of commands [m, rad, rad] from `from` on.
    pub fn propagate(
        &mut self,
        maps: &PerDof<CentreMap>,
        radius: f64,
        from: PerDof<f64>,
        path: impl Iterator<Item = PerDof<f64>>,
    ) {
        let mut plays = self.members.map(|member| {
            let position = position(&member);
            (hysteresis(&member, maps, position.output), position)
        });
        let mut last = from;
        for command in path {
            for (hysteresis, position) in &mut plays {
                *position = hysteresis.propagate(radius, position, last, command);
            }
            last = command;
        }
        for (member, (_, position)) in self.members.iter_mut().zip(&plays) {
            set_position(member, position);
        }
    }

    /// Mean of the states.
    pub fn mean(&self) -> State {
        let mut sum = [0.0; STATE];
        for member in &self.members {
            for (sum, entry) in sum.iter_mut().zip(member) {
                *sum += entry;
            }
        }
        sum.map(|sum| sum / COUNT)
    }

    /// Covariance of a function of the states with N values.
    pub fn covariance<const N: usize>(
        &self,
        of: impl Fn(&State) -> [f64; N],
    ) -> ([f64; N], [[f64; N]; N]) {
        let mut mean = [0.0; N];
        for member in &self.members {
            for (sum, value) in mean.iter_mut().zip(of(member)) {
                *sum += value / COUNT;
            }
        }
        let mut covariance = [[0.0; N]; N];
        for member in &self.members {
            let mut away = of(member);
            for (value, mean) in away.iter_mut().zip(mean) {
                *value -= mean;
            }
            for (row, own) in covariance.iter_mut().zip(away) {
                for (entry, other) in row.iter_mut().zip(away) {
                    *entry += own * other / (COUNT - 1.0);
                }
            }
        }
        (mean, covariance)
    }

    /// Updates the members with a measurement of standard deviation 1 by the ensemble square root filter (Whitaker,
    /// Hamill, Monthly Weather Review 130, 2002):
    ///
    /// ```text
    /// K = cov(x, y) / (var(y) + 1);   mean += K (value - mean(y));   x - mean -= K (y - mean(y)) / (1 + 1 / sqrt(var(y) + 1))
    /// ```
    ///
    /// with y = row . x. Localised (Houtekamer, Mitchell, Monthly Weather Review 129, 2001), because few members have
    /// correlations by chance: in K of the hysteresis of a group of DOFs y is the group's part of it. `shares` (shaft,
    /// bending) multiplies these K.
    pub fn update(&mut self, measurement: &ScalarMeasurement, shares: [f64; 2]) {
        let parts: [[f64; 2]; MEMBERS] = array::from_fn(|index| {
            self.members
                .get(index)
                .map_or([0.0; 2], |member| measurement.predict(member))
        });
        let mut mean_part = [0.0; 2];
        for part in parts {
            for (sum, value) in mean_part.iter_mut().zip(part) {
                *sum += value / COUNT;
            }
        }
        let [mean_shaft, mean_bending] = mean_part;
        let [shaft_share, bending_share] = shares;
        let mean = self.mean();
        let (mut covariance, mut variance) = ([0.0; STATE], 0.0);
        for (member, [shaft, bending]) in self.members.iter().zip(parts) {
            let shaft = (shaft - mean_shaft) / (COUNT - 1.0);
            let bending = (bending - mean_bending) / (COUNT - 1.0);
            let all = shaft + bending;
            variance += (COUNT - 1.0) * all * all;
            let entries = covariance.iter_mut().zip(member).zip(mean).zip(LOCAL);
            for (((covariance, entry), mean), local) in entries {
                let away = match local {
                    Local::Position => all,
                    Local::Shaft => shaft,
                    Local::Bending => bending,
                };
                *covariance += away * (entry - mean);
            }
        }
        for (covariance, local) in covariance.iter_mut().zip(LOCAL) {
            *covariance *= match local {
                Local::Position => 1.0,
                Local::Shaft => shaft_share,
                Local::Bending => bending_share,
            };
        }
        let total = variance + 1.0;
        let reduced = 1.0 / (1.0 + 1.0 / libm::sqrt(total));
        let innovation = measurement.value - mean_shaft - mean_bending;
        for (member, [shaft, bending]) in self.members.iter_mut().zip(parts) {
            let away = shaft - mean_shaft + bending - mean_bending;
            let step = (innovation - reduced * away) / total;
            for (entry, covariance) in member.iter_mut().zip(covariance) {
                *entry += covariance * step;
            }
        }
    }

    /// Keeps the parameters within the half widths (3,) `least` to `largest`, the share within 0 to 1 and the lags
    /// within 0 to [`LARGEST_LAG`].
    pub fn limit(&mut self, least: PerDof<f64>, largest: PerDof<f64>) {
        let bounds = least.map(libm::log).into_iter().zip(largest.map(libm::log));
        for [_, _, _, _, _, h1, h2, h3, _, _, _, share, l1, l2, l3] in &mut self.members {
            for (half, (least, largest)) in [h1, h2, h3].into_iter().zip(bounds.clone()) {
                *half = half.max(least).min(largest);
            }
            *share = share.clamp(0.0, 1.0);
            for lag in [l1, l2, l3] {
                *lag = lag.clamp(0.0, LARGEST_LAG);
            }
        }
    }

    /// Subtracts `change` from the centre of every member.
    pub fn shift_centres(&mut self, [d1, d2, d3]: PerDof<f64>) {
        for [_, _, _, _, _, _, _, _, m1, m2, m3, ..] in &mut self.members {
            *m1 -= d1;
            *m2 -= d2;
            *m3 -= d3;
        }
    }
}

impl ScalarMeasurement {
    /// The parts of insertion with rotation, and of bending.
    fn predict(&self, state: &State) -> [f64; 2] {
        let ([a, b, c], [d, e, f]) = (self.output, self.lag);
        let ([q1, q2, q3, ..], [l1, l2, l3]) = (state, lag(state));
        [a * q1 + b * q2 + d * l1 + e * l2, c * q3 + f * l3]
    }
}

/// Position of the plays in a state.
pub const fn position(state: &State) -> PlayPosition {
    let [q1, q2, q3, shaft1, shaft2, ..] = *state;
    PlayPosition {
        shaft: [shaft1, shaft2],
        output: [q1, q2, q3],
    }
}

/// Lags in a state, in s.
pub const fn lag(state: &State) -> PerDof<f64> {
    let [.., l1, l2, l3] = *state;
    [l1, l2, l3]
}

const fn set_position(state: &mut State, position: &PlayPosition) {
    let [q1, q2, q3, shaft1, shaft2, ..] = state;
    [*q1, *q2, *q3] = position.output;
    [*shaft1, *shaft2] = position.shaft;
}

/// Hysteresis of a state where the output is at `output`.
pub fn hysteresis(state: &State, maps: &PerDof<CentreMap>, output: PerDof<f64>) -> Hysteresis {
    let [_, _, _, _, _, h1, h2, h3, m1, m2, m3, share, ..] = *state;
    let mut centre = [m1, m2, m3];
    for ((centre, map), output) in centre.iter_mut().zip(maps).zip(output) {
        *centre += map.at(output);
    }
    Hysteresis {
        half_width: [h1, h2, h3].map(libm::exp),
        centre,
        shared: share,
    }
}
