//! Start check: a tip that moves against its command.

/// Standard deviation of the command from which on tip and command are compared, in `start_deviation`: that of a sine of more
/// than twice the expected slack.
const SPREAD: f64 = 1.5;
/// Least number of measurements.
const LEAST: u32 = 50;
/// Distance of a tip from the mean, in `start_deviation`, beyond four times the range of the command, from which on it is an
/// outlier: a tracker without a tool measures anything.
const FAR: f64 = 8.0;
const MOST_GAIN: f64 = 4.0;
/// Correlation from which on the direction is known: little else that moves a tip behind a wide slack reaches it.
const CORRELATION: f64 = 0.8;

/// Finds degrees of freedom whose tip moves against the command: the sign of a motor or of a sensor is wrong.
///
/// ```text
/// r = cov(c, m) / (std(c) std(m)) < -0.8
/// ```
///
/// of the command c and the tip m by each measurement alone, used or refused, from the start on, but for outliers, unless they are as many as the others. The first time that |r| is
/// larger, with enough measurements over enough motion, decides, and the DOF is not checked again.
///
/// Wrong when something else moves the tip farther than its command does meanwhile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StartCheck<const N: usize> {
    start_deviation: [f64; N],
    motions: [Motion; N],
}

impl<const N: usize> StartCheck<N> {
    /// The check before the first measurement, for `start_deviation` (N,) [m or rad].
    pub fn new(start_deviation: [f64; N]) -> Self {
        Self {
            start_deviation,
            motions: [Motion::NONE; N],
        }
    }

    /// The least standard deviations of the command (N,) [m or rad]; None where all directions are known.
    pub fn unknown(&self) -> Option<[f64; N]> {
        let is_open = self.motions.iter().any(|motion| !motion.is_known);
        is_open.then(|| self.start_deviation.map(|deviation| SPREAD * deviation))
    }

    /// Forgets all measurements.
    pub const fn restart(&mut self) {
        self.motions = [Motion::NONE; N];
    }

    /// Update with a measured tip and the command of its time (N,) [m or rad]; NaN for a DOF that was not measured. Whether one
    /// moves against its command.
    pub fn update(&mut self, command: [f64; N], tip: [f64; N]) -> bool {
        let mut is_reversed = false;
        let values = command.into_iter().zip(tip).zip(self.start_deviation);
        for (motion, ((command, tip), deviation)) in self.motions.iter_mut().zip(values) {
            if !motion.is_known && command.is_finite() && tip.is_finite() {
                motion.add(command, tip, deviation);
                is_reversed |= motion.is_known && motion.product < 0.0;
            }
        }
        is_reversed
    }
}

/// Sums over the measurements of a DOF.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Motion {
    count: u32,
    /// Outliers since the last other one.
    outliers: u32,
    /// Whether the direction is known.
    is_known: bool,
    /// Least and largest command.
    range: [f64; 2],
    /// Of command and tip.
    means: [f64; 2],
    squares: [f64; 2],
    product: f64,
}

impl Motion {
    const NONE: Self = Self {
        count: 0,
        outliers: 0,
        is_known: false,
        range: [f64::INFINITY, f64::NEG_INFINITY],
        means: [0.0; 2],
        squares: [0.0; 2],
        product: 0.0,
    };

    /// Adds a measurement (Welford 1962).
    fn add(&mut self, command: f64, tip: f64, start_deviation: f64) {
        let ([least, most], [_, mean]) = (self.range, self.means);
        let far = FAR * start_deviation + MOST_GAIN * (most - least);
        if self.count > 0 && (tip - mean).abs() > far {
            self.outliers += 1;
            if self.outliers < self.count {
                return;
            }
            *self = Self::NONE;
        }
        self.outliers = 0;
        let [least, most] = self.range;
        self.range = [least.min(command), most.max(command)];
        let spread = SPREAD * start_deviation;
        self.count = self.count.saturating_add(1);
        let count = f64::from(self.count);
        let mut left = [0.0; 2];
        let sums = self.means.iter_mut().zip(&mut self.squares);
        for ((mean, square), (left, value)) in sums.zip(left.iter_mut().zip([command, tip])) {
            let away = value - *mean;
            *mean += away / count;
            *left = value - *mean;
            *square += away * *left;
        }
        let [command, tip] = left;
        self.product += command * tip * count / (count - 1.0).max(1.0);
        let [command, tip] = self.squares;
        self.is_known = self.count >= LEAST
            && command >= count * spread * spread
            && self.product.abs() > CORRELATION * libm::sqrt(command * tip);
    }
}
