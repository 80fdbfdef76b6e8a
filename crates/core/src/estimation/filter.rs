//! The estimate of profile `best`: tip and hysteresis from the commands and the images.

use crate::article::play::Play;
use crate::dof::PerDof;
use crate::error::{ConfigError, require, require_non_negative, require_positive};
use crate::estimation::centre_map::CentreMap;
use crate::estimation::ensemble::{Ensemble, STATE, State, geometry, hysteresis, lag, position};
use crate::estimation::gain::GainEstimate;
use crate::estimation::history::{Entry, History};
use crate::estimation::nominal::Nominal;
use crate::estimation::path::straight_pieces;
use crate::estimation::posture::Belief;
use crate::estimation::settings::StateEstimationSettings;
use crate::math::linear::{dot, solve_symmetric};
use crate::model::features::GEOMETRY;
use crate::model::hysteresis::{Hysteresis, PlayPosition};

/// Initial half width of a slack of unknown width, and its bounds, in half of `width_limit`.
const USUAL_WIDTH: f64 = 2.0 / 3.0;
const LEAST_WIDTH: f64 = 0.02;
const LARGEST_WIDTH: f64 = 1.2;
/// Initial share of the friction that insertion and rotation have in common.
const USUAL_SHARE: f64 = 0.7;
/// Distance of the nodes of the centre's map over the position, in half of `width_limit`.
const MAP_SPACING: f64 = 0.7;

/// Ensemble filter over tip and hysteresis.
///
/// Each member has the outputs of the plays, half widths, centres, the share of the friction that insertion and rotation have
/// in common, how far the tip lags behind the plays, and by how much the geometry differs from the configured one. Between
/// images each is propagated by the exact plays along the commands; the travel of the reference adds a random walk. The
/// image of a time updates the members at that time. The mean, propagated to now, is the prediction that the compensation
/// uses. What else of camera and instrument is not as configured is an error of the feature model, which adapts to the
/// misfit of the markers: an image is not refused for it.
///
/// Wrong where an instrument is no play: by the rounding of its loop.
#[derive(Debug, Clone, PartialEq)]
pub struct Filter {
    pub(super) settings: StateEstimationSettings,
    /// Unit of lengths and travels (3,): half of `width_limit` [m, rad, rad].
    pub(super) unit: PerDof<f64>,
    pub(super) start_std: PerDof<f64>,
    pub(super) start_plays: PerDof<Play>,
    pub(super) radius: f64,
    pub(super) ensemble: Ensemble,
    /// Standard deviation of the feature model in px.
    pub(super) model_std: f64,
    pub(super) maps: PerDof<CentreMap>,
    pub(super) gain: PerDof<GainEstimate>,
    /// Plays with the mean's half widths that no image corrects, about centres of 0.
    pub(super) uncorrected: PlayPosition,
    /// First reference; None before it.
    pub(super) origin: Option<PerDof<f64>>,
    /// Time, command, reference of the ensemble, and the travel of the reference since the last update.
    pub(super) time: f64,
    pub(super) command: PerDof<f64>,
    pub(super) reference: PerDof<f64>,
    pub(super) travel: PerDof<f64>,
    /// Velocity of the mean output with its lag at that time (3,).
    pub(super) velocity: PerDof<f64>,
    pub(super) nominal: Nominal,
}

impl Filter {
    /// The filter before the first reference, for half widths of at most `unit` (3,) and a shaft of a radius in m.
    ///
    /// # Errors
    /// A setting is out of range.
    pub fn new(
        settings: StateEstimationSettings,
        unit: PerDof<f64>,
        start_std: PerDof<f64>,
        start_plays: PerDof<Play>,
        radius: f64,
    ) -> Result<Self, ConfigError> {
        for (field, value) in [
            ("marker_deviation", settings.marker_deviation),
            ("tip_deviation", settings.tip_deviation),
            ("width_deviation", settings.width_deviation),
            ("gain_window", settings.gain_window),
            ("gain_prior", settings.gain_prior),
            ("diameter", radius),
        ] {
            require_positive(field, value)?;
        }
        for (field, value) in [
            ("model_deviation", settings.model_deviation),
            ("shape_deviation", settings.shape_deviation),
            ("image_deviation", settings.image_deviation),
            ("centre_deviation", settings.centre_deviation),
            ("share_deviation", settings.share_deviation),
            ("lag_deviation", settings.lag_deviation),
            ("tip_walk", settings.tip_walk),
            ("width_walk", settings.width_walk),
            ("centre_walk", settings.centre_walk),
            ("share_walk", settings.share_walk),
        ] {
            require_non_negative(field, value)?;
        }
        for rate in settings.map_rate {
            require_non_negative("map_rate", rate)?;
        }
        for value in unit {
            require_positive("width_limit", value)?;
        }
        for value in start_std {
            require_positive("start_deviation", value)?;
        }
        let outlier = settings.outlier_distance;
        require(outlier > 0.0, "outlier_distance", outlier, "above 0")?;
        let blank = PlayPosition::at([f64::NAN; 3]);
        let zero = [0.0; STATE];
        Ok(Self {
            settings,
            unit,
            start_std,
            start_plays,
            radius,
            ensemble: Ensemble::new(&zero, &zero, 0),
            model_std: settings.model_deviation,
            maps: unit.map(|unit| CentreMap::new(0.0, unit)),
            gain: [GainEstimate::new(); 3],
            uncorrected: blank,
            origin: None,
            time: f64::NEG_INFINITY,
            command: [f64::NAN; 3],
            reference: [f64::NAN; 3],
            travel: [0.0; 3],
            velocity: [0.0; 3],
            nominal: Nominal {
                hysteresis: Hysteresis {
                    half_width: start_plays.map(|play| play.width() / 2.0),
                    centre: start_plays
                        .map(|play| f64::midpoint(play.delta_minus(), play.delta_plus())),
                    shared: USUAL_SHARE,
                },
                position: blank,
                width_std: [0.0; 3],
                gain: [1.0; 3],
                origin: [f64::NAN; 3],
                lag: [settings.lag_deviation; 3],
                velocity: [0.0; 3],
            },
        })
    }

    /// Standard deviation of the tip at the start (3,) [m, rad, rad].
    pub const fn start_std(&self) -> PerDof<f64> {
        self.start_std
    }

    /// The prediction now.
    pub const fn nominal(&self) -> &Nominal {
        &self.nominal
    }

    /// The estimated play of each DOF that moves alone.
    pub fn plays(&self) -> PerDof<Play> {
        let offsets = self.nominal.hysteresis.offsets();
        offsets.map(|(minus, plus)| Play::from_ordered(minus, plus))
    }

    /// Radius of the shaft in m.
    pub const fn radius(&self) -> f64 {
        self.radius
    }

    /// Begins at the first reference and command (3,) [m, rad, rad], about which the tip is known to `start_deviation`.
    pub fn start(&mut self, reference: PerDof<f64>, command: PerDof<f64>) {
        let [u1, u2, u3] = reference;
        let mut half = self.unit;
        let mut centre = [0.0; 3];
        for ((half, centre), play) in half.iter_mut().zip(&mut centre).zip(self.start_plays) {
            *half = if play.width() > 0.0 {
                play.width() / 2.0
            } else {
                USUAL_WIDTH * *half
            };
            *centre = f64::midpoint(play.delta_minus(), play.delta_plus());
        }
        let [h1, h2, h3] = half;
        let [l1, l2, l3] = half.map(libm::log);
        let [m1, m2, m3] = centre;
        let [d1, d2, d3] = self.start_std;
        let spread = self.settings.width_deviation;
        let offset = self.settings.centre_deviation;
        let lag = self.settings.lag_deviation;
        let mean: State = [
            u1,
            u2,
            u3,
            u1,
            u2,
            l1,
            l2,
            l3,
            m1,
            m2,
            m3,
            USUAL_SHARE,
            lag,
            lag,
            lag,
            0.0,
            0.0,
            0.0,
        ];
        let std: State = [
            d1,
            d2,
            d3,
            d1,
            d2,
            spread,
            spread,
            spread,
            offset * h1,
            offset * h2,
            offset * h3,
            self.settings.share_deviation,
            lag,
            lag,
            lag,
            self.settings.shape_deviation,
            self.settings.image_deviation,
            self.settings.image_deviation,
        ];
        self.ensemble = Ensemble::new(&mean, &std, 1);
        for ((map, middle), unit) in self.maps.iter_mut().zip(reference).zip(self.unit) {
            *map = CentreMap::new(middle, MAP_SPACING * unit);
        }
        self.origin = Some(reference);
        (self.command, self.reference) = (command, reference);
        self.uncorrected = PlayPosition::at(reference);
        self.nominal.origin = reference;
        self.settle();
    }

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
            ..self.nominal
        };
        nominal.follow(before, after, to.time - self.time);
        self.velocity = nominal.velocity;
        self.time = to.time;
    }

    /// Propagates the ensemble along commands with their references, from the last ones on.
    pub fn follow(&mut self, path: impl Iterator<Item = (PerDof<f64>, PerDof<f64>)> + Clone) {
        let commands = path.clone().map(|(command, _)| command);
        let commands = straight_pieces(commands, self.command, self.unit);
        self.ensemble
            .propagate(&self.maps, self.radius, self.command, &commands);
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

    /// Mean and standard deviations of the tip at a tick of the history.
    pub fn predict<S: AsRef<[Entry]> + AsMut<[Entry]>>(
        &self,
        history: &History<S>,
        to: &Entry,
    ) -> Belief {
        let mut ahead = self.clone();
        ahead.advance(history, to);
        ahead.belief()
    }

    /// Mean and standard deviations of the tip of the ensemble.
    pub fn belief(&self) -> Belief {
        let ([q1, q2, q3], [[v1, _, _], [_, v2, _], [_, _, v3]]) = self.tips();
        Belief {
            state: [q1, q2, q3],
            deviation: [v1, v2, v3].map(libm::sqrt),
        }
    }

    /// Mean and covariance of the tip, with its deviation from the plays.
    pub(super) fn tips(&self) -> ([f64; 3], [[f64; 3]; 3]) {
        let nominal = Nominal {
            velocity: self.velocity,
            ..self.nominal
        };
        let (mean, [[v1, a, b], [c, v2, d], [e, f, v3]]) = self
            .ensemble
            .covariance(|state| nominal.lagging_tip(position(state).output, lag(state)));
        let [d1, d2, d3] = self.deviation();
        let covariance = [
            [v1 + d1 * d1, a, b],
            [c, v2 + d2 * d2, d],
            [e, f, v3 + d3 * d3],
        ];
        (mean, covariance)
    }

    /// Mean and covariance of the geometry.
    pub fn geometry(&self) -> ([f64; GEOMETRY], [[f64; GEOMETRY]; GEOMETRY]) {
        self.ensemble.covariance(geometry)
    }

    /// Mean of the geometry, and its covariance where the output of the plays is known: G - X' P^-1 X with the covariances G
    /// of the geometry, P of the output and X of both.
    pub(super) fn geometry_of_a_known_output(
        &self,
    ) -> ([f64; GEOMETRY], [[f64; GEOMETRY]; GEOMETRY]) {
        let joint = |state: &State| {
            let ([a, b, c], [d, e, f]) = (position(state).output, geometry(state));
            [a, b, c, d, e, f]
        };
        let ([_, _, _, d, e, f], [a1, a2, a3, d1, e1, f1]) = self.ensemble.covariance(joint);
        let split = |[x1, x2, x3, g1, g2, g3]: [f64; 6]| ([x1, x2, x3], [g1, g2, g3]);
        let outputs = [a1, a2, a3].map(|row| split(row).0);
        let (crosses, mut own) = (
            [d1, e1, f1].map(|row| split(row).0),
            [d1, e1, f1].map(|row| split(row).1),
        );
        for (row, cross) in own.iter_mut().zip(crosses) {
            let Some(solved) = solve_symmetric(outputs, cross) else {
                continue;
            };
            for (entry, other) in row.iter_mut().zip(crosses) {
                *entry -= dot(solved, other);
            }
        }
        ([d, e, f], own)
    }

    /// Standard deviation of the tip from that of the plays (3,) [m, rad, rad].
    pub(super) fn deviation(&self) -> PerDof<f64> {
        self.unit.map(|unit| self.settings.tip_deviation * unit)
    }

    /// Moves every member to where its plays allow it, and takes the mean.
    pub(super) fn settle(&mut self) {
        let largest = self.unit.map(|unit| LARGEST_WIDTH * unit);
        self.ensemble
            .limit(self.unit.map(|unit| LEAST_WIDTH * unit), largest);
        let here = core::iter::once(self.command);
        self.ensemble
            .propagate(&self.maps, self.radius, self.command, &here);
        let mean = self.ensemble.mean();
        let at = position(&mean);
        let (_, [[v1, _, _], [_, v2, _], [_, _, v3]]) = self
            .ensemble
            .covariance(|[_, _, _, _, _, h1, h2, h3, ..]| [*h1, *h2, *h3]);
        let nominal = &mut self.nominal;
        nominal.width_std = [v1, v2, v3].map(libm::sqrt);
        nominal.hysteresis = hysteresis(&mean, &self.maps, at.output);
        nominal.lag = lag(&mean);
        nominal.position =
            nominal
                .hysteresis
                .propagate(self.radius, &at, self.command, self.command);
    }

    /// Propagates the prediction from the time of the ensemble to now.
    pub(super) fn catch_up<S: AsRef<[Entry]> + AsMut<[Entry]>>(&mut self, history: &History<S>) {
        let (mut from, mut time) = (self.command, self.time);
        self.nominal.velocity = self.velocity;
        for entry in history.since(self.time) {
            self.step(from, entry.command, entry.time - time);
            (from, time) = (entry.command, entry.time);
        }
    }

    /// Centre of the contact offsets (3,) at outputs of the plays (3,) [m, rad, rad].
    pub fn centre(&self, output: PerDof<f64>) -> PerDof<f64> {
        let mut centre = self.nominal.hysteresis.centre;
        let at = self.nominal.position.output.into_iter().zip(output);
        for ((centre, map), (here, there)) in centre.iter_mut().zip(&self.maps).zip(at) {
            *centre += map.at(there) - map.at(here);
        }
        centre
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
