//! One friction for insertion and rotation: what slides along the channel turns freely in it.

use crate::error::{ConfigError, require_non_negative, require_positive};

const STEPS: usize = 12;
/// By so much |n|^2 may be above 1 at rest.
const ROUNDING: f64 = 1e-12;

/// What a [`Friction`] is set to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrictionSettings {
    /// Where rotation rubs, from the axis: the shaft's radius, in m.
    pub arm: f64,
    /// Travel of the shaft's surface over which the way it is to slide is averaged, in m.
    pub memory: f64,
    /// Standard deviation of a share of the friction when there is nothing left of it; none when there is all.
    pub deviation: f64,
}

/// How much of its own slack a DOF has when another slides too: shares of the width, about the same middle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlackShare {
    /// Now.
    pub now: f64,
    /// When the shaft slides as the references do.
    pub aimed: f64,
    /// Standard deviation of what it is now.
    pub deviation: f64,
}

impl SlackShare {
    /// Of a DOF that moves alone.
    pub const WHOLE: Self = Self {
        now: 1.0,
        aimed: 1.0,
        deviation: 0.0,
    };
}

/// The friction of a round shaft in its channel, which insertion and rotation share.
///
/// Friction has one size and opposes the way the surface slides, along and around together. With
/// e = c - q less the middle of the slack, h half the width of the slack that each DOF has by itself
/// [m, rad], and the arm r in m:
///
/// ```text
/// n = (e1 / h1, e2 / h2)              |n| <= 1; the shaft slides only where |n| = 1
/// (dq1, r dq2) = n dl                 dl >= 0: it slides as it is pulled
/// now = (sqrt(1 - n2^2), sqrt(1 - n1^2))
/// aimed = (|w1|, |w2|) / |w|          w: mean of (du1, r du2) / |(du1, r du2)|
/// deviation_j = deviation sqrt(1 - now_j^2)
/// ```
///
/// A DOF that moves alone has all of it; of two, the one whose surface is faster takes most. It runs on
/// references and commands, not on images, and every slide makes it forget where it began.
///
/// Wrong as far as one part of the shaft slides while another sticks, where friction is not the same along
/// and around, and with a wrong width. Bending rubs elsewhere and is not concerned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction {
    settings: FrictionSettings,
    reference: [f64; 2],
    command: [f64; 2],
    /// n.
    stretch: [f64; 2],
    /// w.
    way: [f64; 2],
}

impl Friction {
    /// Of a shaft that has not moved.
    ///
    /// # Errors
    /// A length is not a finite number above 0, or the deviation not one from 0 on.
    pub fn new(settings: FrictionSettings) -> Result<Self, ConfigError> {
        require_positive("friction_arm", settings.arm)?;
        require_positive("friction_memory", settings.memory)?;
        require_non_negative("friction_deviation", settings.deviation)?;
        Ok(Self {
            settings,
            reference: [f64::NAN; 2],
            command: [f64::NAN; 2],
            stretch: [0.0; 2],
            way: [0.0; 2],
        })
    }

    /// A tick: references and commands of insertion and rotation, and half the width of the slack that
    /// each has by itself [m, rad]. What is left of it for each; all where one of them has none.
    pub fn step(
        &mut self,
        reference: [f64; 2],
        command: [f64; 2],
        half_width: [f64; 2],
    ) -> [SlackShare; 2] {
        self.turn(reference);
        self.pull(command, half_width);
        let share = |value: f64| libm::sqrt((1.0 - value * value).max(0.0));
        let ([n1, n2], [w1, w2]) = (self.stretch, self.way);
        let size = libm::hypot(w1, w2);
        let part = |other: f64, way: f64| SlackShare {
            now: share(other),
            aimed: if size > 0.0 { way.abs() / size } else { 1.0 },
            deviation: self.settings.deviation * other.abs(),
        };
        [part(n2, w1), part(n1, w2)]
    }

    /// Which way the surface is to slide.
    fn turn(&mut self, reference: [f64; 2]) {
        let before = core::mem::replace(&mut self.reference, reference);
        let ([u1, u2], [v1, v2]) = (reference, before);
        let (along, around) = (u1 - v1, self.settings.arm * (u2 - v2));
        let travel = libm::hypot(along, around);
        if travel.is_finite() && travel > 0.0 {
            let new = -libm::expm1(-travel / self.settings.memory);
            let [w1, w2] = self.way;
            self.way = [
                w1 + new * (along / travel - w1),
                w2 + new * (around / travel - w2),
            ];
        }
    }

    fn pull(&mut self, command: [f64; 2], half_width: [f64; 2]) {
        let before = core::mem::replace(&mut self.command, command);
        let moved = command.iter().zip(before).zip(half_width);
        for (stretch, ((command, before), half)) in self.stretch.iter_mut().zip(moved) {
            *stretch += (command - before) / half;
        }
        let [along, around] = half_width;
        self.slide(along / (self.settings.arm * around));
        if !self.stretch.iter().all(|value| value.is_finite()) {
            self.stretch = [0.0; 2];
        }
    }

    /// Back to |n| = 1, to n1 / (1 + l), n2 / (1 + `ease` l): by Newton, which comes from below.
    fn slide(&mut self, ease: f64) {
        let [n1, n2] = self.stretch;
        if n1 * n1 + n2 * n2 <= 1.0 + ROUNDING {
            return;
        }
        let at = |slid: f64| [n1 / (1.0 + slid), n2 / (1.0 + ease * slid)];
        let mut slid = 0.0;
        for _ in 0..STEPS {
            let [a, b] = at(slid);
            let slope = a * a / (1.0 + slid) + ease * b * b / (1.0 + ease * slid);
            slid += (a * a + b * b - 1.0) / (2.0 * slope);
        }
        let [a, b] = at(slid);
        let size = libm::hypot(a, b);
        self.stretch = [a / size, b / size];
    }
}
