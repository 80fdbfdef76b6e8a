use core::ops::Range;

/// Samples per pixel along x and along y.
const FINE: usize = 2;

/// A corner of the mesh in the picture.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Vertex {
    /// Place [px, pixel centres at whole numbers].
    pub(crate) at: [f32; 2],
    /// 1 / depth [1/m]; 0 marks a corner that cannot be drawn.
    pub(crate) nearness: f32,
    /// Blue, green, red, 0 to 255.
    pub(crate) colour: [f32; 3],
}

/// What a pixel row holds of the two bands: samples, and their sum of x [px].
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BandRow {
    pub(crate) samples: [u32; 2],
    pub(crate) sum_x: [u64; 2],
}

/// The picture at 2x2 samples per pixel, with the nearest surface of each.
///
/// Sample (i, j) lies at x = (i + 1/2) / 2 - 1/2, likewise y. Memory outside the spans that were
/// drawn to is never touched, neither to clear it nor to read it.
pub(crate) struct Samples {
    width: usize,
    height: usize,
    nearness: Vec<f32>,
    /// Tag, red, green, blue from the highest byte to the lowest; 0 is nothing.
    paint: Vec<u32>,
    /// Samples drawn to, per row of samples.
    spans: Vec<Range<usize>>,
}

impl Samples {
    /// For a picture of so many pixels.
    pub(crate) fn new(width: usize, height: usize) -> Self {
        let (width, height) = (FINE * width, FINE * height);
        Self {
            width,
            height,
            nearness: vec![0.0; width * height],
            paint: vec![0; width * height],
            spans: vec![0..0; height],
        }
    }

    /// Draws one triangle of either orientation with colours interpolated between its corners.
    pub(crate) fn triangle(&mut self, tag: u8, corners: [&Vertex; 3]) {
        if corners.iter().any(|corner| corner.nearness <= 0.0) {
            return;
        }
        let place = |v: &Vertex| v.at.map(|x| FINE as f32 * (x + 0.5) - 0.5);
        let mut sorted = corners.map(|v| (place(v), v));
        sorted.sort_by(|a, b| a.0[1].total_cmp(&b.0[1]));
        let [(a, va), (b, vb), (c, vc)] = sorted;
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        if area.abs() < 1e-6 {
            return;
        }
        let top = a[1].ceil().max(0.0);
        let bottom = c[1].ceil().min(self.height as f32);
        if top >= bottom {
            return;
        }
        let plane = |f: [f32; 3]| {
            let (fb, fc) = (f[1] - f[0], f[2] - f[0]);
            [
                (fb * (c[1] - a[1]) - fc * (b[1] - a[1])) / area,
                (fc * (b[0] - a[0]) - fb * (c[0] - a[0])) / area,
            ]
        };
        let near = plane([va.nearness, vb.nearness, vc.nearness]);
        let hue = [0, 1, 2].map(|k| plane([va.colour[k], vb.colour[k], vc.colour[k]]));
        let long = (c[0] - a[0]) / (c[1] - a[1]);
        let upper = (b[0] - a[0]) / (b[1] - a[1]);
        let lower = (c[0] - b[0]) / (c[1] - b[1]);

        for row in top as usize..bottom as usize {
            let y = row as f32;
            let one = a[0] + (y - a[1]) * long;
            let other = if y < b[1] {
                a[0] + (y - a[1]) * upper
            } else {
                b[0] + (y - b[1]) * lower
            };
            let left = one.min(other).ceil().max(0.0) as usize;
            let right = (one.max(other).ceil().max(0.0) as usize).min(self.width);
            if left >= right {
                continue;
            }
            let (dx, dy) = (left as f32 - a[0], y - a[1]);
            let start = row * self.width;
            let (Some(nearness), Some(paint), Some(span)) = (
                self.nearness.get_mut(start + left..start + right),
                self.paint.get_mut(start + left..start + right),
                self.spans.get_mut(row),
            ) else {
                continue;
            };
            *span = if Range::is_empty(span) {
                left..right
            } else {
                span.start.min(left)..span.end.max(right)
            };
            let run = (right - left - 1) as f32;
            let ramp = [0, 1, 2].map(|k| {
                let first = va.colour[k] + dx * hue[k][0] + dy * hue[k][1];
                Ramp::between(first, first + run * hue[k][0], run)
            });
            let first = va.nearness + dx * near[0] + dy * near[1];
            let tag = u32::from(tag) << 24;
            for (i, (nearest, word)) in nearness.iter_mut().zip(paint).enumerate() {
                let i = i as i32;
                let here = first + i as f32 * near[0];
                let new = tag | ramp[2].at(i) << 16 | ramp[1].at(i) << 8 | ramp[0].at(i);
                let front = here > *nearest;
                *nearest = if front { here } else { *nearest };
                *word = if front { new } else { *word };
            }
        }
    }

    /// Lays row `y` of the drawing over the tissue in `pixels` (3 width) and wipes it: afterwards
    /// the row is empty for the next picture. Returns the pixels it may have changed, and what it
    /// held of the bands.
    pub(crate) fn resolve(
        &mut self,
        y: usize,
        first_band: u8,
        pixels: &mut [u8],
    ) -> (Range<usize>, BandRow) {
        let mut band = BandRow::default();
        let mut touched = 0..0;
        for span in self.spans.iter_mut().skip(FINE * y).take(FINE) {
            if !Range::is_empty(span) {
                let pixels = span.start / FINE..span.end.div_ceil(FINE);
                touched = if Range::is_empty(&touched) {
                    pixels
                } else {
                    touched.start.min(pixels.start)..touched.end.max(pixels.end)
                };
            }
            *span = 0..0;
        }
        let drawn = FINE * touched.start..FINE * touched.end;
        let start = FINE * y * self.width;
        let rows = start..start + FINE * self.width;
        let (Some(nearness), Some(paint)) = (
            self.nearness.get_mut(rows.clone()),
            self.paint.get_mut(rows),
        ) else {
            return (0..0, band);
        };
        for row in nearness.chunks_exact_mut(self.width) {
            if let Some(row) = row.get_mut(drawn.clone()) {
                row.fill(0.0);
            }
        }
        let (even, odd) = paint.split_at_mut(self.width);
        let (Some(even), Some(odd), Some(pixels)) = (
            even.get_mut(drawn.clone()),
            odd.get_mut(drawn),
            pixels.get_mut(3 * touched.start..3 * touched.end),
        ) else {
            return (0..0, band);
        };
        let quads = even.chunks_exact(FINE).zip(odd.chunks_exact(FINE));
        for ((x, quad), pixel) in touched.clone().zip(quads).zip(pixels.chunks_exact_mut(3)) {
            let words = [quad.0[0], quad.0[1], quad.1[0], quad.1[1]];
            let empty = words.iter().filter(|word| **word == 0).count() as u32;
            if empty == 4 {
                continue;
            }
            // Blue and red side by side in one word: four of them cannot overflow into the other.
            let blue_red: u32 = words.iter().map(|word| word & 0x00ff_00ff).sum();
            let green: u32 = words.iter().map(|word| word >> 8 & 0xff).sum();
            let sums = [blue_red & 0xffff, green, blue_red >> 16];
            for (value, sum) in pixel.iter_mut().zip(sums) {
                *value = ((sum + empty * u32::from(*value) + 2) / 4) as u8;
            }
            for word in words {
                let which = (word >> 24).wrapping_sub(u32::from(first_band)) as usize;
                if let (Some(samples), Some(sum)) =
                    (band.samples.get_mut(which), band.sum_x.get_mut(which))
                {
                    *samples += 1;
                    *sum += x as u64;
                }
            }
        }
        even.fill(0);
        odd.fill(0);
        (touched, band)
    }
}

/// A colour channel along a row in 16.16 fixed point, held between its two ends.
#[derive(Clone, Copy)]
struct Ramp {
    first: i32,
    step: i32,
}

impl Ramp {
    fn between(first: f32, last: f32, run: f32) -> Self {
        let fixed = |value: f32| (value.clamp(0.0, 255.0) * 65536.0) as i32 + 32767;
        let (first, last) = (fixed(first).min(255 << 16), fixed(last).min(255 << 16));
        Self {
            first,
            step: ((last - first) as f32 / run.max(1.0)) as i32,
        }
    }

    fn at(self, i: i32) -> u32 {
        ((self.first + i * self.step) >> 16) as u32
    }
}
