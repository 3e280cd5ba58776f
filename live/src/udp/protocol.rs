//! The device protocol, version 1: a state datagram from the device, and a command datagram in answer.
//!
//! All numbers are little-endian, all units SI. `docs/device-protocol.md` describes it for authors of the device's
//! side.

/// Bytes of a state packet.
pub(crate) const STATE_BYTES: usize = 120;
/// Bytes of a command packet.
pub(crate) const COMMAND_BYTES: usize = 72;
/// First bytes of every packet.
pub(crate) const MAGIC: [u8; 4] = *b"HGRF";
/// Version of this protocol.
pub(crate) const VERSION: u16 = 1;

/// Largest magnitude of a number in a state, in SI units: 1000 km, 1 MN.
pub(crate) const LARGEST: f64 = 1e6;

const STATE: u16 = 1;
const COMMAND: u16 = 2;
const HEADER_BYTES: usize = 24;

/// State of a device.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct State {
    /// Increases by one with every packet and wraps to zero.
    pub sequence: u32,
    /// The device's own clock, ns.
    pub timestamp_ns: u64,
    /// Position of the tip, m.
    pub position_m: [f64; 3],
    /// Orientation as a rotation vector, rad.
    pub orientation_rad: [f64; 3],
    /// Force on the tool, N.
    pub force_n: [f64; 3],
    /// Torque on the tool, N m.
    pub torque_n_m: [f64; 3],
}

/// Command to a device.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Command {
    /// Sequence number of the command.
    pub sequence: u32,
    /// Sequence number of the state that it answers.
    pub answers: u32,
    /// Timestamp of the state that it answers, from which the device computes the round trip.
    pub timestamp_ns: u64,
    /// Force of the motors, N.
    pub force_n: [f64; 3],
    /// Current of the actuator, A.
    pub current_a: f64,
    /// Current of the brake, A.
    pub brake_a: f64,
    /// True if the graph is running. If not, all numbers above are zero and no further command follows.
    pub running: bool,
}

/// Error of a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PacketError {
    /// The length is wrong.
    #[error("the packet has {got} bytes; this kind has {wanted}")]
    Size {
        /// Received bytes.
        got: usize,
        /// Bytes of this kind.
        wanted: usize,
    },
    /// The header has another protocol, version or kind.
    #[error("not a packet of this protocol, version and kind")]
    Header,
    /// A number is NaN or infinite.
    #[error("a number in the packet is NaN or infinite")]
    NotFinite,
    /// A number is beyond 1e6.
    #[error("a number in the packet is beyond {LARGEST:e} in its SI unit")]
    TooLarge,
}

impl State {
    /// Parses a packet.
    ///
    /// # Errors
    /// [`PacketError`] if the packet is invalid.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, PacketError> {
        let (sequence, _, timestamp_ns, numbers) = open::<12>(bytes, STATE, STATE_BYTES)?;
        if !are_in_range(&numbers) {
            return Err(PacketError::TooLarge);
        }
        let three = |first: usize| std::array::from_fn(|i| numbers[first + i]);
        Ok(Self {
            sequence,
            timestamp_ns,
            position_m: three(0),
            orientation_rad: three(3),
            force_n: three(6),
            torque_n_m: three(9),
        })
    }

    /// Encodes a packet.
    pub fn to_bytes(&self) -> [u8; STATE_BYTES] {
        let mut bytes = [0; STATE_BYTES];
        let numbers = [self.position_m, self.orientation_rad, self.force_n, self.torque_n_m];
        close(&mut bytes, STATE, (self.sequence, 0), self.timestamp_ns, numbers.as_flattened());
        bytes
    }
}

/// True if all numbers are within [`LARGEST`]. An integrator would keep a huge number for the rest of a run.
pub(crate) fn are_in_range(numbers: &[f64]) -> bool {
    numbers.iter().all(|x| x.abs() <= LARGEST)
}

impl Command {
    /// Parses a packet.
    ///
    /// # Errors
    /// [`PacketError`] if the packet is invalid.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, PacketError> {
        let (sequence, answers, timestamp_ns, numbers) = open::<6>(bytes, COMMAND, COMMAND_BYTES)?;
        let [x, y, z, current_a, brake_a, running] = numbers;
        Ok(Self {
            sequence,
            answers,
            timestamp_ns,
            force_n: [x, y, z],
            current_a,
            brake_a,
            running: running != 0.0,
        })
    }

    /// Encodes a packet.
    pub fn to_bytes(&self) -> [u8; COMMAND_BYTES] {
        let mut bytes = [0; COMMAND_BYTES];
        let [x, y, z] = self.force_n;
        let numbers = [x, y, z, self.current_a, self.brake_a, f64::from(u8::from(self.running))];
        close(&mut bytes, COMMAND, (self.sequence, self.answers), self.timestamp_ns, &numbers);
        bytes
    }
}

fn open<const N: usize>(
    bytes: &[u8],
    kind: u16,
    wanted: usize,
) -> Result<(u32, u32, u64, [f64; N]), PacketError> {
    if bytes.len() != wanted {
        let got = bytes.len();
        return Err(PacketError::Size { got, wanted });
    }
    let word = |at: usize| u32::from_le_bytes(std::array::from_fn(|i| bytes[at + i]));
    let long = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| bytes[at + i]));
    if bytes[..4] != MAGIC || word(4) != (u32::from(kind) << 16 | u32::from(VERSION)) {
        return Err(PacketError::Header);
    }
    let numbers: [f64; N] = std::array::from_fn(|i| f64::from_bits(long(HEADER_BYTES + 8 * i)));
    if !numbers.iter().all(|x| x.is_finite()) {
        return Err(PacketError::NotFinite);
    }
    Ok((word(8), word(12), long(16), numbers))
}

fn close(bytes: &mut [u8], kind: u16, (sequence, answers): (u32, u32), timestamp_ns: u64, numbers: &[f64]) {
    bytes[..4].copy_from_slice(&MAGIC);
    bytes[4..6].copy_from_slice(&VERSION.to_le_bytes());
    bytes[6..8].copy_from_slice(&kind.to_le_bytes());
    bytes[8..12].copy_from_slice(&sequence.to_le_bytes());
    bytes[12..16].copy_from_slice(&answers.to_le_bytes());
    bytes[16..24].copy_from_slice(&timestamp_ns.to_le_bytes());
    for (chunk, number) in bytes[HEADER_BYTES..].chunks_exact_mut(8).zip(numbers) {
        chunk.copy_from_slice(&number.to_le_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state() -> State {
        State {
            sequence: 7,
            timestamp_ns: 123_456_789_012,
            position_m: [0.01, -0.02, 0.03],
            orientation_rad: [0.1, 0.2, -0.3],
            force_n: [0.5, 0.0, 1.25],
            torque_n_m: [1e-3, -2e-3, 0.0],
        }
    }

    #[test]
    fn packets_come_back_as_they_were() {
        assert_eq!(State::from_bytes(&state().to_bytes()), Ok(state()));
        let command = Command {
            sequence: u32::MAX,
            answers: 3,
            timestamp_ns: u64::MAX,
            force_n: [1.0, 2.0, -3.0],
            current_a: 0.25,
            brake_a: -0.1,
            running: true,
        };
        assert_eq!(Command::from_bytes(&command.to_bytes()), Ok(command));
    }

    #[test]
    fn the_layout_is_the_documented_one() {
        let bytes = state().to_bytes();
        assert_eq!(&bytes[..12], b"HGRF\x01\x00\x01\x00\x07\x00\x00\x00");
        assert_eq!(bytes[16..24], 123_456_789_012_u64.to_le_bytes());
        assert_eq!(bytes[24..32], 0.01_f64.to_le_bytes());
        assert_eq!(bytes[72..80], 0.5_f64.to_le_bytes());
        assert_eq!(bytes[112..120], 0.0_f64.to_le_bytes());
    }

    #[test]
    fn anything_else_is_refused() {
        let good = state().to_bytes();
        for length in 0..200 {
            let mut bytes = good.to_vec();
            bytes.resize(length, 0);
            assert_eq!(State::from_bytes(&bytes).is_ok(), length == STATE_BYTES, "{length}");
        }
        for at in 0..8 {
            let mut bytes = good;
            bytes[at] ^= 1;
            assert_eq!(State::from_bytes(&bytes), Err(PacketError::Header), "{at}");
        }
        for number in 0..12 {
            for (evil, wrong) in [
                (f64::NAN, PacketError::NotFinite),
                (f64::INFINITY, PacketError::NotFinite),
                (f64::NEG_INFINITY, PacketError::NotFinite),
                (1e308, PacketError::TooLarge),
                (-LARGEST.next_up(), PacketError::TooLarge),
            ] {
                let mut bytes = good;
                bytes[24 + 8 * number..32 + 8 * number].copy_from_slice(&evil.to_le_bytes());
                assert_eq!(State::from_bytes(&bytes), Err(wrong), "{evil}");
            }
        }
        assert!(Command::from_bytes(&good).is_err());
    }
}
