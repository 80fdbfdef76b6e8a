//! Any bytes as a frame of any format, any prediction, any windows: an answer, never a panic.

#![no_main]

use arbitrary::Arbitrary;
use libfuzzer_sys::fuzz_target;
use tautscope_vision::{ColorDiscriminant, Detector, Image, PixelFormat, Settings, Window};

#[derive(Arbitrary, Debug)]
struct Input<'a> {
    format: u8,
    sides: [u8; 2],
    padding: u8,
    weights: [f32; 3],
    threshold: f32,
    smoothing: u8,
    minimum_area: u8,
    gate: f64,
    entry_point: [f64; 2],
    predicted: Option<[f64; 4]>,
    windows: [[u16; 4]; 2],
    data: &'a [u8],
}

fuzz_target!(|input: Input<'_>| {
    let format = PixelFormat::ALL[usize::from(input.format) % PixelFormat::ALL.len()];
    let [width, height] = input.sides.map(|side| usize::from(side % 65));
    let stride = format.line_bytes(width) + usize::from(input.padding % 8);
    // Bytes that are not there repeat those that are, so that small inputs make whole frames.
    let length = stride * format.lines(height);
    let data: Vec<u8> = if input.padding < 250 {
        input.data.iter().copied().cycle().take(length).collect()
    } else {
        input.data.to_vec()
    };
    let Ok(frame) = Image::new(&data, format, [width, height], stride) else {
        return;
    };
    let weights = input.weights.map(f64::from);
    let Ok(discriminant) = ColorDiscriminant::new(weights, f64::from(input.threshold)) else {
        return;
    };
    let Ok(mut detector) = Detector::new(Settings {
        discriminant,
        smoothing: usize::from(input.smoothing % 9),
        minimum_area: u64::from(input.minimum_area),
        gate: input.gate,
        entry_point: input.entry_point,
    }) else {
        return;
    };
    let windows = input.windows.map(|[left, top, right, bottom]| Window {
        left: usize::from(left),
        top: usize::from(top),
        right: usize::from(right),
        bottom: usize::from(bottom),
    });
    let whole: u64 = detector
        .regions_in(&frame, &[Window::whole(&frame)])
        .iter()
        .map(|region| region.area)
        .sum();
    assert!(whole <= (width * height) as u64);
    detector.detect(&frame, input.predicted);
    detector.regions_in(&frame, &windows);
});
