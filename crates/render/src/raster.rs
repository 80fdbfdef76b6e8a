use core::ops::Range;

/// Samples per pixel along x and along y.
const FINE: usize = 2;

/// A corner of the mesh in the image.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Vertex {
    /// Position (px), pixel centres at whole numbers.
    pub(crate) at: [f32; 2],
    /// 1 / depth (1/m); 0 marks a corner that cannot be drawn.
    pub(crate) nearness: f32,
    /// Blue, green, red, 0 to 255.
    pub(crate) colour: [f32; 3],
}

/// The image at 2x2 samples per pixel, each with the nearest surface.
///
/// Sample (i, j) lies at x = (i + 1/2 + s) / 2 - 1/2 and y = (j + 1/2) / 2 - 1/2 (px); the shift s
/// is -1/4 in even rows and 1/4 in odd ones, so that vertical edges get four steps. Memory outside the spans that
/// were drawn is neither cleared nor read.
pub(crate) struct Samples {
    width: usize,
    height: usize,
    nearness: Vec<f32>,
    /// 1, red, green, blue from the highest byte to the lowest; 0 is nothing.
    paint: Vec<u32>,
    /// Samples drawn to, per row of samples.
    spans: Vec<Range<usize>>,
    /// Rows of samples that are drawn.
    rows: Range<usize>,
}

impl Samples {
    /// For an image of this size (px).
    pub(crate) fn new(width: usize, height: usize) -> Self {
        let (width, height) = (FINE * width, FINE * height);
        Self {
            width,
            height,
            nearness: vec![0.0; width * height],
            paint: vec![0; width * height],
            spans: vec![0..0; height],
            rows: 0..height,
        }
    }

    /// Draws only within these rows of the image from now on.
    pub(crate) fn clip(&mut self, rows: Range<usize>) {
        let sample = |row: usize| (FINE * row).min(self.height);
        self.rows = sample(rows.start)..sample(rows.end);
    }

    /// Draws one triangle of either orientation with colours interpolated between its corners.
    ///
    /// A sample on an edge that two triangles share is drawn by exactly one of them.
    pub(crate) fn triangle(&mut self, corners: [&Vertex; 3]) {
        if corners.iter().any(|corner| corner.nearness <= 0.0) {
            return;
        }
        let [mut va, mut vb, mut vc] = corners;
        if vb.at[1] < va.at[1] {
            (va, vb) = (vb, va);
        }
        if vc.at[1] < va.at[1] {
            (va, vc) = (vc, va);
        }
        if vc.at[1] < vb.at[1] {
            (vb, vc) = (vc, vb);
        }
        let [a, b, c] = [va, vb, vc].map(|v| v.at.map(|x| FINE as f32 * (x + 0.5) - 0.5));
        let top = ceil(a[1], self.height).max(self.rows.start);
        let bottom = ceil(c[1], self.height).min(self.rows.end);
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        if top >= bottom || area == 0.0 {
            return;
        }
        let scale = 1.0 / area;
        let near = Plane::through([a, b, c], scale, [va.nearness, vb.nearness, vc.nearness]);
        let hue = [0, 1, 2].map(|k| {
            let colours = [va.colour[k], vb.colour[k], vc.colour[k]];
            Fixed::from(Plane::through([a, b, c], scale, colours))
        });
        let long = (c[0] - a[0]) / (c[1] - a[1]);
        let upper = (b[0] - a[0]) / (b[1] - a[1]);
        let lower = (c[0] - b[0]) / (c[1] - b[1]);
        let memory = top * self.width..bottom * self.width;
        let (Some(nearness), Some(paint), Some(spans)) = (
            self.nearness.get_mut(memory.clone()),
            self.paint.get_mut(memory),
            self.spans.get_mut(top..bottom),
        ) else {
            return;
        };
        let rows = nearness
            .chunks_exact_mut(self.width)
            .zip(paint.chunks_exact_mut(self.width));
        for ((row, span), (nearness, paint)) in (top..).zip(spans).zip(rows) {
            let y = row as f32;
            let one = a[0] + (y - a[1]) * long;
            let other = if y < b[1] {
                a[0] + (y - a[1]) * upper
            } else {
                b[0] + (y - b[1]) * lower
            };
            let shift = shift(row);
            let left = ceil(one.min(other) - shift, self.width);
            let right = ceil(one.max(other) - shift, self.width);
            let (Some(nearness), Some(paint)) =
                (nearness.get_mut(left..right), paint.get_mut(left..right))
            else {
                continue;
            };
            if nearness.is_empty() {
                continue;
            }
            *span = if span.start < span.end {
                span.start.min(left)..span.end.max(right)
            } else {
                left..right
            };
            let first = near.at(left as f32 + shift, y);
            let [blue, green, red] = hue.map(|hue| hue.at(left as i32, row as i32));
            for (i, (nearest, word)) in nearness.iter_mut().zip(paint).enumerate() {
                let i = i as i32;
                let here = first + i as f32 * near.gradient[0];
                let level = |start: i32, k: usize| {
                    start.wrapping_add(i.wrapping_mul(hue[k].gradient[0])) as u32 & 0x00ff_0000
                };
                let new = DRAWN | level(red, 2) | level(green, 1) >> 8 | level(blue, 0) >> 16;
                // By mask: a branch here would be unpredictable.
                let front = u32::from(here > *nearest).wrapping_neg();
                *word = (new & front) | (*word & !front);
                *nearest = if here > *nearest { here } else { *nearest };
            }
        }
    }

    /// Whether `at` (px) is outside the image or behind something nearer than `limit` (1/m).
    pub(crate) fn hides(&self, at: [f32; 2], limit: f32) -> bool {
        let [x, y] = at.map(|x| (FINE as f32 * (x + 0.5)).floor());
        let inside = x >= 0.0 && y >= 0.0 && x < self.width as f32 && y < self.height as f32;
        let sample = self.nearness.get(y as usize * self.width + x as usize);
        !inside || sample.is_none_or(|nearest| *nearest > limit)
    }

    /// Blends row `y` of the drawing over the tissue in `pixels` (3 bytes each), and clears it for the next
    /// image.
    pub(crate) fn resolve(&mut self, y: usize, pixels: &mut [u8]) {
        let mut touched = 0..0;
        for span in self.spans.iter_mut().skip(FINE * y).take(FINE) {
            if span.start < span.end {
                let (start, end) = (span.start / FINE, span.end.div_ceil(FINE));
                touched = if touched.start < touched.end {
                    touched.start.min(start)..touched.end.max(end)
                } else {
                    start..end
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
            return;
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
            return;
        };
        let quads = even.chunks_exact(FINE).zip(odd.chunks_exact(FINE));
        for (quad, pixel) in quads.zip(pixels.chunks_exact_mut(3)) {
            // Blue and red share a word: sums of four values do not overflow into each other.
            let (mut blue_red, mut green, mut drawn) = (0, 0, 0);
            for word in quad.0.iter().chain(quad.1) {
                blue_red += word & 0x00ff_00ff;
                green += word >> 8 & 0xff;
                drawn += word >> 24;
            }
            let sums = [blue_red & 0xffff, green, blue_red >> 16];
            for (value, sum) in pixel.iter_mut().zip(sums) {
                *value = ((sum + (4 - drawn) * u32::from(*value) + 2) / 4) as u8;
            }
        }
        even.fill(0);
        odd.fill(0);
    }
}

/// Marks a sample that shows the instrument.
const DRAWN: u32 = 1 << 24;

/// Shift of the samples of a row from the regular grid (samples).
fn shift(row: usize) -> f32 {
    if row & 1 == 0 { -0.25 } else { 0.25 }
}

/// Steepest gradient that is interpolated (per sample); a narrower sliver is drawn in one colour.
const STEEPEST: f32 = 8192.0;

/// A quantity that is linear in the image.
#[derive(Clone, Copy)]
struct Plane {
    from: [f32; 2],
    value: f32,
    gradient: [f32; 2],
}

impl Plane {
    /// With `values` at the three `corners` (samples) of a triangle; `scale` is 1 over twice its
    /// area.
    fn through(corners: [[f32; 2]; 3], scale: f32, values: [f32; 3]) -> Self {
        let [a, b, c] = corners;
        let (fb, fc) = (values[1] - values[0], values[2] - values[0]);
        let gradient = [
            (fb * (c[1] - a[1]) - fc * (b[1] - a[1])) * scale,
            (fc * (b[0] - a[0]) - fb * (c[0] - a[0])) * scale,
        ];
        let is_interpolated = gradient.iter().all(|g| g.abs() < STEEPEST);
        Self {
            from: a,
            value: values[0],
            gradient: if is_interpolated { gradient } else { [0.0; 2] },
        }
    }

    fn at(&self, x: f32, y: f32) -> f32 {
        self.value + (x - self.from[0]) * self.gradient[0] + (y - self.from[1]) * self.gradient[1]
    }
}

/// A plane of grey levels in 16.16 fixed point: its sums are exact modulo 2^32.
#[derive(Clone, Copy)]
struct Fixed {
    from: [i32; 2],
    value: i32,
    gradient: [i32; 2],
}

impl From<Plane> for Fixed {
    fn from(plane: Plane) -> Self {
        let from = plane.from.map(|x| x as i32);
        let value = plane.at(from[0] as f32, from[1] as f32);
        Self {
            from,
            value: (value * 65536.0) as i32,
            gradient: plane.gradient.map(|g| (g * 65536.0) as i32),
        }
    }
}

impl Fixed {
    fn at(&self, x: i32, y: i32) -> i32 {
        let [dx, dy] = [x - self.from[0], y - self.from[1]];
        self.value
            .wrapping_add(dx.wrapping_mul(self.gradient[0]))
            .wrapping_add(dy.wrapping_mul(self.gradient[1]))
    }
}

/// The first whole number not below `x`, from 0 to `most`.
fn ceil(x: f32, most: usize) -> usize {
    let x = x.clamp(0.0, most as f32);
    let whole = x as i32;
    (whole + i32::from((whole as f32) < x)) as usize
}
