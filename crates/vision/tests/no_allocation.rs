//! After the first frame of a size, no frame of that size allocates.

use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use tautscope_vision::{ColorDiscriminant, Detector, Image, PixelFormat, Settings};

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

const WIDTH: usize = 65;
const HEIGHT: usize = 49;

/// An image that is marker where `inside(u, v)`.
fn image(inside: impl Fn(usize, usize) -> bool) -> Vec<u8> {
    let pixels = (0..HEIGHT).flat_map(|v| (0..WIDTH).map(move |u| (u, v)));
    pixels
        .flat_map(|(u, v)| {
            if inside(u, v) {
                [70, 190, 60]
            } else {
                [60, 70, 140]
            }
        })
        .collect()
}

#[test]
fn after_the_first_frame_nothing_is_allocated() {
    let frames = [
        image(|_, _| false),
        image(|_, _| true),
        image(|u, v| u % 2 == 0 && v % 2 == 0),
        image(|u, v| (u + v) % 2 == 0),
        image(|u, _| u % 2 == 0),
        image(|u, v| (u * 7919 + v * 104_729) % 5 < 2),
        image(|u, v| (5..15).contains(&v) && ((10..20).contains(&u) || (30..40).contains(&u))),
    ];
    for smoothing in [0, 1, 8] {
        let mut detector = Detector::new(Settings {
            discriminant: ColorDiscriminant::new([-0.5, 1.0, -0.6], 10.0).unwrap(),
            smoothing,
            minimum_area: 1,
            gate: 100.0,
            entry_point: [0.0, 0.0],
        })
        .unwrap();
        let mut found = 0;
        for (index, data) in frames.iter().enumerate() {
            let frame = Image::new(data, PixelFormat::Bgr, [WIDTH, HEIGHT], 3 * WIDTH).unwrap();
            let mut detect = |predicted| detector.detect(&frame, predicted).features.is_ok();
            if index == 0 {
                detect(None);
            } else {
                let near = [15.0, 10.0, 35.0, 10.0];
                found +=
                    assert_no_alloc(|| usize::from(detect(None)) + usize::from(detect(Some(near))));
            }
        }
        assert!(
            found >= 2,
            "the frames exercise nothing: {found} with smoothing {smoothing}"
        );
    }
}
