//! Vectors in space as plain arrays, `[x, y, z]`.

/// A point, direction or force in space.
pub type Vec3 = [f64; 3];

/// The null vector.
pub const ZERO: Vec3 = [0.0; 3];

/// a + b
#[inline]
pub fn add<const N: usize>(a: [f64; N], b: [f64; N]) -> [f64; N] {
    std::array::from_fn(|i| a[i] + b[i])
}

/// a - b
#[inline]
pub fn sub<const N: usize>(a: [f64; N], b: [f64; N]) -> [f64; N] {
    std::array::from_fn(|i| a[i] - b[i])
}

/// a s
#[inline]
pub fn scale<const N: usize>(a: [f64; N], s: f64) -> [f64; N] {
    a.map(|x| x * s)
}

/// a + b s
#[inline]
pub fn add_scaled<const N: usize>(a: [f64; N], b: [f64; N], s: f64) -> [f64; N] {
    std::array::from_fn(|i| a[i] + b[i] * s)
}

/// a . b
#[inline]
pub fn dot<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 {
    a.iter().zip(&b).map(|(x, y)| x * y).sum()
}

/// a x b
#[inline]
pub fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// |a|
#[inline]
pub fn norm<const N: usize>(a: [f64; N]) -> f64 {
    dot(a, a).sqrt()
}

/// |a - b|
#[inline]
pub fn distance<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 {
    norm(sub(a, b))
}

/// a / |a|; `None` if a is null or not finite.
#[inline]
pub fn direction<const N: usize>(a: [f64; N]) -> Option<[f64; N]> {
    let length = norm(a);
    (length > 0.0 && length.is_finite()).then(|| scale(a, 1.0 / length))
}

/// The part of `a` perpendicular to the unit vector `n`.
#[inline]
pub fn reject(a: Vec3, n: Vec3) -> Vec3 {
    add_scaled(a, n, -dot(a, n))
}

/// Two unit vectors that make a right-handed frame with the unit vector `n` as its third axis.
pub fn tangents(n: Vec3) -> [Vec3; 2] {
    // The axis furthest from n: the cross product is at least sqrt(2/3) long.
    let mut axis = ZERO;
    let smallest = (0..3).fold(0, |best, i| if n[i].abs() < n[best].abs() { i } else { best });
    axis[smallest] = 1.0;
    let first = direction(cross(axis, n)).unwrap_or([1.0, 0.0, 0.0]);
    [first, cross(n, first)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tangents_make_a_right_handed_frame() {
        for n in [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [0.6, 0.0, 0.8], [-0.36, 0.48, 0.8]] {
            let [a, b] = tangents(n);
            assert!(distance(cross(a, b), n) < 1e-15);
            assert!(dot(a, n).abs() < 1e-15 && dot(b, n).abs() < 1e-15);
        }
    }

    #[test]
    fn a_null_vector_has_no_direction() {
        assert_eq!(direction(ZERO), None);
        assert_eq!(direction([f64::NAN, 0.0, 0.0]), None);
    }
}
