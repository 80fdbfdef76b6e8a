//! The intensity fit of two blurred discs, drawn by the definition: an integral, summed point by point.

#[path = "../../tests/support/discs.rs"]
mod discs;
#[path = "../../tests/support/settings.rs"]
mod settings;

use super::{BlurFit, BlurFitter};
use crate::{Image, PixelFormat};
use discs::Discs;
use settings::SETTINGS;

const SIDE: usize = 72;
const PREDICTED: [f64; 4] = [30.0, 34.0, 42.0, 38.0];
const TISSUE: [f64; 3] = [70.0, 110.0, 230.0];
const PLASTIC: f64 = 35.0;
const BAND: [f64; 3] = [60.0, 160.0, 50.0];

/// Discs of 5 px blurred by `sigma` at these positions, over tissue above and plastic below, with noise.
fn draw(positions: [f64; 4], sigma: f64, brightness: f64) -> Vec<u8> {
    let points: Vec<[f64; 2]> = (-25..=25_i32)
        .flat_map(|i| (-25..=25_i32).map(move |j| [f64::from(i) / 5.0, f64::from(j) / 5.0]))
        .filter(|[x, y]| x.hypot(*y) <= 5.0)
        .collect();
    let density = 0.04 / (2.0 * std::f64::consts::PI * sigma * sigma);
    let mut random = 1_u32;
    let mut data = Vec::with_capacity(3 * SIDE * SIDE);
    for v in 0..SIDE {
        for u in 0..SIDE {
            let [x, y] = [u, v].map(|side| f64::from(u8::try_from(side).unwrap()));
            let share: f64 = [[positions[0], positions[1]], [positions[2], positions[3]]]
                .iter()
                .flat_map(|[du, dv]| points.iter().map(move |[px, py]| [du + px, dv + py]))
                .map(|[px, py]| {
                    let square = (x - px).powi(2) + (y - py).powi(2);
                    density * (-square / (2.0 * sigma * sigma)).exp()
                })
                .sum();
            let below = 1.0 / (1.0 + (1.7 * (37.0 - y) / sigma).exp());
            for (tissue, band) in TISSUE.iter().zip(BAND) {
                let behind = below * PLASTIC + (1.0 - below) * tissue;
                random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let noise = f64::from(random >> 24) / 64.0 - 2.0;
                let value = behind + brightness * share * (band - behind) + noise;
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "clamped"
                )]
                data.push(value.round().clamp(0.0, 255.0) as u8);
            }
        }
    }
    data
}

fn fit(data: &[u8]) -> Option<BlurFit> {
    let frame = Image::new(data, PixelFormat::Bgr, [SIDE, SIDE], 3 * SIDE).unwrap();
    let discs = Discs::at(PREDICTED);
    BlurFitter::default().fit(&frame, &discs, PREDICTED, false, &SETTINGS)
}

#[test]
fn positions_and_blur_are_those_of_the_image() {
    for sigma in [2.0, 4.0] {
        let positions = [27.3, 36.1, 39.4, 40.2];
        let found = fit(&draw(positions, sigma, 1.0)).unwrap();
        assert!(found.is_accepted(&SETTINGS), "{sigma}: {found:?}");
        assert!(found.is_blurred(&SETTINGS.blur));
        assert!((found.sigma - sigma).abs() < 0.2, "{sigma}: {found:?}");
        for (index, (value, position)) in found.features.iter().zip(positions).enumerate() {
            let std = found.covariance[index][index].sqrt();
            assert!((value - position).abs() < 0.25, "{sigma}: {found:?}");
            assert!((value - position).abs() < 4.0 * std);
        }
    }
}

#[test]
fn tissue_alone_and_one_band_alone_are_rejected() {
    let one = [27.3, 36.1, 400.0, 400.0];
    for data in [draw(PREDICTED, 3.0, 0.0), draw(one, 3.0, 1.0)] {
        let found = fit(&data);
        assert!(
            found.is_none_or(|found| !found.is_accepted(&SETTINGS)),
            "{found:?}"
        );
    }
}
