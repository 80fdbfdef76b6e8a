//! The marker bands found in an image, without a prediction and with one.
//!
//! ```sh
//! cargo run --package tautscope-band-prediction --example detection
//! ```

use std::error::Error;
use std::sync::Arc;

use tautscope_band_prediction::{ModelPredictor, Prior, Workspace, outlines};
use tautscope_config::Configuration;
use tautscope_core::{FeatureModel, Settings};
use tautscope_vision::{Detector, Image, Outline, PixelFormat, PostureTable};

/// Ends of the workspace: insertion, rotation, bending [m, rad, rad].
const WORKSPACE: [[f64; 2]; 3] = [[0.01, 0.04], [-2.0, 2.0], [0.0, 1.8]];
/// Postures along each DOF, at most 30 px from one to the next in the image.
const POSTURES: [u32; 3] = [13, 45, 23];
/// Postures along each DOF from which a fit of the model to a pair of regions starts.
const STARTS: [u32; 3] = [2, 5, 2];
/// Width and height of the image (px).
const SIZE: [usize; 2] = [720, 576];

fn main() -> Result<(), Box<dyn Error>> {
    let [drawn, without, with] = features()?;
    println!("drawn at {drawn:.1?} px\nwithout a prediction {without:.1?}\nwith one {with:.1?}");
    Ok(())
}

/// Features (4,) in px: as drawn, and as found without and with a prediction.
fn features() -> Result<[[f64; 4]; 3], Box<dyn Error>> {
    #[derive(serde::Deserialize)]
    struct Sections {
        vision: tautscope_vision::Settings,
    }
    let configuration = Configuration::parse("")?; // the TOML of your rig
    let model = configuration.read::<Settings>()?.feature_model()?;
    let Sections { vision } = configuration.read()?;
    let deviation = vision.model_deviation;

    let workspace = Workspace {
        states: grid(STARTS),
        std: WORKSPACE.map(|[least, largest]| (largest - least) / 2.0),
    };
    let postures = grid(POSTURES);
    let table = PostureTable::new(
        postures
            .iter()
            .filter_map(|posture| outlines(&model, *posture)),
    );
    let mut detector = Detector::new(vision)?.with_workspace(Arc::new(table));

    let (drawn, pixels) = image(&model, [0.028, -0.7, 1.1])?;
    let image = Image::new(&pixels, PixelFormat::Bgr, SIZE, 3 * SIZE[0])?;
    // With a loop: its `predict_state`.
    let near = Prior {
        state: [0.027, -0.6, 1.0],
        std: [0.002, 0.2, 0.2],
        geometry: [0.0; 3],
    };
    let [without, with] = [None, Some(near)].map(|prior| {
        let predictor = ModelPredictor::new(&model, deviation, &workspace, prior);
        detector.recognise(&image, &predictor).0.features
    });
    Ok([drawn, without, with])
}

/// Postures (3,) that cover the workspace evenly.
fn grid([insertions, rotations, bendings]: [u32; 3]) -> Vec<[f64; 3]> {
    let along = |dof: usize, count: u32| {
        let [least, largest] = WORKSPACE[dof];
        let step = (largest - least) / f64::from(count - 1);
        (0..count).map(move |index| least + step * f64::from(index))
    };
    along(0, insertions)
        .flat_map(|insertion| {
            along(1, rotations).flat_map(move |rotation| {
                along(2, bendings).map(move |bending| [insertion, rotation, bending])
            })
        })
        .collect()
}

/// Features (4,) in px and pixels of both bands, green on grey.
fn image(model: &FeatureModel, posture: [f64; 3]) -> Result<([f64; 4], Vec<u8>), Box<dyn Error>> {
    let bands = outlines(model, posture).ok_or("a band is not visible")?;
    let [width, height] = SIZE.map(|side| u32::try_from(side).unwrap_or(0));
    let places = (0..height).flat_map(|v| (0..width).map(move |u| [f64::from(u), f64::from(v)]));
    let pixels = places.flat_map(|place| {
        let is_green = bands.iter().any(|band| has_inside(band, place));
        if is_green { [60, 200, 60] } else { [90; 3] }
    });
    let [[ua, va], [ub, vb]] = bands.each_ref().map(|band| band.centroid);
    Ok(([ua, va, ub, vb], pixels.collect()))
}

/// Whether an odd number of the outline's sides is to the right of a point.
fn has_inside(band: &Outline, [u, v]: [f64; 2]) -> bool {
    let corners = &band.corners;
    let next = corners.iter().cycle().skip(1);
    let crossings = corners.iter().zip(next).filter(|([ua, va], [ub, vb])| {
        (*va > v) != (*vb > v) && u < ua + (v - va) / (vb - va) * (ub - ua)
    });
    crossings.count() % 2 == 1
}

#[test]
fn both_bands_are_found() {
    let [drawn, without, with] = features().unwrap();
    for found in [without, with] {
        for (found, drawn) in found.into_iter().zip(drawn) {
            assert!((found - drawn).abs() < 0.5, "{found} px, drawn at {drawn}");
        }
    }
}
