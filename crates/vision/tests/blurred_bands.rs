//! Bands without edges: two blurred discs, drawn by the definition: an integral, summed point by point.

mod support;

use std::f64::consts::TAU;

use support::{Discs, SETTINGS};
use tautscope_vision::{
    BandPrediction, BandPredictor, Detector, Image, PixelFormat, Recognition, SECTION_DISCS,
    SectionDisc, Settings,
};

const SIDES: [usize; 2] = [176, 144];
const PREDICTED: [f64; 4] = [74.0, 70.0, 86.0, 74.0];
const TRUE: [f64; 4] = [71.3, 72.1, 83.4, 76.2];
const TISSUE: [f64; 3] = [70.0, 110.0, 230.0];
const PLASTIC: f64 = 35.0;
const BAND: [f64; 3] = [60.0, 160.0, 50.0];

/// A predictor with a disc of the section that hides a part of band B.
struct Covered {
    discs: Discs,
    section: Option<SectionDisc>,
}

impl BandPredictor for Covered {
    fn predict(&self, observed: [f64; 4], std: [f64; 4]) -> Option<BandPrediction> {
        self.discs.predict(observed, std)
    }

    fn section(&self, _observed: [f64; 4], _std: [f64; 4]) -> [Option<SectionDisc>; SECTION_DISCS] {
        let mut section = [None; SECTION_DISCS];
        section[3] = self.section;
        section
    }
}

/// Discs of 5 px blurred by `sigma` at these positions, over tissue above and plastic below, with noise. `cover` hides a part of
/// the second one.
fn draw(positions: [f64; 4], sigma: f64, brightness: f64, cover: Option<SectionDisc>) -> Vec<u8> {
    let [ua, va, ub, vb] = positions;
    let steps = || (-25..=25_i32).map(|step| f64::from(step) / 5.0);
    let disc: Vec<[f64; 2]> = steps()
        .flat_map(|x| steps().map(move |y| [x, y]))
        .filter(|[x, y]| x.hypot(*y) <= 5.0)
        .collect();
    let moved = |[u, v]: [f64; 2]| disc.iter().map(move |[x, y]| [u + x, v + y]);
    let is_visible = |[u, v]: &[f64; 2]| {
        cover.is_none_or(|cover| (u - cover.centre[0]).hypot(v - cover.centre[1]) > cover.radius)
    };
    let points: Vec<[f64; 2]> = moved([ua, va])
        .chain(moved([ub, vb]).filter(is_visible))
        .collect();
    let [width, height] = SIDES.map(|side| u32::try_from(side).unwrap());
    let mut random = 1_u32;
    let mut data = Vec::new();
    for (v, u) in (0..height).flat_map(|v| (0..width).map(move |u| (v, u))) {
        let [x, y] = [u, v].map(f64::from);
        let square = |[u, v]: &[f64; 2]| (x - u).powi(2) + (y - v).powi(2);
        let is_near = (45.0..111.0).contains(&x) && (45.0..105.0).contains(&y);
        let near = if is_near { points.as_slice() } else { &[] };
        let densities = near
            .iter()
            .map(|point| (-square(point) / (2.0 * sigma * sigma)).exp() / (TAU * sigma * sigma));
        let share = 0.04 * densities.sum::<f64>();
        let below = 1.0 / (1.0 + (1.7 * (73.0 - y) / sigma).exp());
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
    data
}

fn recognise(data: &[u8], section: Option<SectionDisc>) -> Recognition {
    let frame = Image::new(data, PixelFormat::Bgr, SIDES, 3 * SIDES[0]).unwrap();
    let discs = Discs::at(PREDICTED);
    let settings = Settings {
        // No pixel is marker, so that there are no edges.
        threshold: 255.0,
        ..SETTINGS
    };
    let mut detector = Detector::new(settings).unwrap();
    detector.recognise(&frame, &Covered { discs, section }).0
}

/// Largest distance of a coordinate from the truth (px).
fn error(found: &Recognition) -> f64 {
    let errors = found.features.iter().zip(TRUE).map(|(a, b)| (a - b).abs());
    errors.fold(0.0, f64::max)
}

#[test]
fn positions_and_blur_are_those_of_the_image() {
    for sigma in [2.0, 4.0] {
        let found = recognise(&draw(TRUE, sigma, 1.0, None), None);
        assert_eq!(found.rejections, [None; 2], "{sigma}");
        assert!(error(&found) < 0.25, "{sigma}: {found:?}");
        for (index, (value, truth)) in found.features.iter().zip(TRUE).enumerate() {
            let std = found.covariance[index][index].sqrt();
            assert!((value - truth).abs() < 4.0 * std, "{sigma}: {found:?}");
        }
        for score in found.scores {
            assert!((score.growth - sigma).abs() < 0.2, "{sigma}: {found:?}");
        }
    }
}

#[test]
fn what_the_section_hides_does_not_move_a_band() {
    let cover = SectionDisc {
        centre: [90.0, 76.2],
        radius: 5.0,
        is_nearer: [false, true],
    };
    let data = draw(TRUE, 3.0, 1.0, Some(cover));
    let found = recognise(&data, Some(cover));
    assert!(error(&found) < 0.25, "{found:?}");
    let behind = SectionDisc {
        is_nearer: [true, false],
        ..cover
    };
    for section in [None, Some(behind)] {
        let found = recognise(&data, section);
        assert!(error(&found) > 0.5, "{found:?}");
    }
}

#[test]
fn tissue_alone_and_one_band_alone_are_not_two_bands() {
    let one = [TRUE[0], TRUE[1], 400.0, 400.0];
    for data in [draw(TRUE, 3.0, 0.0, None), draw(one, 3.0, 1.0, None)] {
        let found = recognise(&data, None);
        assert_ne!(found.rejections, [None; 2], "{found:?}");
    }
}
