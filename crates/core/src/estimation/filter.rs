//! The estimate of profile `best`: tip and hysteresis from the commands and the images.

use crate::article::play::Play;
use crate::dof::PerDof;
use crate::error::{ConfigError, require_positive};
use crate::estimation::centre_map::CentreMap;
use crate::estimation::ensemble::{Ensemble, STATE, State, hysteresis, lag, position};
use crate::estimation::nominal::Nominal;
use crate::estimation::settings::StateEstimationSettings;
use crate::estimation::tip_regression::TipRegression;
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
/// in common, and how far the tip lags behind the plays. A regression of the tip on plays that no image corrects has the gains,
/// and by how much the geometry differs from the configured one. Between images each member is propagated by the exact plays
/// along the commands; the travel of the reference adds a random walk. The image of a time updates the members at that time. The
/// mean, propagated to now, is the prediction that the compensation uses; the residual of the tip in the last images is added to
/// it. What else of camera and instrument is not as configured is an error of the feature model, which adapts to the misfit of
/// the markers: an image is not refused for it.
///
/// Wrong where an instrument is no play: by what its loop is rounded and an image does not show in time.
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
    /// Number of images over which its square is averaged; the configured one counts as one.
    pub(super) model_images: f64,
    pub(super) maps: PerDof<CentreMap>,
    pub(super) regression: TipRegression,
    /// Plays with the mean's half widths that no image corrects, about centres of 0.
    pub(super) uncorrected: PlayPosition,
    /// First reference; None before it.
    pub(super) origin: Option<PerDof<f64>>,
    /// Time, command, reference of the ensemble, and the travel of the reference since the last update.
    pub(super) time: f64,
    pub(super) command: PerDof<f64>,
    pub(super) reference: PerDof<f64>,
    pub(super) travel: PerDof<f64>,
    /// Velocity of the mean output with its lag, and residual of the tip, at that time (3,).
    pub(super) velocity: PerDof<f64>,
    pub(super) residual: PerDof<f64>,
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
        settings.check()?;
        require_positive("diameter", radius)?;
        for value in unit {
            require_positive("width_limit", value)?;
        }
        for value in start_std {
            require_positive("start_deviation", value)?;
        }
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
            model_images: 1.0,
            maps: unit.map(|unit| CentreMap::new(0.0, unit)),
            regression: regression(&settings),
            uncorrected: blank,
            origin: None,
            time: f64::NEG_INFINITY,
            command: [f64::NAN; 3],
            reference: [f64::NAN; 3],
            travel: [0.0; 3],
            velocity: [0.0; 3],
            residual: [0.0; 3],
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
                residual: [0.0; 3],
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
        ];
        self.ensemble = Ensemble::new(&mean, &std, 1);
        self.regression = regression(&self.settings);
        for ((map, middle), unit) in self.maps.iter_mut().zip(reference).zip(self.unit) {
            *map = CentreMap::new(middle, MAP_SPACING * unit);
        }
        self.origin = Some(reference);
        (self.command, self.reference) = (command, reference);
        self.uncorrected = PlayPosition::at(reference);
        self.nominal.origin = reference;
        self.settle();
    }

    /// Moves every member to where its plays allow it, and takes the mean.
    pub(super) fn settle(&mut self) {
        let largest = self.unit.map(|unit| LARGEST_WIDTH * unit);
        self.ensemble
            .limit(self.unit.map(|unit| LEAST_WIDTH * unit), largest);
        let here = core::iter::once(self.command);
        self.ensemble
            .propagate(&self.maps, self.radius, self.command, here);
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

    /// Centre of the contact offsets (3,) at outputs of the plays (3,) [m, rad, rad].
    pub fn centre(&self, output: PerDof<f64>) -> PerDof<f64> {
        let mut centre = self.nominal.hysteresis.centre;
        let at = self.nominal.position.output.into_iter().zip(output);
        for ((centre, map), (here, there)) in centre.iter_mut().zip(&self.maps).zip(at) {
            *centre += map.at(there) - map.at(here);
        }
        centre
    }
}

fn regression(settings: &StateEstimationSettings) -> TipRegression {
    let shift = settings.image_deviation;
    TipRegression::new(
        settings.gain_deviation,
        [settings.shape_deviation, shift, shift],
    )
}
