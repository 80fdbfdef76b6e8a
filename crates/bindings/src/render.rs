//! `tautscope._core.Renderer`: the twin's camera.

use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use tautscope_render::{Error, Geometry, Lens, Piece, Pose, Truth};

/// The image, the features and the visible shares.
type Drawing<'py> = (
    Bound<'py, PyArray3<u8>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
);
/// The image, the features, the visible shares, and the bands' surface.
type Scene<'py> = (
    Bound<'py, PyArray3<u8>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
);

/// Draws the instrument over tissue; see `tautscope.twin.camera.TwinCamera`.
#[pyclass(module = "tautscope._core")]
pub struct Renderer {
    inner: tautscope_render::Renderer,
    frames: Vec<([f64; 3], [f64; 3])>,
    surface: Vec<Piece>,
}

#[pymethods]
impl Renderer {
    #[new]
    #[pyo3(signature = (*, size, focal, centre, distortion, translation, rotation, diameter,
                        bending_length, tip_length, markers, band_length, noise, seed))]
    #[allow(
        clippy::too_many_arguments,
        reason = "keyword arguments of the Python class"
    )]
    fn new(
        py: Python<'_>,
        size: [usize; 2],
        focal: [f64; 2],
        centre: [f64; 2],
        distortion: [f64; 8],
        translation: [f64; 3],
        rotation: [f64; 3],
        diameter: f64,
        bending_length: f64,
        tip_length: f64,
        markers: [f64; 2],
        band_length: f64,
        noise: f64,
        seed: u64,
    ) -> PyResult<Self> {
        let geometry = Geometry {
            diameter,
            bending_length,
            tip_length,
            markers,
            band_length,
        };
        Lens::new(focal, centre, distortion)
            .and_then(|lens| {
                let pose = Pose::new(translation, rotation)?;
                tautscope_render::Renderer::new(size, lens, pose, geometry, noise, seed)
            })
            .map(|inner| Self {
                inner,
                frames: Vec::new(),
                surface: Vec::new(),
            })
            .map_err(|error| config_error(py, error))
    }

    /// Returns the image, uint8 (h, w, 3), the features, (4,) [px], and the visible shares, (2,).
    fn draw<'py>(
        &mut self,
        py: Python<'py>,
        background: &Bound<'py, PyArray3<u8>>,
        points: &Bound<'py, PyArray2<f64>>,
        directions: &Bound<'py, PyArray2<f64>>,
        sequence: u64,
    ) -> PyResult<Drawing<'py>> {
        let (image, truth) = self.paint(py, background, points, directions, Some(sequence))?;
        let [features, visible] = arrays(py, &truth);
        Ok((image, features, visible))
    }

    /// As `draw`, without noise. Also returns the sides of the bands that face the camera, float64 (n, 5), in
    /// small pieces: band (0 or 1), u, v [px], area [px^2], and whether it is visible (0 or 1).
    fn draw_scene<'py>(
        &mut self,
        py: Python<'py>,
        background: &Bound<'py, PyArray3<u8>>,
        points: &Bound<'py, PyArray2<f64>>,
        directions: &Bound<'py, PyArray2<f64>>,
    ) -> PyResult<Scene<'py>> {
        let (image, truth) = self.paint(py, background, points, directions, None)?;
        let [features, visible] = arrays(py, &truth);
        let surface = PyArray2::zeros(py, [self.surface.len(), 5], false);
        let mut table = surface.readwrite();
        let rows = table.as_slice_mut()?.chunks_exact_mut(5);
        for (row, piece) in rows.zip(&self.surface) {
            row.copy_from_slice(&[
                f64::from(u8::from(piece.band == 1)),
                f64::from(piece.at[0]),
                f64::from(piece.at[1]),
                f64::from(piece.area),
                f64::from(u8::from(piece.seen)),
            ]);
        }
        drop(table);
        Ok((image, features, visible, surface))
    }

    /// As `draw_scene`, but only `rows` (first, end) of the image, uint8 (h, w, 3), in place.
    fn draw_rows(
        &mut self,
        py: Python<'_>,
        background: &Bound<'_, PyArray3<u8>>,
        points: &Bound<'_, PyArray2<f64>>,
        directions: &Bound<'_, PyArray2<f64>>,
        image: &Bound<'_, PyArray3<u8>>,
        rows: [usize; 2],
    ) -> PyResult<()> {
        self.read_frames(points, directions);
        let (mut pixels, background) = (image.readwrite(), background.readonly());
        let (target, tissue) = (pixels.as_slice_mut()?, background.as_slice()?);
        let (inner, frames, [first, end]) = (&mut self.inner, &self.frames, rows);
        py.detach(|| inner.draw_rows(tissue, frames, first..end, target));
        Ok(())
    }

    /// Adds the sensor's noise of image `sequence` to the image, uint8 (h, w, 3), in place.
    fn add_noise(
        &self,
        py: Python<'_>,
        image: &Bound<'_, PyArray3<u8>>,
        sequence: u64,
    ) -> PyResult<()> {
        let mut pixels = image.readwrite();
        let target = pixels.as_slice_mut()?;
        py.detach(|| self.inner.add_noise(sequence, target));
        Ok(())
    }
}

impl Renderer {
    /// Draws with the noise of a sequence number, or without noise and keeping the surface.
    fn paint<'py>(
        &mut self,
        py: Python<'py>,
        background: &Bound<'py, PyArray3<u8>>,
        points: &Bound<'py, PyArray2<f64>>,
        directions: &Bound<'py, PyArray2<f64>>,
        sequence: Option<u64>,
    ) -> PyResult<(Bound<'py, PyArray3<u8>>, Truth)> {
        let [width, height] = self.inner.size();
        let image = PyArray3::zeros(py, [height, width, 3], false);
        let mut pixels = image.readwrite();
        let target = pixels.as_slice_mut()?;
        let background = background.readonly();
        let tissue = background.as_slice()?;
        self.read_frames(points, directions);
        let (inner, frames, surface) = (&mut self.inner, &self.frames, &mut self.surface);
        let truth = py.detach(|| match sequence {
            Some(sequence) => inner.draw(tissue, frames, sequence, target),
            None => inner.draw_scene(tissue, frames, target, surface),
        });
        drop(pixels);
        Ok((image, truth))
    }

    /// Sets the frames from points and directions (n, 3).
    fn read_frames(
        &mut self,
        points: &Bound<'_, PyArray2<f64>>,
        directions: &Bound<'_, PyArray2<f64>>,
    ) {
        let (points, directions) = (points.readonly(), directions.readonly());
        let (points, directions) = (points.as_array(), directions.as_array());
        self.frames.clear();
        self.frames.extend(
            points
                .rows()
                .into_iter()
                .zip(directions.rows())
                .map(|(p, t)| {
                    let row = |k: usize| (p.get(k).copied(), t.get(k).copied());
                    let number = |x: Option<f64>| x.unwrap_or(f64::NAN);
                    (
                        [0, 1, 2].map(|k| number(row(k).0)),
                        [0, 1, 2].map(|k| number(row(k).1)),
                    )
                }),
        );
    }
}

fn arrays<'py>(py: Python<'py>, truth: &Truth) -> [Bound<'py, PyArray1<f64>>; 2] {
    [
        PyArray1::from_slice(py, &truth.features),
        PyArray1::from_slice(py, &truth.visible),
    ]
}

fn config_error(py: Python<'_>, error: Error) -> PyErr {
    let facts = (error.field, error.value, error.allowed);
    py.import("tautscope.errors")
        .and_then(|errors| errors.getattr("ConfigError")?.call1(facts))
        .map_or_else(|failure| failure, PyErr::from_value)
}
