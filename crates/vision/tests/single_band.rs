//! A band found alone, where it is predicted and where its place is not known.

mod support;

use support::{Anywhere, SETTINGS};
use tautscope_vision::{Detector, Image, PixelFormat};

const WIDTH: usize = 65;
const HEIGHT: usize = 49;

#[test]
fn a_clear_band_alone_is_rejected_for_its_unknown_place() {
    let pixels = (0..HEIGHT).flat_map(|v| (0..WIDTH).map(move |u| (u, v)));
    let is_disc = |(u, v): (usize, usize)| {
        let (du, dv) = (u.abs_diff(30), v.abs_diff(30));
        du * du + dv * dv <= 25
    };
    let colours = [[60, 70, 140], [70, 190, 60]];
    let data: Vec<u8> = pixels
        .flat_map(|at| colours[usize::from(is_disc(at))])
        .collect();
    let frame = Image::new(&data, PixelFormat::Bgr, [WIDTH, HEIGHT], 3 * WIDTH).unwrap();
    let reasons = |predictor: &Anywhere| {
        let mut detector = Detector::new(SETTINGS).unwrap();
        let (found, _) = detector.recognise(&frame, predictor);
        found.rejections.map(|one| one.map(|one| one.to_string()))
    };
    let known = reasons(&Anywhere::expected_at([30.0, 30.0, 30.0, 14.0]));
    assert_eq!(known[0], None);
    let unknown = reasons(&Anywhere::new());
    let alone = "alone, and where the instrument is, is not known";
    assert!(unknown.contains(&Some(alone.into())), "{unknown:?}");
    assert!(unknown.iter().all(Option::is_some), "{unknown:?}");
}
