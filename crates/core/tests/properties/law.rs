//! Guarantees of the law of profile `best`, for any number of DOFs and any estimate.

use crate::article::play_limit::PlayLimit;
use crate::dof::Friction;
use crate::law::direction::Direction;
use crate::law::settings::LawSettings;
use crate::law::vector_law::{ACCELERATION, Bounds, VectorLaw};
use crate::model::plays::{COEFFICIENTS, OFFSET, OWN, Plays, Row, SHARED, Transmission, product};

use super::guarantees::Random;
use super::support::{safety, settings};

const PERIOD: f64 = 0.005;
/// Excess that the law's search in a few steps may leave of the bound of the predicted tip.
const SEARCH: f64 = 0.01;

/// A law whose bounds are checked at every tick.
struct Checked<const N: usize> {
    law: VectorLaw<N>,
    transmission: Transmission<N>,
    bounds: Bounds<N>,
    settings: LawSettings,
    reference: [f64; N],
    share: f64,
    rows: [Row; N],
    /// |dc| - |du| of each group per tick when it moved last, 0 or above, and the ticks since.
    surplus: [f64; N],
    rested: [f64; N],
    /// Largest speed of the predicted tip over its bound.
    fastest: f64,
    /// Ticks in which a command moved otherwise than the reference.
    compensated: u32,
}

/// Coefficients of any tip: a gain about 1, of plays some of which count negatively.
fn row(random: &mut Random) -> Row {
    let mut row = [0.0; COEFFICIENTS];
    for weight in row.iter_mut().take(SHARED + OWN) {
        *weight = random.within(-0.05, 0.2);
    }
    let sum: f64 = row.iter().sum();
    let gain = random.within(0.6, 1.4);
    for weight in &mut row {
        *weight *= gain / sum;
    }
    for weight in row.iter_mut().take(OFFSET).skip(SHARED + OWN) {
        *weight = random.within(-0.03, 0.03);
    }
    row[OFFSET] = random.within(-0.5, 0.5);
    row
}

impl<const N: usize> Checked<N> {
    fn new(group: [usize; N], gain: f64, random: &mut Random) -> Self {
        let sizes = |random: &mut Random, low, high| {
            core::array::from_fn::<_, N, _>(|_| random.within(low, high))
        };
        let friction = Friction::new(group, sizes(random, 0.5, 2.0)).unwrap();
        let unit = sizes(random, 0.01, 1.0);
        let transmission = Transmission::new(friction, unit).unwrap();
        // So that the coefficients in use are always the given ones.
        let settings = LawSettings {
            free_gain: gain,
            change_rate: f64::MAX,
            ..settings(&safety()).law
        };
        let bounds = Bounds {
            width_limit: unit.map(|unit| unit * random.within(1.0, 3.0)),
            speed: unit.map(|unit| unit * random.within(0.05, 0.2) / PERIOD),
            period: PERIOD,
            input_age: 0.05,
            offsets: unit.map(|unit| PlayLimit::new(2.0 * unit, 1.5 * unit).unwrap()),
        };
        let mut checked = Self {
            law: VectorLaw::new(settings, transmission, &bounds).unwrap(),
            transmission,
            bounds,
            settings,
            reference: [0.0; N],
            share: 1.0,
            rows: [[0.0; COEFFICIENTS]; N],
            surplus: [0.0; N],
            rested: [0.0; N],
            fastest: 0.0,
            compensated: 0,
        };
        checked.change_estimate(random);
        let command = checked.law.propose([0.0; N], &checked.rows, 1.0);
        assert_eq!(command, [0.0; N], "the first reference is passed through");
        checked.law.commit(command);
        checked
    }

    fn change_estimate(&mut self, random: &mut Random) {
        for row in &mut self.rows {
            *row = self::row(random);
        }
    }

    /// Product over the DOFs of a group, in their `width_limit`.
    fn dot(&self, members: [bool; N], a: [f64; N], b: [f64; N]) -> f64 {
        let width = self.bounds.width_limit;
        let parts = (0..N).filter(|dof| members[*dof]);
        parts
            .map(|dof| a[dof] / width[dof] * (b[dof] / width[dof]))
            .sum()
    }

    /// Tip that the given coefficients predict.
    fn tip(&self, plays: &Plays<N>) -> [f64; N] {
        let (unit, phi) = (self.transmission.unit(), plays.regressors());
        core::array::from_fn(|dof| unit[dof] * product(&phi[dof], &self.rows[dof]))
    }

    /// A tick in which `part` of the command's motion is sent.
    fn step(&mut self, reference: [f64; N], part: f64) {
        let (before, tip) = (self.law.command, self.tip(&self.law.plays));
        let proposed = self.law.propose(reference, &self.rows, 1.0);
        assert_eq!(self.law.command, before, "a proposal moves nothing");
        if !reference.iter().all(|value| value.is_finite()) {
            assert_eq!(proposed, before);
            return;
        }
        let last = core::mem::replace(&mut self.reference, reference);
        let sent = if part < 1.0 {
            core::array::from_fn(|dof| before[dof] + part * (proposed[dof] - before[dof]))
        } else {
            proposed
        };
        self.law.commit(sent);
        assert_eq!(self.law.command, sent);
        for group in 0..N {
            self.check_group(group, last, before, proposed);
            if part >= 1.0 && self.share >= 1.0 {
                self.check_tip(group, last, tip);
            }
        }
        for dof in 0..N {
            let (dc, du) = (proposed[dof] - before[dof], reference[dof] - last[dof]);
            let step = self.bounds.speed[dof] * PERIOD;
            // A share of the compensation leaves the reference's own motion.
            let most = if self.share < 1.0 {
                step.max(du.abs() * (1.0 + 1e-9))
            } else {
                step
            };
            let has_gain = self.settings.free_gain > 1.0;
            let rounding = 4.0 * f64::EPSILON * before[dof].abs();
            assert!(
                !has_gain || dc.abs() <= most + rounding,
                "{dc} for {du}, at most {most}"
            );
            self.compensated += u32::from((dc - du).abs() > 1e-9);
        }
    }

    fn check_group(&mut self, group: usize, last: [f64; N], before: [f64; N], after: [f64; N]) {
        self.rested[group] += 1.0;
        let rested = self.rested[group];
        let members = self.transmission.friction().members(group);
        let own = || (0..N).filter(|dof| members[*dof]);
        let minus = |a: [f64; N], b: [f64; N]| core::array::from_fn(|dof| a[dof] - b[dof]);
        let (dc, du): ([f64; N], [f64; N]) = (minus(after, before), minus(self.reference, last));
        let norm = |a: [f64; N]| self.dot(members, a, a).sqrt();
        if own().all(|dof| du[dof] == 0.0) {
            assert!(own().all(|dof| after[dof].to_bits() == before[dof].to_bits()));
            return;
        }
        let gain = self.settings.free_gain;
        let scale = [before, after, self.reference, last]
            .into_iter()
            .fold(0.0_f64, |most, x| most.max(norm(x)));
        let rounding = 8.0 * f64::EPSILON * scale;
        let facts = format!("group {group}: {dc:?} for {du:?}");
        assert!(
            norm(dc) <= gain * norm(du) * (1.0 + 1e-12) + rounding,
            "{facts}"
        );
        let is_moving = rested * PERIOD <= self.bounds.input_age;
        let ticks = if is_moving { rested } else { 1.0 };
        let surplus = norm(dc) - norm(du);
        if self.share >= 1.0 {
            let most = ticks * (self.surplus[group] + ticks * ACCELERATION * PERIOD * PERIOD);
            assert!(surplus <= most + rounding, "{facts}: {surplus} {most}");
        }
        let product = self.dot(members, dc, du);
        assert!(product >= -rounding * norm(du), "{facts}: {product}");
        if gain <= 1.0 {
            assert!(norm(minus(dc, du)) <= rounding, "{facts}");
        }
        if own().count() == 1 {
            for dof in own() {
                let farthest = before[dof] + gain * du[dof];
                let within = before[dof].min(farthest)..=before[dof].max(farthest);
                assert!(within.contains(&after[dof]), "{facts}");
            }
        }
        self.rested[group] = 0.0;
        self.surplus[group] = if self.share >= 1.0 {
            surplus.max(0.0) / ticks
        } else {
            f64::INFINITY
        };
    }

    /// |dq| <= `tip_gain` |du|, and q does not pass u.
    fn check_tip(&mut self, group: usize, last: [f64; N], before: [f64; N]) {
        let members = self.transmission.friction().members(group);
        let after = self.tip(&self.law.plays);
        let minus = |a: [f64; N], b: [f64; N]| core::array::from_fn(|dof| a[dof] - b[dof]);
        let (dq, du) = (minus(after, before), minus(self.reference, last));
        let moved = self.dot(members, du, du).sqrt();
        // Below this, rounding counts; without gain the command is the reference.
        let has_gain = self.settings.free_gain > 1.0;
        if moved < 1e-6 || !has_gain {
            return;
        }
        let speed = self.dot(members, dq, dq).sqrt() / (self.settings.tip_gain * moved);
        let room = self.dot(members, minus(self.reference, before), du) / moved;
        let passed = self.dot(members, dq, du) / (moved * moved.max(room));
        self.fastest = self.fastest.max(speed.max(passed));
    }
}

fn walk<const N: usize>(group: [usize; N], gain: f64, seed: u64) {
    let mut random = Random(seed);
    let mut checked = Checked::new(group, gain, &mut random);
    let unit = checked.transmission.unit();
    let mut speed = [0.0; N];
    for _ in 0..1000 {
        let command = checked.law.command;
        match random.below(100) {
            0 | 1 => checked.change_estimate(&mut random),
            2 => {
                checked.share = [0.0, 1.0, 0.3][usize::try_from(random.below(3)).unwrap()];
                checked.law.share = checked.share;
            }
            3 => {
                let shift = unit.map(|unit| unit * random.within(-0.2, 0.2));
                checked.law.shift_reference(shift);
                for (reference, shift) in checked.reference.iter_mut().zip(shift) {
                    *reference += shift;
                }
            }
            4 => {
                let mut reference = checked.reference;
                reference[N - 1] = f64::NAN;
                checked.step(reference, 1.0);
            }
            5..15 => {
                let dof = usize::try_from(random.below(N as u64)).unwrap();
                speed[dof] = if random.below(3) == 0 {
                    0.0
                } else {
                    0.02 * unit[dof] * random.within(-1.0, 1.0)
                };
            }
            _ => {
                let mut reference = checked.reference;
                let jump = random.below(50) == 0;
                for (dof, value) in reference.iter_mut().enumerate() {
                    let mut next = *value + speed[dof];
                    if jump {
                        next += random.within(-0.1, 0.1) * unit[dof];
                    }
                    if next.abs() > 4.0 * unit[dof] {
                        speed[dof] = -speed[dof];
                    } else {
                        *value = next;
                    }
                }
                let part = if random.below(10) == 0 {
                    random.within(0.0, 1.0)
                } else {
                    1.0
                };
                checked.step(reference, part);
                continue;
            }
        }
        assert_eq!(
            checked.law.command, command,
            "only the reference moves a command"
        );
    }
    println!(
        "{group:?} {gain:?}: predicted tip at {} of its bound",
        checked.fastest
    );
    assert!(checked.fastest <= 1.0 + SEARCH, "{}", checked.fastest);
    let has_gain = gain > 1.0;
    assert!(
        !has_gain || checked.compensated > 200,
        "{}",
        checked.compensated
    );
}

#[test]
fn one_dof() {
    for (seed, gain) in [(1, 5.0), (2, 2.0), (3, 1.0), (4, 20.0)] {
        walk([0], gain, seed);
    }
}

#[test]
fn two_dofs_that_share_a_friction() {
    for (seed, gain) in [(1, 5.0), (2, 2.0), (3, 1.0), (4, 20.0)] {
        walk([1, 1], gain, seed);
    }
}

#[test]
fn three_dofs_of_the_instrument() {
    for (seed, gain) in [(1, 5.0), (2, 3.0), (3, 20.0)] {
        walk([0, 0, 2], gain, seed);
    }
}

#[test]
fn eight_dofs() {
    walk([0, 1, 1, 3, 0, 0, 7, 5], 5.0, 1);
    walk([0, 1, 2, 3, 4, 5, 6, 7], 20.0, 2);
}

/// With a play of one radius whose coefficient changes at once: the tip that the law predicts, and so its command, follow as
/// far as the reference travels.
#[test]
fn coefficients_in_use_change_no_faster_than_their_rate() {
    let own = settings(&safety()).law;
    let transmission = Transmission::new(Friction::independent(), [1.0]).unwrap();
    let bounds = Bounds {
        width_limit: [10.0],
        speed: [f64::MAX],
        period: PERIOD,
        input_age: 0.05,
        offsets: [PlayLimit::new(10.0, 10.0).unwrap()],
    };
    let mut law = VectorLaw::new(own, transmission, &bounds).unwrap();
    let mut rows = [[0.0; COEFFICIENTS]; 1];
    // The own play of radius 0: the tip is the command.
    rows[0][SHARED] = 1.0;
    let step = |law: &mut VectorLaw<1>, rows: &[Row; 1], reference: f64, ratio: f64| {
        let command = law.propose([reference], rows, ratio);
        law.commit(command);
        command[0] - reference
    };
    let (mut reference, travel) = (0.0, 0.01);
    step(&mut law, &rows, reference, 1.0);
    // At the start the rate is higher; after 100 units it is by less than 0.5 %.
    for _ in 0..10_000 {
        reference += travel;
        step(&mut law, &rows, reference, 1.0);
    }
    for (offset, ratio) in [(0.5, 1.0), (0.0, 2.0)] {
        rows[0][OFFSET] = offset;
        let rate = 1.005 * own.change_rate / (ratio * ratio);
        let (start, mut ticks) = (law.command[0] - reference, 0);
        loop {
            reference += travel;
            let lead = step(&mut law, &rows, reference, ratio);
            ticks += 1;
            let most = rate * travel * f64::from(ticks);
            assert!((lead - start).abs() <= most, "{lead} {start} {most}");
            if (lead + offset).abs() < 1e-9 {
                break;
            }
            assert!(ticks < 50_000, "{lead}");
        }
        let least = 0.5 / (rate * travel);
        assert!(f64::from(ticks) >= least, "{ticks} {least}");
    }
}

/// What coefficients in use change is bounded by the travel, without a reversal, with one, and for two DOFs of one friction on a
/// circle, where each reverses and the direction of both never does; after the first reversal they may follow fast again.
#[test]
fn the_start_ends_and_begins_anew_with_the_first_reversal_of_each_dof() {
    let friction = Friction::new([0, 0], [1.0, 1.0]).unwrap();
    let own = settings(&safety()).law;
    let bounds = Bounds {
        width_limit: [10.0; 2],
        speed: [f64::MAX; 2],
        period: PERIOD,
        input_age: 0.05,
        offsets: [PlayLimit::new(10.0, 10.0).unwrap(); 2],
    };
    // Lead of the first DOF that an estimate makes which is wrong by 0.5 from a tick on, at the end, and the travel since.
    let wrong = |motion: &dyn Fn(f64) -> [f64; 2], since: usize, until: usize| {
        let transmission = Transmission::new(friction, [1.0; 2]).unwrap();
        let mut law = VectorLaw::new(own, transmission, &bounds).unwrap();
        let mut rows = [[0.0; COEFFICIENTS]; 2];
        for row in &mut rows {
            row[SHARED] = 1.0;
        }
        let (mut last, mut travel, mut lead) = (motion(0.0), 0.0, 0.0);
        for tick in 0..until {
            if tick == since {
                (rows[0][OFFSET], travel) = (0.5, 0.0);
            }
            let reference = motion(f64::from(u32::try_from(tick).unwrap()));
            let command = law.propose(reference, &rows, 1.0);
            law.commit(command);
            travel += (reference[0] - last[0]).abs() + (reference[1] - last[1]).abs();
            (last, lead) = (reference, (command[0] - reference[0]).abs());
        }
        (lead, travel)
    };
    let circle = |tick: f64| [(0.01 * tick).cos(), (0.01 * tick).sin()];
    let stroke = |tick: f64| [0.01 * tick, 0.0];
    let turned = |tick: f64| [0.01 * (10_000.0 - (10_000.0 - tick).abs()), 0.0];
    for (motion, since) in [
        (&circle as &dyn Fn(f64) -> [f64; 2], 19_000),
        (&stroke, 19_000),
        (&turned, 19_000),
    ] {
        let (lead, travel) = wrong(motion, since, 20_000);
        assert!(
            lead <= 1.1 * own.change_rate * travel + 0.02,
            "{lead} {travel}"
        );
    }
    let (lead, travel) = wrong(&turned, 10_100, 11_000);
    assert!(lead > 0.4, "{lead} {travel}");
}

/// Compensation that is switched off: the command returns to the reference within a travel of twice the lead.
#[test]
fn without_compensation_the_command_returns_to_the_reference() {
    let mut random = Random(3);
    for group in [[0, 1], [0, 0]] {
        let mut checked = Checked::<2>::new(group, 5.0, &mut random);
        let width = checked.bounds.width_limit;
        let at = |part: f64| [part * width[0], -0.7 * part * width[1]];
        let lead = |checked: &Checked<2>| {
            let lead =
                core::array::from_fn(|dof| checked.law.command[dof] - checked.reference[dof]);
            checked.dot([true; 2], lead, lead).sqrt()
        };
        let mut part = 0.0;
        for _ in 0..2_000 {
            part += 0.001;
            checked.step(at(part), 1.0);
        }
        let mut before = lead(&checked);
        assert!(before > 0.05, "{before}");
        (checked.share, checked.law.share) = (0.0, 0.0);
        // The second moves 0.7 times as far, and its lead may be all of it.
        let most = part + 2.0 * before / 0.7;
        while part < most {
            part += 0.001;
            checked.step(at(part), 1.0);
            assert!(lead(&checked) <= before + 1e-12);
            before = lead(&checked);
        }
        assert!(before < 1e-12, "{before}");
    }
}

/// A device that gives each n-th value of a motion: after a reversal the command gains as much in the same time, and at most as
/// much as the bound of its speed allows; after a longer rest than `input_age` as little as in one tick.
#[test]
fn the_slack_is_crossed_as_fast_with_an_input_device_slower_than_the_loop() {
    let transmission = Transmission::new(Friction::independent(), [1.0]).unwrap();
    let bounds = Bounds {
        width_limit: [1.0],
        speed: [f64::MAX],
        period: PERIOD,
        input_age: 0.05,
        offsets: [PlayLimit::new(10.0, 10.0).unwrap()],
    };
    let mut rows = [[0.0; COEFFICIENTS]; 1];
    // The largest own play, a slack of 2.5: none of these motions crosses it.
    rows[0][SHARED + OWN - 1] = 1.0;
    let growth = ACCELERATION * PERIOD * PERIOD;
    let law = LawSettings {
        free_gain: 20.0,
        ..settings(&safety()).law
    };
    // Motion beyond that of the reference, within 40 ticks after a reversal.
    let gained = |every: usize| {
        let mut law = VectorLaw::new(law, transmission, &bounds).unwrap();
        let (mut reference, mut lead) = (0.0, 0.0);
        for tick in 0..1_040_usize {
            if tick % every == 0 {
                let motion = 0.01 * f64::from(u32::try_from(every).unwrap());
                reference += if tick < 1_000 { motion } else { -motion };
            }
            let command = law.propose([reference], &rows, 1.0);
            law.commit(command);
            if tick < 1_000 {
                lead = command[0] - reference;
            }
        }
        lead - (law.command[0] - reference)
    };
    let fast = gained(1);
    assert!(
        (fast / (growth * 40.0 * 41.0 / 2.0) - 1.0).abs() < 0.1,
        "{fast}"
    );
    for (every, n) in [(2, 2.0), (4, 4.0), (10, 10.0)] {
        let (slow, values) = (gained(every), 40.0 / n);
        let most = n * n * growth * values * (values + 1.0) / 2.0;
        assert!(slow < most * 1.001, "{every}: {slow} {most}");
        assert!(slow > 0.9 * fast, "{every}: {slow} {fast}");
    }
    let rested = gained(20);
    assert!(rested < 4.0 * growth, "{rested}");
}

/// One DOF: 1 - travel / length after a reversal, -1 at most; two of one friction: of length 1 in a steady motion.
#[test]
fn a_reversal_turns_the_direction_within_twice_the_length_of_the_string() {
    let mut alone = Direction::new(Friction::independent(), [2.0], 0.1);
    alone.step([5.0]);
    for (back, expected) in [(0.1, 0.5), (0.1, 0.0), (0.3, -1.0), (-0.1, -0.5)] {
        alone.step([-back]);
        let [found] = alone.value();
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
    let friction = Friction::new([0, 0], [1.0, 0.5]).unwrap();
    let mut shared = Direction::new(friction, [1.0, 1.0], 0.1);
    shared.step([30.0, 80.0]);
    let [first, second] = shared.value();
    assert!((first - 0.6).abs() < 0.01 && (second - 0.8).abs() < 0.01);
}
