use core::ops::Range;

use crate::Error;
use crate::curve::Curve;
use crate::features::{Patches, Piece, Truth};
use crate::lens::Lens;
use crate::noise::Noise;
use crate::pose::Pose;
use crate::raster::Samples;
use crate::tube::{Geometry, Sweep};

/// Longest centreline that is drawn (m); a longer one is an error in the caller's physics.
const LONGEST: f64 = 10.0;

/// Draws the instrument over an image of tissue, as seen by a camera with light guides.
pub struct Renderer {
    width: usize,
    height: usize,
    lens: Lens,
    camera_from_guide: Pose,
    geometry: Geometry,
    noise: Noise,
    curve: Curve,
    samples: Samples,
    bands: Patches,
}

impl Renderer {
    /// Sets up the camera, the instrument and the sensor's noise.
    ///
    /// `size` is width and height (px), `noise` the standard deviation (grey levels) and `seed`
    /// the seed of the noise.
    ///
    /// # Errors
    /// A size outside 1 to 8192 px, a length that is not above zero, bands that are not on the tip, or
    /// noise outside 0 to 255.
    pub fn new(
        size: [usize; 2],
        lens: Lens,
        camera_from_guide: Pose,
        geometry: Geometry,
        noise: f64,
        seed: u64,
    ) -> Result<Self, Error> {
        for (field, value) in ["camera.width", "camera.height"].into_iter().zip(size) {
            if !(1..=8192).contains(&value) {
                return Err(Error {
                    field,
                    value: value as f64,
                    allowed: "1 to 8192 px",
                });
            }
        }
        geometry.check()?;
        let [width, height] = size;
        Ok(Self {
            width,
            height,
            lens,
            camera_from_guide,
            geometry,
            noise: Noise::new(noise, seed)?,
            curve: Curve::default(),
            samples: Samples::new(width, height),
            bands: Patches::default(),
        })
    }

    /// Width and height (px).
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Draws one image into `image` (3 width height bytes, rows of blue, green, red) over
    /// `background` (the same), and returns where the bands are in it.
    ///
    /// `frames` are positions (in m) and tangents along the centreline in the guide's frame, proximal
    /// to distal; the last is the distal end of the tip. Frames with a number that is not finite,
    /// or that make a line longer than 10 m, give an image without instrument. Slices of another
    /// size are filled as far as they reach.
    pub fn draw(
        &mut self,
        background: &[u8],
        frames: &[([f64; 3], [f64; 3])],
        sequence: u64,
        image: &mut [u8],
    ) -> Truth {
        self.paint(background, frames, Some(sequence), image, |_| ())
    }

    /// As [`Renderer::draw`] without the sensor's noise, for an image that is processed further before
    /// it reaches the sensor; [`Renderer::add_noise`] completes it. `surface` is filled with the
    /// visible sides of the bands, piece by piece.
    pub fn draw_scene(
        &mut self,
        background: &[u8],
        frames: &[([f64; 3], [f64; 3])],
        image: &mut [u8],
        surface: &mut Vec<Piece>,
    ) -> Truth {
        surface.clear();
        self.paint(background, frames, None, image, |piece| surface.push(piece))
    }

    /// As [`Renderer::draw_scene`], but only these rows of `image`; the others stay as they are.
    pub fn draw_rows(
        &mut self,
        background: &[u8],
        frames: &[([f64; 3], [f64; 3])],
        rows: Range<usize>,
        image: &mut [u8],
    ) {
        let rows = rows.start..rows.end.min(self.height);
        self.samples.clip(rows.clone());
        self.sweep(frames);
        self.samples.clip(0..self.height);
        self.resolve(background, rows, None, image);
    }

    /// Adds the sensor's noise of image `sequence` to `image`, saturating at 0 and 255.
    pub fn add_noise(&self, sequence: u64, image: &mut [u8]) {
        for (y, row) in image.chunks_mut(3 * self.width).enumerate() {
            self.noise.add(sequence, y as u64, row);
        }
    }

    fn paint(
        &mut self,
        background: &[u8],
        frames: &[([f64; 3], [f64; 3])],
        noise: Option<u64>,
        image: &mut [u8],
        keep: impl FnMut(Piece),
    ) -> Truth {
        self.sweep(frames);
        let tolerance = 0.25 * self.geometry.diameter as f32;
        let truth = self.bands.truth(&self.samples, tolerance, keep);
        self.resolve(background, 0..self.height, noise, image);
        truth
    }

    /// Completes these rows of the image, and clears their samples.
    fn resolve(
        &mut self,
        background: &[u8],
        rows: Range<usize>,
        noise: Option<u64>,
        image: &mut [u8],
    ) {
        let stride = 3 * self.width;
        let lines = image.chunks_mut(stride).zip(background.chunks(stride));
        for (y, (row, tissue)) in lines.enumerate().take(rows.end).skip(rows.start) {
            for (value, below) in row.iter_mut().zip(tissue) {
                *value = *below;
            }
            self.samples.resolve(y, row);
            if let Some(sequence) = noise {
                self.noise.add(sequence, y as u64, row);
            }
        }
    }

    fn sweep(&mut self, frames: &[([f64; 3], [f64; 3])]) {
        self.bands.clear();
        if !frames
            .iter()
            .all(|(p, t)| p.iter().chain(t).all(|v| v.is_finite()))
        {
            return;
        }
        let pose = &self.camera_from_guide;
        let moved = frames
            .iter()
            .map(|&(p, t)| (pose.transform(p), pose.rotate(t)));
        self.curve.fit(moved);
        if self.curve.length() < LONGEST {
            Sweep {
                curve: &self.curve,
                lens: &self.lens,
                samples: &mut self.samples,
                bands: &mut self.bands,
            }
            .draw(&self.geometry);
        }
    }
}
