//! Two blurred discs against their light by its definition: an integral, summed point by point.

mod support;

use support::{DEMANDS, Discs};
use tautscope_vision::blend::{Blend, Blended};
use tautscope_vision::{Expect, Image, PixelFormat};

const SIDE: usize = 72;
const EXPECTED: [f64; 4] = [30.0, 34.0, 42.0, 38.0];
const TISSUE: [f64; 3] = [70.0, 110.0, 230.0];
const PLASTIC: f64 = 35.0;
const BAND: [f64; 3] = [60.0, 160.0, 50.0];

/// Discs of 5 px blurred by `spread` at these places, over tissue above and plastic below, with grain.
fn draw(places: [f64; 4], spread: f64, light: f64) -> Vec<u8> {
    let points: Vec<[f64; 2]> = (-25..=25_i32)
        .flat_map(|i| (-25..=25_i32).map(move |j| [f64::from(i) / 5.0, f64::from(j) / 5.0]))
        .filter(|[x, y]| x.hypot(*y) <= 5.0)
        .collect();
    let density = 0.04 / (2.0 * std::f64::consts::PI * spread * spread);
    let mut noise = 1_u32;
    let mut data = Vec::with_capacity(3 * SIDE * SIDE);
    for v in 0..SIDE {
        for u in 0..SIDE {
            let [x, y] = [u, v].map(|side| f64::from(u8::try_from(side).unwrap()));
            let share: f64 = [[places[0], places[1]], [places[2], places[3]]]
                .iter()
                .flat_map(|[du, dv]| points.iter().map(move |[px, py]| [du + px, dv + py]))
                .map(|[px, py]| {
                    let square = (x - px).powi(2) + (y - py).powi(2);
                    density * (-square / (2.0 * spread * spread)).exp()
                })
                .sum();
            let below = 1.0 / (1.0 + (1.7 * (37.0 - y) / spread).exp());
            for (tissue, band) in TISSUE.iter().zip(BAND) {
                let behind = below * PLASTIC + (1.0 - below) * tissue;
                noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let grain = f64::from(noise >> 24) / 64.0 - 2.0;
                let value = behind + light * share * (band - behind) + grain;
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

fn fit(data: &[u8]) -> Option<Blended> {
    let frame = Image::new(data, PixelFormat::Bgr, [SIDE, SIDE], 3 * SIDE).unwrap();
    let discs = Discs::at(EXPECTED);
    let blind = discs.expect([f64::NAN; 4], [f64::INFINITY; 4]).unwrap();
    Blend::default().fit(&frame, &discs, &blind, EXPECTED)
}

#[test]
fn places_and_blur_are_those_of_the_picture() {
    for spread in [2.0, 4.0] {
        let places = [27.3, 36.1, 39.4, 40.2];
        let found = fit(&draw(places, spread, 1.0)).unwrap();
        assert!(found.is_good(&DEMANDS), "{spread}: {found:?}");
        assert!(found.is_blurred());
        assert!((found.spread - spread).abs() < 0.2, "{spread}: {found:?}");
        for (index, (value, place)) in found.features.iter().zip(places).enumerate() {
            let deviation = found.covariance[index][index].sqrt();
            assert!((value - place).abs() < 0.25, "{spread}: {found:?}");
            assert!((value - place).abs() < 4.0 * deviation);
        }
    }
}

#[test]
fn neither_tissue_alone_nor_one_band_alone_is_two_bands() {
    let one = [27.3, 36.1, 400.0, 400.0];
    for data in [draw(EXPECTED, 3.0, 0.0), draw(one, 3.0, 1.0)] {
        let found = fit(&data);
        assert!(
            found.is_none_or(|found| !found.is_good(&DEMANDS)),
            "{found:?}"
        );
    }
}
