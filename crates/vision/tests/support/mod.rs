//! Random frames of every format, and their marker pixels by the definitions.

#![allow(dead_code, unused_imports, reason = "each test uses a part")]

mod anywhere;
mod discs;
mod settings;

pub use anywhere::Anywhere;
pub use discs::Discs;
use proptest::prelude::*;
pub use settings::SETTINGS;
use tautscope_vision::{Image, PixelFormat};

/// An image and the memory it lies in.
#[derive(Clone, Debug)]
pub struct Memory {
    pub data: Vec<u8>,
    pub format: PixelFormat,
    pub width: usize,
    pub height: usize,
    pub stride: usize,
}

impl Memory {
    pub fn frame(&self) -> Image<'_> {
        Image::new(
            &self.data,
            self.format,
            [self.width, self.height],
            self.stride,
        )
        .unwrap()
    }

    /// The channels of a pixel: B, G, R or Y, U, V.
    pub fn pixel(&self, u: usize, v: usize) -> [u8; 3] {
        let at = |line: usize, byte: usize| self.data[line * self.stride + byte];
        let (half, pair) = (self.width / 2, u / 2);
        let planar = |row: usize| at(self.height + row / 2, row % 2 * half + pair);
        match self.format {
            PixelFormat::Bgr => [at(v, 3 * u), at(v, 3 * u + 1), at(v, 3 * u + 2)],
            PixelFormat::Rgb => [at(v, 3 * u + 2), at(v, 3 * u + 1), at(v, 3 * u)],
            PixelFormat::Bgra => [at(v, 4 * u), at(v, 4 * u + 1), at(v, 4 * u + 2)],
            PixelFormat::Yuyv => [at(v, 2 * u), at(v, 4 * pair + 1), at(v, 4 * pair + 3)],
            PixelFormat::Uyvy => [at(v, 2 * u + 1), at(v, 4 * pair), at(v, 4 * pair + 2)],
            PixelFormat::Nv12 => {
                let line = self.height + v / 2;
                [at(v, u), at(line, 2 * pair), at(line, 2 * pair + 1)]
            }
            PixelFormat::I420 => [at(v, u), planar(v / 2), planar(self.height / 2 + v / 2)],
        }
    }

    /// Weights of the channels and the sum at black: the weights of B, G, R through ITU-R BT.601, as
    /// the standard's numbers are printed (Y' to B'G'R', limited range, to nine digits).
    pub fn weights(&self, [blue, green, red]: [f64; 3]) -> ([f64; 3], f64) {
        if matches!(
            self.format,
            PixelFormat::Bgr | PixelFormat::Rgb | PixelFormat::Bgra
        ) {
            return ([blue, green, red], 0.0);
        }
        let luma = 1.164_383_562 * (blue + green + red);
        let u = 2.017_232_143 * blue - 0.391_762_290 * green;
        let v = 1.596_026_786 * red - 0.812_967_647 * green;
        ([luma, u, v], -16.0 * luma - 128.0 * (u + v))
    }

    /// The marker pixels by row, by the definitions of the discriminant and of the low-pass.
    pub fn mask(&self, weights: [f64; 3], threshold: f64, passes: usize) -> Vec<Vec<bool>> {
        let (weights, constant) = self.weights(weights);
        let corner = |sign: f64| {
            let side: f64 = weights.iter().map(|w| (sign * w).max(0.0)).sum();
            (constant + sign * 255.0 * side).abs()
        };
        let half = weights.iter().map(|w| 128.0 * w.abs()).fold(0.0, f64::max);
        let scale = 8190.0 / corner(1.0).max(corner(-1.0)).max(half);
        let fixed = |value: f64| (value * scale * 512.0).round();
        let mut values: Vec<Vec<f64>> = (0..self.height)
            .map(|v| {
                let project = |u| {
                    let terms = weights.iter().zip(self.pixel(u, v));
                    let sum: f64 = terms.map(|(w, x)| fixed(*w) * f64::from(x)).sum();
                    ((sum + fixed(constant)) / 512.0 + 0.5).floor()
                };
                (0..self.width).map(project).collect()
            })
            .collect();
        let mean = |a: f64, b: f64, c: f64| ((a + 2.0 * b + c) / 4.0 + 0.5).floor();
        for _ in 0..passes {
            let (right, bottom) = (self.width - 1, self.height - 1);
            let along: Vec<Vec<f64>> = values
                .iter()
                .map(|row| {
                    let at =
                        |u: usize| mean(row[u.saturating_sub(1)], row[u], row[(u + 1).min(right)]);
                    (0..self.width).map(at).collect()
                })
                .collect();
            for (v, row) in values.iter_mut().enumerate() {
                let (above, below) = (&along[v.saturating_sub(1)], &along[(v + 1).min(bottom)]);
                for (u, value) in row.iter_mut().enumerate() {
                    *value = mean(above[u], along[v][u], below[u]);
                }
            }
        }
        let level = (threshold * scale).floor().clamp(-32768.0, 32767.0);
        let marker = |row: Vec<f64>| row.into_iter().map(|value| value > level).collect();
        values.into_iter().map(marker).collect()
    }
}

/// A format.
pub fn format() -> impl Strategy<Value = PixelFormat> {
    prop::sample::select(&PixelFormat::ALL[..])
}

/// Format, width, height, and padding of each line (bytes).
pub fn layout(sides: [usize; 2]) -> impl Strategy<Value = (PixelFormat, usize, usize, usize)> {
    (format(), 1..=sides[0], 1..=sides[1], 0..5_usize).prop_map(
        |(format, mut width, mut height, padding)| {
            if format.shares_columns() {
                width = width.next_multiple_of(2);
            }
            if format.shares_rows() {
                height = height.next_multiple_of(2);
            }
            (format, width, height, padding)
        },
    )
}

/// Frames of one colour with a few rectangles of others, with noise or of noise alone.
pub fn memory(sides: [usize; 2]) -> impl Strategy<Value = Memory> {
    let patches = prop::collection::vec(any::<(u16, u16, u8, u8, [u8; 4])>(), 0..6);
    let noise = prop_oneof![Just(0_u8), 1..20_u8, Just(255)];
    (
        layout(sides),
        any::<[u8; 4]>(),
        patches,
        noise,
        any::<u32>(),
    )
        .prop_map(
            |((format, width, height, padding), ground, patches, noise, mut seed)| {
                let stride = format.line_bytes(width) + padding;
                let lines = format.lines(height);
                let mut data: Vec<u8> = (0..stride * lines)
                    .map(|i| ground[i % stride % 4])
                    .collect();
                for (left, top, columns, rows, colour) in patches {
                    let (left, top) = (usize::from(left) % stride, usize::from(top) % lines);
                    for line in top..(top + usize::from(rows) / 8).min(lines) {
                        for byte in left..(left + usize::from(columns)).min(stride) {
                            data[line * stride + byte] = colour[byte % 4];
                        }
                    }
                }
                for byte in &mut data {
                    seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                    let random = (seed >> 24) as u8;
                    *byte = if noise == 255 {
                        random
                    } else {
                        byte.wrapping_add(random % (noise + 1))
                    };
                }
                Memory {
                    data,
                    format,
                    width,
                    height,
                    stride,
                }
            },
        )
}

/// Weights of B, G, R.
pub fn weights() -> impl Strategy<Value = [f64; 3]> {
    prop_oneof![
        Just([-0.2, 1.0, -0.8]),
        prop::array::uniform3(-2.0..2.0_f64),
        Just([1.0, 1.0, 1.0]),
        Just([0.0, -1.0, 0.0]),
    ]
}
