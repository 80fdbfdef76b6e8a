//! Whether the tip follows the command, told from recent measurements.

const CAPACITY: usize = 16;
const SPACING: f64 = 0.1;

/// When tip and command count as moving together, in the unit of the DOF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactTest {
    /// Travel of the command over which their changes are compared.
    pub distance: f64,
    /// How far the tip must have come since the command turned.
    pub moved: f64,
    /// Deviation of tip over command travel from the gain in contact, as a share of it.
    pub tolerance: f64,
}

/// The recent measurements of one stroke.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stroke {
    recent: [(f64, f64); CAPACITY],
    count: usize,
    start: f64,
    upwards: bool,
}

/// What a measurement says about the stroke it belongs to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Travel of the command since the last measurement that counted.
    pub travel: f64,
    /// Whether the command increases.
    pub upwards: bool,
    /// Whether the tip follows.
    pub together: bool,
}

impl Stroke {
    /// Nothing seen yet.
    pub const fn new() -> Self {
        Self {
            recent: [(0.0, 0.0); CAPACITY],
            count: 0,
            start: 0.0,
            upwards: true,
        }
    }

    /// Take in command and output of one instant; None until the command has moved enough.
    ///
    /// In contact the tip travels between `gains.0` and `gains.1` of what the command does.
    pub fn follow(
        &mut self,
        test: &ContactTest,
        gains: (f64, f64),
        command: f64,
        measured: f64,
    ) -> Option<Motion> {
        if self.count == 0 {
            self.start = measured;
            self.remember(command, measured);
            return None;
        }
        let last = *self.recent.first()?;
        let travel = command - last.0;
        if travel.abs() < SPACING * test.distance {
            return None;
        }
        let upwards = travel > 0.0;
        if upwards != self.upwards {
            self.count = 0;
            self.upwards = upwards;
            self.start = last.1;
            self.remember(last.0, last.1);
        }
        let before = self
            .recent
            .iter()
            .take(self.count)
            .find(|(past, _)| (command - past).abs() >= test.distance);
        let together = before.is_some_and(|(past, then)| {
            let slope = (measured - then) / (command - past);
            let follows = slope > gains.0 * (1.0 - test.tolerance)
                && slope < gains.1 * (1.0 + test.tolerance);
            follows && (measured - self.start).abs() > test.moved
        });
        self.remember(command, measured);
        Some(Motion {
            travel: travel.abs(),
            upwards,
            together,
        })
    }

    /// Newest first.
    fn remember(&mut self, command: f64, measured: f64) {
        self.recent.rotate_right(1);
        if let Some(first) = self.recent.first_mut() {
            *first = (command, measured);
        }
        self.count = (self.count + 1).min(CAPACITY);
    }
}
