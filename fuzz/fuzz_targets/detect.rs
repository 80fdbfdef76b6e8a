//! The detector never panics: any bytes as a frame of any format, any prediction, any thresholds, any windows.

#![no_main]

#[path = "../../crates/vision/tests/support/settings.rs"]
mod settings;

use std::f64::consts::{PI, TAU};

use arbitrary::Arbitrary;
use libfuzzer_sys::fuzz_target;
use settings::SETTINGS;
use tautscope_vision::{
    BandPrediction, BandPredictor, Detector, Image, OUTLINE_CORNERS, Outline, PixelFormat,
    Settings, Window,
};

#[derive(Arbitrary, Clone, Debug)]
struct Input<'a> {
    format: u8,
    sides: [u8; 2],
    padding: u8,
    weights: [f32; 3],
    threshold: f32,
    smoothing: u8,
    minimum_area: u8,
    predicted: [f32; 4],
    std: f32,
    radii: [f32; 2],
    thresholds: [u8; 7],
    is_located: bool,
    windows: [[u16; 4]; 2],
    data: &'a [u8],
}

impl BandPredictor for Input<'_> {
    fn predict(&self, _observed: [f64; 4], _std: [f64; 4]) -> Option<BandPrediction> {
        let features = self.predicted.map(f64::from);
        let [ua, va, ub, vb] = features;
        let [radius_a, radius_b] = self.radii.map(f64::from);
        let outline = |[u, v]: [f64; 2], radius: f64| Outline {
            corners: std::array::from_fn(|index| {
                let angle = TAU * index as f64 / OUTLINE_CORNERS as f64;
                [u + radius * angle.cos(), v + radius * angle.sin()]
            }),
            centroid: [u, v],
            area: PI * radius * radius,
        };
        let mut covariance = [[0.0; 4]; 4];
        for (index, row) in covariance.iter_mut().enumerate() {
            row[index] = f64::from(self.std).powi(2);
        }
        Some(BandPrediction {
            features,
            covariance,
            outlines: [outline([ua, va], radius_a), outline([ub, vb], radius_b)],
        })
    }

    fn is_located(&self) -> bool {
        self.is_located
    }

    fn anywhere(&self) -> Option<Self> {
        self.is_located.then(|| Self {
            is_located: false,
            ..self.clone()
        })
    }
}

fuzz_target!(|input: Input<'_>| {
    let format = PixelFormat::ALL[usize::from(input.format) % PixelFormat::ALL.len()];
    let [width, height] = input.sides.map(|side| usize::from(side % 65));
    let stride = format.line_bytes(width) + usize::from(input.padding % 8);
    // The input is repeated, so that small inputs make whole frames.
    let length = stride * format.lines(height);
    let data: Vec<u8> = if input.padding < 250 {
        input.data.iter().copied().cycle().take(length).collect()
    } else {
        input.data.to_vec()
    };
    let Ok(frame) = Image::new(&data, format, [width, height], stride) else {
        return;
    };
    let [inside, coverage, spill, edges, average, alone, surprise] = input
        .thresholds
        .map(|threshold| f64::from(threshold) / 128.0);
    let Ok(mut detector) = Detector::new(Settings {
        weights: input.weights.map(f64::from),
        threshold: f64::from(input.threshold),
        smoothing: usize::from(input.smoothing % 9),
        minimum_area: u64::from(input.minimum_area),
        least_inside: inside,
        least_coverage: coverage,
        largest_spill: spill,
        least_edges: edges,
        least_edges_on_average: average,
        least_edges_alone: alone,
        largest_surprise: surprise,
        ..SETTINGS
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
    detector.recognise(&frame, &input);
    detector.regions_in(&frame, &windows);
});
