use crate::Error;
use crate::curve::Curve;
use crate::lens::Lens;
use crate::material::TAG_BAND;
use crate::noise::Noise;
use crate::pose::Pose;
use crate::raster::Samples;
use crate::tube::{Geometry, Sweep};

/// Longest centreline that is drawn [m]; a longer one is a fault of the caller's physics.
const LONGEST: f64 = 10.0;

/// Centroids of the visible part of the two bands, u and v of each [px]; NaN where not visible.
pub type Features = [f64; 4];

/// Draws the instrument over a picture of tissue, as a camera with light guides sees it.
pub struct Renderer {
    width: usize,
    height: usize,
    lens: Lens,
    camera_from_guide: Pose,
    geometry: Geometry,
    noise: Noise,
    curve: Curve,
    samples: Samples,
}

impl Renderer {
    /// Sets up the camera, the instrument and the sensor's noise.
    ///
    /// `size` is width and height [px], `noise` the standard deviation [grey levels] and `seed`
    /// what decides every noise value.
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
        })
    }

    /// Width and height [px].
    pub fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// Draws one picture into `image` (3 width height bytes, rows of blue, green, red) over
    /// `background` (the same), and returns where the bands are in it.
    ///
    /// `frames` are positions [m] and tangents along the centreline in the guide's frame, proximal
    /// to distal; the last is the distal end of the tip. The features are centroids of each band's
    /// visible samples, pixel by pixel, before the noise. Frames with a number that is not finite,
    /// or that make a line longer than 10 m, give a picture without instrument. Slices of another
    /// size are filled as far as they go.
    pub fn draw(
        &mut self,
        background: &[u8],
        frames: &[([f64; 3], [f64; 3])],
        sequence: u64,
        image: &mut [u8],
    ) -> Features {
        self.sweep(frames);
        let mut count = [0_u32; 2];
        let mut sum = [[0_u64; 2]; 2];
        let stride = 3 * self.width;
        let rows = image.chunks_mut(stride).zip(background.chunks(stride));
        for (y, (row, tissue)) in rows.take(self.height).enumerate() {
            for (value, below) in row.iter_mut().zip(tissue) {
                *value = *below;
            }
            let (_, band) = self.samples.resolve(y, TAG_BAND, row);
            for k in 0..2 {
                count[k] += band.samples[k];
                sum[k][0] += band.sum_x[k];
                sum[k][1] += y as u64 * u64::from(band.samples[k]);
            }
            self.noise.add(sequence, y as u64, row);
        }
        let centroid = |k: usize, axis: usize| {
            if count[k] == 0 {
                f64::NAN
            } else {
                sum[k][axis] as f64 / f64::from(count[k])
            }
        };
        [
            centroid(0, 0),
            centroid(0, 1),
            centroid(1, 0),
            centroid(1, 1),
        ]
    }

    fn sweep(&mut self, frames: &[([f64; 3], [f64; 3])]) {
        if !frames
            .iter()
            .all(|(p, t)| p.iter().chain(t).all(|v| v.is_finite()))
        {
            return;
        }
        let pose = &self.camera_from_guide;
        let moved = frames.iter().map(|&(p, t)| (pose.place(p), pose.turn(t)));
        self.curve.fit(moved);
        if self.curve.length() < LONGEST {
            Sweep {
                curve: &self.curve,
                lens: &self.lens,
                samples: &mut self.samples,
            }
            .draw(&self.geometry);
        }
    }
}
