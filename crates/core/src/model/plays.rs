//! Plays of fixed radii: the regressors of the tip.

use crate::dof::Friction;
use crate::error::{ConfigError, require_positive};

/// Plays of a DOF that are of its friction group: vector plays where several DOFs share a friction.
pub const SHARED: usize = 12;
/// Plays of a DOF by itself.
pub const OWN: usize = 6;
/// Bent plays: every second own play, bent at each of [`KNOTS`].
pub const BENT: usize = OWN / 2 * KNOTS.len();
/// Coefficients of a DOF: the plays, the bent plays, the offset and the deviation of the tip from all of these.
pub const COEFFICIENTS: usize = SHARED + OWN + BENT + 2;
/// Index of the offset and of the deviation.
pub const OFFSET: usize = COEFFICIENTS - 2;
pub const DEVIATION: usize = COEFFICIENTS - 1;

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
/// Newton steps of the return to the friction ellipse; the motion of a control tick needs two, that to the law's target four.
const STEPS: usize = 4;

/// Regressors of a DOF, or their coefficients.
pub type Row = [f64; COEFFICIENTS];

/// Outputs of the plays of N DOFs, in units of the DOF from the first reference, and the command that they follow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plays<const N: usize> {
    shared: [[f64; SHARED]; N],
    own: [[f64; OWN]; N],
    /// The command.
    pub command: [f64; N],
    /// Travel of the command so far, summed over the DOFs.
    pub travel: f64,
}

impl<const N: usize> Plays<N> {
    /// All plays at rest at the origin.
    pub const REST: Self = Self {
        shared: [[0.0; SHARED]; N],
        own: [[0.0; OWN]; N],
        command: [0.0; N],
        travel: 0.0,
    };

    /// Regressors of each DOF:
    ///
    /// ```text
    /// phi = (shared plays, own plays p, max(p - knot, 0) of every second own play, 1, 1)
    /// ```
    pub fn regressors(&self) -> [Row; N] {
        let mut rows = [[0.0; COEFFICIENTS]; N];
        for (row, (shared, own)) in rows.iter_mut().zip(self.shared.iter().zip(&self.own)) {
            let bent = own
                .iter()
                .step_by(2)
                .flat_map(|play| KNOTS.map(|knot| (play - knot).max(0.0)));
            let values = shared
                .iter()
                .chain(own)
                .copied()
                .chain(bent)
                .chain([1.0, 1.0]);
            row.iter_mut()
                .zip(values)
                .for_each(|(entry, value)| *entry = value);
        }
        rows
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
    unit: [f64; N],
    /// Half widths of the shared plays.
    half: [[f64; SHARED]; N],
    /// Motion of a sliding output by the same force, over that of the first DOF of the group.
    ease: [[f64; SHARED]; N],
    is_alone: [bool; N],
}

impl<const N: usize> Transmission<N> {
    /// For units (N,) of the DOFs [m or rad].
    ///
    /// # Errors
    /// A unit is not a finite number above 0.
    pub fn new(friction: Friction<N>, unit: [f64; N]) -> Result<Self, ConfigError> {
        for value in unit {
            require_positive("expected_width", value)?;
        }
        let (mut half, mut ease) = ([ALONE_RADII; N], [[1.0; SHARED]; N]);
        let mut is_alone = [true; N];
        for group in 0..N {
            let members = friction.members(group);
            if members.iter().filter(|own| **own).count() < 2 {
                continue;
            }
            let mut first = None;
            let dofs = half.iter_mut().zip(&mut ease).zip(&mut is_alone);
            let sizes = unit.into_iter().zip(friction.lever()).zip(members);
            for (((half, ease), is_alone), ((unit, lever), _)) in
                dofs.zip(sizes).filter(|(_, (_, own))| *own)
            {
                *is_alone = false;
                *half = if first.is_none() {
                    VECTOR_RADII
                } else {
                    SIDE_RADII
                };
                let surface = lever * unit;
                let base = *first.get_or_insert(surface);
                for ((ease, half), radius) in ease.iter_mut().zip(*half).zip(VECTOR_RADII) {
                    *ease = base * radius / (surface * half);
                }
            }
        }
        Ok(Self {
            friction,
            unit,
            half,
            ease,
            is_alone,
        })
    }

    /// Whether each DOF shares its friction with none.
    pub const fn is_alone(&self) -> [bool; N] {
        self.is_alone
    }

    /// Units of the DOFs [m or rad].
    pub const fn unit(&self) -> [f64; N] {
        self.unit
    }

    /// Which DOFs share a friction.
    pub const fn friction(&self) -> &Friction<N> {
        &self.friction
    }

    /// Radii of the plays of each DOF, in the order of the regressors.
    pub fn radii(&self) -> [[f64; SHARED + OWN]; N] {
        let mut radii = [[0.0; SHARED + OWN]; N];
        for (radii, half) in radii.iter_mut().zip(self.half) {
            let all = half.into_iter().chain(OWN_RADII);
            radii.iter_mut().zip(all).for_each(|(a, b)| *a = b);
        }
        radii
    }

    /// The plays after a straight motion of the command to `to` (N,), in units.
    #[must_use]
    pub fn advance(&self, plays: &Plays<N>, to: &[f64; N]) -> Plays<N> {
        let mut next = *plays;
        for (play, to) in next.own.iter_mut().zip(to) {
            for (output, radius) in play.iter_mut().zip(OWN_RADII) {
                *output = output.max(to - radius).min(to + radius);
            }
        }
        let alone = next.shared.iter_mut().zip(self.half).zip(self.is_alone);
        for (((play, half), _), to) in alone.zip(to).filter(|((_, is_alone), _)| *is_alone) {
            for (output, radius) in play.iter_mut().zip(half) {
                *output = output.max(to - radius).min(to + radius);
            }
        }
        if !self.is_alone.iter().all(|is_alone| *is_alone) {
            for group in 0..N {
                self.slide(self.friction.members(group), to, &mut next.shared);
            }
        }
        for (command, to) in next.command.iter_mut().zip(to) {
            next.travel += (to - *command).abs();
            *command = *to;
        }
        next
    }

    /// Vector plays of the DOFs of one group.
    fn slide(&self, members: [bool; N], to: &[f64; N], shared: &mut [[f64; SHARED]; N]) {
        let of_group = |index: &usize| {
            let own = members.get(*index).copied().unwrap_or(false);
            own && !self.is_alone.get(*index).copied().unwrap_or(true)
        };
        let mut free = [[0.0; SHARED]; N];
        let (mut square, mut largest) = ([0.0; SHARED], [0.0; SHARED]);
        let mut multiplier = [0.0; SHARED];
        let dofs = (0..N).zip(free.iter_mut().zip(shared.iter()).zip(to));
        let own = self.half.iter().zip(&self.ease);
        for ((_, ((free, play), to)), (half, ease)) in
            dofs.zip(own).filter(|((index, _), _)| of_group(index))
        {
            let bounds = largest.iter_mut().zip(&mut multiplier);
            let sums = square.iter_mut().zip(bounds).zip(ease);
            for (((free, play), half), ((square, (largest, multiplier)), ease)) in
                free.iter_mut().zip(play).zip(half).zip(sums)
            {
                *free = (to - play) / half;
                *square += *free * *free;
                *largest = f64::max(*largest, *ease);
                *multiplier = f64::max(*multiplier, (free.abs() - 1.0) / ease);
            }
        }
        if square.iter().all(|square| *square <= 1.0) {
            return;
        }
        // Newton's method from below the root of sum (free / (1 + ease l))^2 = 1, which is convex in l.
        for ((multiplier, square), largest) in multiplier.iter_mut().zip(square).zip(largest) {
            *multiplier = multiplier.max((libm::sqrt(square) - 1.0) / largest);
        }
        for _ in 0..STEPS {
            let (mut value, mut slope) = ([-1.0; SHARED], [0.0; SHARED]);
            for ((_, free), ease) in (0..N)
                .zip(&free)
                .zip(&self.ease)
                .filter(|((i, _), _)| of_group(i))
            {
                let sums = value.iter_mut().zip(&mut slope).zip(multiplier);
                for ((free, ease), ((value, slope), multiplier)) in free.iter().zip(ease).zip(sums)
                {
                    let part = 1.0 / (1.0 + ease * multiplier);
                    let term = free * free * part * part;
                    *value += term;
                    *slope += ease * term * part;
                }
            }
            for ((multiplier, value), slope) in multiplier.iter_mut().zip(value).zip(slope) {
                *multiplier += value / (2.0 * slope);
            }
        }
        let dofs = (0..N).zip(free.iter().zip(shared.iter_mut()).zip(to));
        let own = self.half.iter().zip(&self.ease);
        for ((_, ((free, play), to)), (half, ease)) in
            dofs.zip(own).filter(|((index, _), _)| of_group(index))
        {
            let sizes = half.iter().zip(ease).zip(square.iter().zip(multiplier));
            for ((free, play), ((half, ease), (square, multiplier))) in
                free.iter().zip(play).zip(sizes)
            {
                let moved = to - half * free / (1.0 + ease * multiplier);
                *play = if *square > 1.0 { moved } else { *play };
            }
        }
    }

    /// Sum of radius times coefficient while the tip slides steadily along `direction` (N,), of which every group has the
    /// length 1 in the motion of its surface, or 0: command less tip over the gain, but for offset and bends.
    pub fn deflection(&self, rows: &[Row; N], direction: &[f64; N]) -> [f64; N] {
        let mut sums = [0.0; N];
        let dofs = sums.iter_mut().zip(rows).zip(&self.half).zip(direction);
        for (((sum, row), half), direction) in dofs {
            let shared: f64 = row.iter().zip(half).map(|(w, h)| w * h).sum();
            let own: f64 = row
                .iter()
                .skip(SHARED)
                .zip(OWN_RADII)
                .map(|(w, r)| w * r)
                .sum();
            *sum = shared * direction + own * sign(*direction);
        }
        sums
    }
}

/// Contribution of the bent plays of a DOF whose own plays slide along `direction` to a command `to`, and its slope.
pub fn bent(row: &Row, to: f64, direction: f64) -> (f64, f64) {
    let radii = OWN_RADII
        .iter()
        .step_by(2)
        .flat_map(|radius| KNOTS.map(|knot| radius * sign(direction) + knot));
    row.iter()
        .skip(SHARED + OWN)
        .zip(radii)
        .fold((0.0, 0.0), |(sum, slope), (w, from)| {
            let above = to - from;
            if above > 0.0 {
                (sum + w * above, slope + w)
            } else {
                (sum, slope)
            }
        })
}

/// Coefficients whose sum is the gain of a DOF: those of all plays, and of the bent ones their mean slope from -1 to 1.
pub fn gain_row() -> Row {
    let slopes = (0..OWN / 2).flat_map(|_| KNOTS.map(|knot: f64| (1.0 - knot) / 2.0));
    let mut row = [0.0; COEFFICIENTS];
    let values = [1.0; SHARED + OWN].into_iter().chain(slopes);
    row.iter_mut().zip(values).for_each(|(a, b)| *a = b);
    row
}

/// Coefficients whose sum is the tip in the middle of the slack about the origin: offset, deviation, and of the bent plays the
/// mean from -1 to 1.
pub fn middle_row() -> Row {
    let means = (0..OWN / 2).flat_map(|_| KNOTS.map(|knot: f64| (1.0 - knot) * (1.0 - knot) / 4.0));
    let mut row = [0.0; COEFFICIENTS];
    let values = means.chain([1.0, 1.0]);
    row.iter_mut()
        .skip(SHARED + OWN)
        .zip(values)
        .for_each(|(a, b)| *a = b);
    row
}

/// Regressors times coefficients.
pub fn product(a: &Row, b: &Row) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// -1, 0 or 1.
pub fn sign(value: f64) -> f64 {
    if value == 0.0 { 0.0 } else { value.signum() }
}
