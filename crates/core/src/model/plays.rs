//! Plays of fixed radii: the regressors of the tip.

use crate::dof::{Friction, try_each};
use crate::error::{ConfigError, require_positive};

/// Plays of a DOF that are of its friction group: vector plays where several DOFs share a friction.
pub const SHARED: usize = 12;
/// Plays of a DOF by itself.
pub const OWN: usize = 6;
/// Bent plays: every second own play, bent at each of [`KNOTS`].
pub const BENT: usize = OWN / 2 * KNOTS.len();
/// Coefficients of a DOF: of the plays, of the bent plays, and the offset.
pub const COEFFICIENTS: usize = SHARED + OWN + BENT + 1;
/// Index of the offset.
pub const OFFSET: usize = COEFFICIENTS - 1;

/// Radii of the own plays; 1 is half as large again as the expected half width.
const OWN_RADII: [f64; OWN] = [0.0, 0.25, 0.5, 0.75, 1.0, 1.25];
/// Radii of the plays of a DOF that shares no friction: between those of the own plays.
const ALONE_RADII: [f64; SHARED] = [
    0.06, 0.12, 0.19, 0.31, 0.37, 0.44, 0.56, 0.62, 0.69, 0.81, 0.88, 1.12,
];
/// Half widths of the vector plays of the first DOF of a group and of the others: three ratios, because widths are drawn apart.
const VECTOR_RADII: [f64; SHARED] = [
    0.25, 0.5, 0.75, 1.0, 0.25, 0.5, 0.75, 1.0, 0.25, 0.5, 0.75, 1.0,
];
const SIDE_RADII: [f64; SHARED] = [
    0.15, 0.3, 0.45, 0.6, 0.2125, 0.425, 0.6375, 0.85, 0.3, 0.6, 0.9, 1.2,
];
/// Positions at which plays are bent.
const KNOTS: [f64; 3] = [-1.0, 0.0, 1.0];
/// Newton steps of the return to the friction ellipse at most, and the error of its equation at which they end: the motion of
/// a control tick needs two, that to the law's target four.
const STEPS: usize = 4;
const EXACT: f64 = 1e-9;

/// Regressors of a DOF, or their coefficients.
pub type Row = [f64; COEFFICIENTS];

/// Outputs of the plays of a DOF, in its unit from the first reference.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Outputs {
    shared: Lanes,
    own: [f64; OWN],
}

/// Outputs of the plays of N DOFs, and the command that they follow, in units of the DOF from the first reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plays<const N: usize> {
    outputs: [Outputs; N],
    /// The command.
    pub command: [f64; N],
    /// Travel of the command so far, summed over the DOFs.
    pub travel: f64,
}

impl<const N: usize> Plays<N> {
    /// All plays at rest at the origin.
    pub const REST: Self = Self {
        outputs: [Outputs {
            shared: [0.0; SHARED],
            own: [0.0; OWN],
        }; N],
        command: [0.0; N],
        travel: 0.0,
    };

    /// Regressors of each DOF:
    ///
    /// ```text
    /// phi = (shared plays, own plays p, max(p - knot, 0) of every second own play, 1)
    /// ```
    pub fn regressors(&self) -> [Row; N] {
        self.outputs.each_ref().map(Outputs::regressors)
    }

    /// Regressors times coefficients of each DOF.
    #[inline]
    pub fn tip(&self, rows: &[Row; N]) -> [f64; N] {
        let mut tip = [0.0; N];
        for ((tip, dof), row) in tip.iter_mut().zip(&self.outputs).zip(rows) {
            *tip = product(&dof.regressors(), row);
        }
        tip
    }
}

impl Outputs {
    #[inline]
    fn regressors(&self) -> Row {
        let mut row = [1.0; COEFFICIENTS];
        let (plays, rest) = row.split_at_mut(SHARED);
        plays.copy_from_slice(&self.shared);
        let (plays, curved) = rest.split_at_mut(OWN);
        plays.copy_from_slice(&self.own);
        let bent = curved.chunks_exact_mut(KNOTS.len());
        for (bent, play) in bent.zip(self.own.iter().step_by(2)) {
            for (entry, knot) in bent.iter_mut().zip(KNOTS) {
                let above = play - knot;
                *entry = if above > 0.0 { above } else { 0.0 };
            }
        }
        row
    }
}

/// The plays of N DOFs, some of which share a friction.
///
/// The tip is a linear combination of plays (Prandtl-Ishlinskii operator in threshold-discrete form: Krasnosel'skii,
/// Pokrovskii, Systems with Hysteresis, 1989); bent plays make it asymmetric (Al Janaideh, Rakheja, Su, IEEE/ASME Trans.
/// Mechatronics 16, 2011). Of DOFs that share a friction the plays are vector plays: with the deflection e = command - output,
/// half widths h and levers r,
///
/// ```text
/// sum (e_i / h_i)^2 <= 1;    where it is 1 the output slides along r_i dq_i = (e_i / h_i) dl,  dl >= 0
/// ```
///
/// solved implicitly for each motion (return mapping of plasticity: Simo, Hughes, Computational Inelasticity, 1998), with an
/// error of second order in the motion.
///
/// All lengths are in the unit of the DOF. Wrong while viscous friction is not small.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transmission<const N: usize> {
    friction: Friction<N>,
    dofs: [Radii; N],
}

/// Half widths of the plays of a DOF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Radii {
    /// Unit of the DOF [m or rad].
    pub unit: f64,
    /// Whether it shares its friction with none.
    pub is_alone: bool,
    shared: Lanes,
    inverse: Lanes,
    /// Motion of a sliding output by the same force, over that of the first DOF of the group.
    ease: Lanes,
    /// Row whose product with the coefficients is the half width times the gain: [`GAIN_ROW`] times the radius of each play.
    pub width: Row,
}

impl<const N: usize> Transmission<N> {
    /// For units (N,) of the DOFs [m or rad].
    ///
    /// # Errors
    /// A unit is not a finite number above 0.
    pub fn new(friction: Friction<N>, unit: [f64; N]) -> Result<Self, ConfigError> {
        let mut dofs = try_each(unit, |unit| {
            require_positive("expected_width", unit)?;
            Ok(Radii::new(unit, true, ALONE_RADII, [1.0; SHARED]))
        })?;
        for group in 0..N {
            let members = friction.members(group);
            if members.iter().filter(|own| **own).count() < 2 {
                continue;
            }
            let mut first = None;
            let own = dofs.iter_mut().zip(friction.lever()).zip(members);
            for ((dof, lever), _) in own.filter(|(_, own)| *own) {
                let half = first.map_or(VECTOR_RADII, |_| SIDE_RADII);
                let surface = lever * dof.unit;
                let base = *first.get_or_insert(surface);
                let ease = map(&VECTOR_RADII, &half, |radius, half| {
                    base * radius / (surface * half)
                });
                *dof = Radii::new(dof.unit, false, half, ease);
            }
        }
        Ok(Self { friction, dofs })
    }

    /// Radii of the plays of each DOF.
    pub const fn dofs(&self) -> &[Radii; N] {
        &self.dofs
    }

    /// Units of the DOFs [m or rad].
    pub fn unit(&self) -> [f64; N] {
        self.dofs.each_ref().map(|dof| dof.unit)
    }

    /// Which DOFs share a friction.
    pub const fn friction(&self) -> &Friction<N> {
        &self.friction
    }

    /// Moves the plays by a straight motion of the command to `to` (N,), in units.
    #[inline]
    pub fn advance(&self, plays: &mut Plays<N>, to: &[f64; N]) {
        let dofs = plays.outputs.iter_mut().zip(&self.dofs).zip(to);
        let mut are_alone = true;
        for ((outputs, dof), to) in dofs {
            follow(&mut outputs.own, &OWN_RADII, *to);
            if dof.is_alone {
                follow(&mut outputs.shared, &dof.shared, *to);
            }
            are_alone &= dof.is_alone;
        }
        if !are_alone {
            for group in 0..N {
                let members = self.friction.members(group);
                let mut own = self.dofs.iter().zip(members).filter(|(_, own)| *own);
                if own.any(|(dof, _)| !dof.is_alone) {
                    self.slide(members, to, &mut plays.outputs);
                }
            }
        }
        for (command, to) in plays.command.iter_mut().zip(to) {
            plays.travel += (to - *command).abs();
            *command = *to;
        }
    }

    /// Vector plays of the DOFs of one group.
    fn slide(&self, members: [bool; N], to: &[f64; N], outputs: &mut [Outputs; N]) {
        let mut free = [[0.0; SHARED]; N];
        let (mut square, mut largest) = ([0.0; SHARED], [0.0; SHARED]);
        let dofs = free.iter_mut().zip(&self.dofs).zip(&*outputs).zip(to);
        for ((((free, dof), output), to), _) in dofs.zip(members).filter(|(_, own)| *own) {
            *free = map(&output.shared, &dof.inverse, |play, inverse| {
                (to - play) * inverse
            });
            square = map(&square, free, |square, free| square + free * free);
            largest = map(&largest, &dof.ease, f64::max);
        }
        if square.iter().all(|square| *square <= 1.0) {
            return;
        }
        // Newton's method from below the root of sum (free / (1 + ease l))^2 = 1, which is convex in l:
        // sqrt(s) - 1 >= (s - 1) / (s + 1).
        let mut multiplier = map(&square, &largest, |square, largest| {
            ((square - 1.0) / ((square + 1.0) * largest)).max(0.0)
        });
        for _ in 0..STEPS {
            let (mut value, mut slope) = ([-1.0; SHARED], [0.0; SHARED]);
            let dofs = free.iter().zip(&self.dofs).zip(members);
            for ((free, Radii { ease, .. }), _) in dofs.filter(|(_, own)| *own) {
                let part = map(ease, &multiplier, |ease, l| 1.0 / (1.0 + ease * l));
                let scaled = map(free, &part, |free, part| free * part);
                let term = map(&scaled, &scaled, |a, b| a * b);
                value = map(&value, &term, |value, term| value + term);
                let steep = map(ease, &part, |ease, part| ease * part);
                let change = map(&steep, &term, |steep, term| steep * term);
                slope = map(&slope, &change, |slope, change| slope + change);
            }
            let step = map(&value, &slope, |value, slope| value / (2.0 * slope));
            multiplier = map(&multiplier, &step, |l, step| l + step);
            let off = map(
                &square,
                &value,
                |square, value| {
                    if square > 1.0 { value } else { 0.0 }
                },
            );
            if off.iter().all(|off| *off < EXACT) {
                break;
            }
        }
        let dofs = free.iter().zip(&self.dofs).zip(outputs).zip(to);
        for ((((free, dof), output), to), _) in dofs.zip(members).filter(|(_, own)| *own) {
            let part = map(&dof.ease, &multiplier, |ease, l| 1.0 + ease * l);
            let back = map(&dof.shared, free, |half, free| half * free);
            let back = map(&back, &part, |back, part| back / part);
            let own = output.shared.iter_mut().zip(back).zip(square);
            for ((play, back), square) in own {
                *play = if square > 1.0 { to - back } else { *play };
            }
        }
    }
}

impl Radii {
    fn new(unit: f64, is_alone: bool, shared: Lanes, ease: Lanes) -> Self {
        let bent = OWN_RADII.into_iter().step_by(2);
        let bent = bent.flat_map(|radius| [radius; KNOTS.len()]);
        let radii = shared.into_iter().chain(OWN_RADII).chain(bent);
        let mut width = GAIN_ROW;
        width.iter_mut().zip(radii).for_each(|(a, b)| *a *= b);
        Self {
            unit,
            is_alone,
            shared,
            inverse: shared.map(|half| 1.0 / half),
            ease,
            width,
        }
    }

    /// In the order of the regressors.
    pub fn all(&self) -> impl Iterator<Item = f64> + Clone {
        self.shared.into_iter().chain(OWN_RADII)
    }

    /// Sum of radius times coefficient while the tip slides steadily along `direction`, which is of length 1 in the motion of
    /// the surface of its group, or 0: command less tip over the gain, but for offset and bends.
    #[inline]
    pub fn deflection(&self, row: &Row, direction: f64) -> f64 {
        let (shared, own) = row.split_at(SHARED);
        product(shared, &self.shared) * direction + product(own, &OWN_RADII) * sign(direction)
    }
}

/// A value of each shared play.
type Lanes = [f64; SHARED];

#[inline]
fn map(a: &Lanes, b: &Lanes, combine: impl Fn(f64, f64) -> f64) -> Lanes {
    let mut values = *a;
    for (value, other) in values.iter_mut().zip(b) {
        *value = combine(*value, *other);
    }
    values
}

/// Scalar plays of given radii after a motion of their command.
#[inline]
fn follow<const K: usize>(outputs: &mut [f64; K], radii: &[f64; K], to: f64) {
    for (output, radius) in outputs.iter_mut().zip(radii) {
        *output = between(*output, to - radius, to + radius);
    }
}

/// A value within limits; `f64::clamp` may panic, and `max` and `min` take care of NaN, which is slower.
#[inline]
fn between(value: f64, least: f64, most: f64) -> f64 {
    let raised = if value < least { least } else { value };
    if raised > most { most } else { raised }
}

/// Contribution of the bent plays of a DOF whose own plays slide along `direction` to a command `to`.
#[inline]
pub fn bent(row: &Row, to: f64, direction: f64) -> f64 {
    let side = sign(direction);
    let mut above = [0.0; BENT];
    let plays = above
        .chunks_exact_mut(KNOTS.len())
        .zip(OWN_RADII.iter().step_by(2));
    for (above, radius) in plays {
        for (above, knot) in above.iter_mut().zip(KNOTS) {
            let height = to - (radius * side + knot);
            *above = if height > 0.0 { height } else { 0.0 };
        }
    }
    let (_, weights) = row.split_at(SHARED + OWN);
    product(weights, &above)
}

/// Row whose product with the coefficients is the gain of a DOF: all plays, and of the bent ones their mean slope from -1 to 1.
pub const GAIN_ROW: Row = {
    let [a, b, c] = KNOTS;
    row_of(1.0, [above(a), above(b), above(c)], 0.0)
};
/// Row whose product with the coefficients is the tip in the middle of the slack about the origin: offset, and of the bent
/// plays the mean from -1 to 1.
pub const MIDDLE_ROW: Row = {
    let [a, b, c] = KNOTS;
    let [a, b, c] = [above(a), above(b), above(c)];
    row_of(0.0, [a * a, b * b, c * c], 1.0)
};

/// Share of the range from -1 to 1 above a knot.
const fn above(knot: f64) -> f64 {
    (1.0 - knot) / 2.0
}

/// The same of each play, by the knot of each bent play, and of the offset.
const fn row_of(play: f64, bent: [f64; KNOTS.len()], offset: f64) -> Row {
    let mut row = [play; COEFFICIENTS];
    let (_, mut rest) = row.split_at_mut(SHARED + OWN);
    while let [a, b, c, others @ ..] = rest {
        [*a, *b, *c] = bent;
        rest = others;
    }
    if let [last] = rest {
        *last = offset;
    }
    row
}

/// Regressors times coefficients, as far as both go.
#[inline]
pub fn product(a: &[f64], b: &[f64]) -> f64 {
    let count = a.len().min(b.len());
    let (a, b) = (a.split_at(count).0, b.split_at(count).0);
    // Four sums at once: one alone waits for each addition.
    let mut sums = [0.0; 4];
    let (a, b) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a
        .remainder()
        .iter()
        .zip(b.remainder())
        .map(|(a, b)| a * b)
        .sum();
    for (a, b) in a.zip(b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    let [p, q, r, s] = sums;
    (p + q) + (r + s) + rest
}

/// -1, 0 or 1.
pub fn sign(value: f64) -> f64 {
    if value == 0.0 { 0.0 } else { value.signum() }
}
