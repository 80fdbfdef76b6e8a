//! One friction for insertion and rotation: what slides along the channel turns freely in it.

use crate::axis::Axis;
use crate::dof::PerDof;
use crate::error::{ConfigError, require_positive};

const STEPS: usize = 12;

/// The friction of a round shaft in its channel, which insertion and rotation share.
///
/// Friction has one size and opposes the way in which the surface slides, along and around. So what the
/// shaft is stretched by, e = c - q less the middle of the slack, over half the width h of the
/// slack that each of the two has by itself, is at most 1 for both together:
///
/// ```text
/// n = (e1 / h1, e2 / h2)         |n| <= 1, and the shaft slides only where |n| = 1
/// (dq1, arm dq2) = n dl          dl >= 0: it slides as it is pulled
/// grip = (sqrt(1 - n2^2), sqrt(1 - n1^2))
/// ```
///
/// with the arm at which rotation rubs [m], the shaft's radius. `grip` is the share of its slack that is
/// left for each. A DOF that moves alone has all of it; of two, the faster one takes most.
///
/// It runs on the commands alone: every slide makes it forget what it began with.
///
/// Wrong as far as the shaft slides in some places and not in others, and where friction is not the
/// same along and around. Bending rubs elsewhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction {
    arm: f64,
    stretch: [f64; 2],
    command: [f64; 2],
    memory: f64,
    reference: [f64; 2],
    /// Which way the surface is to slide, along and around.
    way: [f64; 2],
}

impl Friction {
    /// Of a shaft that rubs at this radius, in m.
    ///
    /// # Errors
    /// It is not a finite number above 0.
    pub fn new(arm: f64, memory: f64) -> Result<Self, ConfigError> {
        require_positive("friction_arm", arm)?;
        Ok(Self {
            arm,
            stretch: [0.0; 2],
            command: [f64::NAN; 2],
            memory,
            reference: [f64::NAN; 2],
            way: [0.0; 2],
        })
    }

    /// The commands of insertion and rotation [m, rad] and half the width of the slack that each has by
    /// itself [m, rad]: the share of it that is left for each. All of it where there is no slack.
    pub fn step(&mut self, command: [f64; 2], half_width: [f64; 2]) -> [f64; 2] {
        let [along, around] = half_width;
        let before = core::mem::replace(&mut self.command, command);
        let moved = command.iter().zip(before).zip(half_width);
        for (stretch, ((command, before), half)) in self.stretch.iter_mut().zip(moved) {
            *stretch += (command - before) / half;
        }
        if !self.stretch.iter().all(|value| value.is_finite()) {
            self.stretch = [0.0; 2];
        }
        self.slide(along / (self.arm * around));
        let [n1, n2] = self.stretch;
        [n2, n1].map(|other| libm::sqrt((1.0 - other * other).max(0.0)))
    }

    /// The references: the share that each will have of the friction when it slides as it is to.
    pub fn aim(&mut self, reference: [f64; 2]) -> [f64; 2] {
        let [u1, u2] = reference;
        let [w1, w2] = core::mem::replace(&mut self.reference, reference);
        let (along, around) = (u1 - w1, self.arm * (u2 - w2));
        let travel = libm::hypot(along, around);
        if travel > 0.0 {
            let new = -libm::expm1(-travel / self.memory);
            let [x, y] = self.way;
            self.way = [x + new * (along / travel - x), y + new * (around / travel - y)];
        }
        let [x, y] = self.way;
        let size = libm::hypot(x, y);
        if size > 0.0 { [x.abs() / size, y.abs() / size] } else { [1.0; 2] }
    }

    /// Back to |n| = 1: n1 / (1 + l), n2 / (1 + l `ease`), by Newton from below.
    fn slide(&mut self, ease: f64) {
        let [n1, n2] = self.stretch;
        if n1 * n1 + n2 * n2 <= 1.0 {
            return;
        }
        let mut slid = 0.0;
        let at = |slid: f64| (n1 / (1.0 + slid), n2 / (1.0 + slid * ease));
        for _ in 0..STEPS {
            let (a, b) = at(slid);
            let slope = a * a / (1.0 + slid) + ease * b * b / (1.0 + slid * ease);
            slid += (a * a + b * b - 1.0) / (2.0 * slope);
        }
        let (a, b) = at(slid);
        let size = libm::hypot(a, b);
        self.stretch = [a / size, b / size];
    }

    /// Tell both axes what is left for them.
    pub(crate) fn couple(&mut self, reference: PerDof<f64>, axes: &mut PerDof<Axis>) {
        let [insertion, rotation, _] = axes;
        let [u1, u2, _] = reference;
        let [a1, a2] = self.aim([u1, u2]);
        let half = |axis: &Axis| axis.play().width() / 2.0;
        let [first, second] = self.step(
            [insertion.command(), rotation.command()],
            [half(insertion), half(rotation)],
        );
        insertion.set_grip(first, a1);
        rotation.set_grip(second, a2);
    }
}
