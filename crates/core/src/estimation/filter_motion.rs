//! Propagation of the filter along commands.

use crate::dof::PerDof;
use crate::estimation::ensemble::{STATE, position};
use crate::estimation::filter::Filter;
use crate::estimation::history::{Entry, History};
use crate::estimation::nominal::Nominal;
use crate::estimation::path::straight_pieces;
use crate::model::hysteresis::Hysteresis;

impl Filter {
    /// Follows the command of a control tick [m, rad, rad] with the prediction.
    pub fn step(&mut self, from: PerDof<f64>, to: PerDof<f64>, time: f64) {
        let nominal = &mut self.nominal;
        let before = nominal.position.output;
        nominal.position = nominal
            .hysteresis
            .propagate(self.radius, &nominal.position, from, to);
        nominal.follow(before, nominal.position.output, time);
    }

    /// Propagates the ensemble along the control ticks to a tick of the history, unless that is past already.
    ///
    /// In steps of at most a quarter of the history, so that a prediction does not depend on whether the ensemble has been
    /// propagated over a part of the way before.
    pub fn advance<S: AsRef<[Entry]> + AsMut<[Entry]>>(
        &mut self,
        history: &History<S>,
        to: &Entry,
    ) {
        while let Some(part) = self.next_step(history)
            && part.time > self.time
            && part.time < to.time
        {
            self.advance_once(history, &part);
        }
        self.advance_once(history, to);
    }

    /// The tick a quarter of the history after the time of the ensemble; None if the history does not have it.
    pub fn next_step<S: AsRef<[Entry]> + AsMut<[Entry]>>(
        &self,
        history: &History<S>,
    ) -> Option<Entry> {
        history.at(self.time + history.span() / 4.0)
    }

    fn advance_once<S: AsRef<[Entry]> + AsMut<[Entry]>>(
        &mut self,
        history: &History<S>,
        to: &Entry,
    ) {
        if self.origin.is_none() || to.time <= self.time {
            return;
        }
        let path = history
            .since(self.time)
            .filter(|entry| entry.time < to.time);
        let path = path.chain(core::iter::once(to));
        let before = position(&self.ensemble.mean()).output;
        self.follow(path.map(|entry| (entry.command, entry.reference)));
        let after = position(&self.ensemble.mean()).output;
        let mut nominal = Nominal {
            velocity: self.velocity,
            residual: self.residual,
            ..self.nominal
        };
        nominal.follow(before, after, to.time - self.time);
        (self.velocity, self.residual) = (nominal.velocity, nominal.residual);
        self.time = to.time;
    }

    /// Propagates the ensemble along commands with their references, from the last ones on.
    pub fn follow(&mut self, path: impl Iterator<Item = (PerDof<f64>, PerDof<f64>)> + Clone) {
        let commands = path.clone().map(|(command, _)| command);
        let commands = straight_pieces(commands, self.command, self.unit);
        self.ensemble
            .propagate(&self.maps, self.radius, self.command, commands);
        let mut walked = [0.0; 3];
        // A centre that varies with the position looks like a gain.
        let plays = Hysteresis {
            centre: [0.0; 3],
            ..self.nominal.hysteresis
        };
        for (command, reference) in path {
            self.uncorrected =
                plays.propagate(self.radius, &self.uncorrected, self.command, command);
            let steps = reference.into_iter().zip(self.reference).zip(self.unit);
            for (walked, ((reference, last), unit)) in walked.iter_mut().zip(steps) {
                *walked += ((reference - last) / unit).abs();
            }
            (self.command, self.reference) = (command, reference);
        }
        for (travel, walked) in self.travel.iter_mut().zip(walked) {
            *travel += walked;
        }
        self.walk(walked);
    }

    /// Random walks over a travel of the reference (3,): standard deviations grow with its square root.
    fn walk(&mut self, [t1, t2, t3]: PerDof<f64>) {
        let (shaft, bending) = (libm::sqrt(libm::sqrt(t1 * t1 + t2 * t2)), libm::sqrt(t3));
        if shaft + bending == 0.0 {
            return;
        }
        let settings = &self.settings;
        let [h1, h2, h3] = self.nominal.hysteresis.half_width;
        let tip = settings.tip_walk;
        self.ensemble
            .disturb_position([tip * shaft * h1, tip * shaft * h2, tip * bending * h3]);
        let (width, centre) = (settings.width_walk, settings.centre_walk);
        let mut std = [0.0; STATE];
        let [_, _, _, _, _, w1, w2, w3, c1, c2, c3, share, ..] = &mut std;
        let own = [t1, t2, t3].map(libm::sqrt);
        [*w1, *w2, *w3] = own.map(|travel| width * travel);
        let [r1, r2, r3] = own.map(|travel| centre * travel);
        (*c1, *c2, *c3) = (r1 * h1, r2 * h2, r3 * h3);
        *share = settings.share_walk * shaft;
        self.ensemble.add_noise(&std);
    }

    /// Propagates the prediction from the time of the ensemble to now.
    pub(super) fn catch_up<S: AsRef<[Entry]> + AsMut<[Entry]>>(&mut self, history: &History<S>) {
        let (mut from, mut time) = (self.command, self.time);
        (self.nominal.velocity, self.nominal.residual) = (self.velocity, self.residual);
        for entry in history.since(self.time) {
            self.step(from, entry.command, entry.time - time);
            (from, time) = (entry.command, entry.time);
        }
    }

    /// The time to which the ensemble has been propagated, in s.
    pub const fn time(&self) -> f64 {
        self.time
    }

    /// Continues on a clock that was set back.
    pub const fn restart_clock(&mut self) {
        self.time = f64::NEG_INFINITY;
    }
}
