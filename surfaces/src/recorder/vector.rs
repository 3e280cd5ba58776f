//! Vectors of three components and rotations.

/// The scalar product.
pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a + scale b`.
pub fn along(a: [f64; 3], scale: f64, b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] + scale * b[i])
}

/// `v` turned by the unit quaternion w, x, y, z.
pub fn rotate([w, x, y, z]: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let axis = [x, y, z];
    let twice = cross(axis, v).map(|c| 2.0 * c);
    along(along(v, w, twice), 1.0, cross(axis, twice))
}
