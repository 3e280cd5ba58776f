//! Binary messages to pages: samples and sound.

/// A message with samples of the port at a place of the page's list.
pub(crate) fn samples(
    place: usize,
    lanes: usize,
    thinned: bool,
    (at_s, interval_s): (f64, f64),
    values: &[f32],
) -> Vec<u8> {
    let width = lanes * if thinned { 2 } else { 1 };
    let count = values.len() / width.max(1);
    let mut bytes = vec![2, place as u8, lanes as u8, u8::from(thinned)];
    bytes.extend((count as u32).to_le_bytes());
    bytes.extend(at_s.to_le_bytes());
    bytes.extend(interval_s.to_le_bytes());
    bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    bytes
}

/// A message with samples to play.
pub(crate) fn sound(at_s: f64, values: &[f32]) -> Vec<u8> {
    let mut bytes = vec![3, 0, 0, 0];
    bytes.extend((values.len() as u32).to_le_bytes());
    bytes.extend(at_s.to_le_bytes());
    bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    bytes
}
