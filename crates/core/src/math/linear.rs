//! Vectors in three dimensions, small linear systems, and the function sinc with its derivative.

pub type Vector = [f64; 3];

/// A matrix as three rows.
pub type Matrix = [Vector; 3];

pub fn dot([ax, ay, az]: Vector, [bx, by, bz]: Vector) -> f64 {
    ax * bx + ay * by + az * bz
}

/// `a + factor b`.
pub fn add([ax, ay, az]: Vector, factor: f64, [bx, by, bz]: Vector) -> Vector {
    [ax + factor * bx, ay + factor * by, az + factor * bz]
}

pub fn scale(factor: f64, vector: Vector) -> Vector {
    vector.map(|value| factor * value)
}

pub fn rotate(rows: &Matrix, vector: Vector) -> Vector {
    rows.map(|row| dot(row, vector))
}

/// sin(x) / x.
pub fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { libm::sin(x) / x }
}

/// d/dx sin(x) / x = (x cos x - sin x) / x^2, by its series where that difference cancels.
pub fn sinc_slope(x: f64) -> f64 {
    if x.abs() >= 1.0 {
        return (libm::cos(x) - sinc(x)) / x;
    }
    // Term k + 1 over term k is -x^2 / (2 k (2 k + 3)); the ninth is below rounding at |x| = 1.
    let square = x * x;
    let tail = [304.0, 238.0, 180.0, 130.0, 88.0, 54.0, 28.0, 10.0]
        .iter()
        .fold(1.0, |sum, divisor| 1.0 - square / divisor * sum);
    -x / 3.0 * tail
}

/// Right-handed cross product.
pub fn cross([ax, ay, az]: Vector, [bx, by, bz]: Vector) -> Vector {
    [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]
}

pub fn square(x: f64) -> f64 {
    x * x
}
