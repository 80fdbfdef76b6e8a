//! A prediction of two discs.

use std::f64::consts::{PI, TAU};

use tautscope_vision::{BandPrediction, BandPredictor, OUTLINE_CORNERS, Outline};

/// Two discs with a radius of 5 px, predicted with a standard deviation of 5 px; not visible at features that are not
/// finite.
#[derive(Clone, Copy, Debug)]
pub struct Discs([f64; 4]);

impl Discs {
    pub fn at(features: [f64; 4]) -> Self {
        Self(features)
    }
}

impl BandPredictor for Discs {
    fn predict(&self, _observed: [f64; 4], _std: [f64; 4]) -> Option<BandPrediction> {
        let [ua, va, ub, vb] = self.0;
        let disc = |[u, v]: [f64; 2]| Outline {
            corners: std::array::from_fn(|index| {
                let angle = TAU * f64::from(u8::try_from(index).unwrap())
                    / f64::from(u8::try_from(OUTLINE_CORNERS).unwrap());
                [u + 5.0 * angle.cos(), v + 5.0 * angle.sin()]
            }),
            centroid: [u, v],
            area: 25.0 * PI,
        };
        let covariance = std::array::from_fn(|row| {
            std::array::from_fn(|column| f64::from(u8::from(row == column)) * 25.0)
        });
        self.0
            .iter()
            .all(|value| value.is_finite())
            .then_some(BandPrediction {
                features: self.0,
                covariance,
                outlines: [disc([ua, va]), disc([ub, vb])],
            })
    }
}
