//! The device protocol, version 1: one datagram for what a device senses, one in answer for what to drive.
//!
//! All numbers are little-endian, all units SI. `docs/device-protocol.md` describes it for those who write the other
//! side.

/// Bytes of a state packet.
pub const STATE_BYTES: usize = 120;
/// Bytes of a command packet.
pub const COMMAND_BYTES: usize = 72;
/// First bytes of every packet.
pub const MAGIC: [u8; 4] = *b"HGRF";
/// Of this protocol.
pub const VERSION: u16 = 1;

/// What no state holds anything beyond, in SI units: 1000 km, 1 MN.
pub const LARGEST: f64 = 1e6;

const STATE: u16 = 1;
const COMMAND: u16 = 2;
const HEADER_BYTES: usize = 24;

/// What a device senses.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct State {
    /// Grows by one with every packet, and begins again at zero after the largest number.
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

/// What to drive.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Command {
    /// Of the command.
    pub sequence: u32,
    /// Of the state that it answers.
    pub answers: u32,
    /// Timestamp of the state that it answers: what the device needs for the time of the round trip.
    pub timestamp_ns: u64,
    /// Force of the motors, N.
    pub force_n: [f64; 3],
    /// Current of the actuator, A.
    pub current_a: f64,
    /// Current of the brake, A.
    pub brake_a: f64,
    /// Is the graph running? If not, all of the above is zero and there is nothing to wait for.
    pub running: bool,
}

/// Why bytes are no packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum PacketError {
    /// Neither too long nor too short is taken.
    #[error("a packet of {got} bytes, where this kind has {wanted}")]
    Size {
        /// Bytes that came.
        got: usize,
        /// Bytes that it has.
        wanted: usize,
    },
    /// Not of this protocol, version or kind.
    #[error("not a packet of this protocol, version and kind")]
    Header,
    /// Something in it is not a finite number.
    #[error("something in the packet is not a finite number")]
    NotFinite,
    /// Something in it is beyond [`LARGEST`].
    #[error("something in the packet is beyond {LARGEST:e} in its SI unit")]
    TooLarge,
}

impl State {
    /// From the bytes of a packet.
    ///
    /// # Errors
    /// [`PacketError`] for anything but a whole, sound packet.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, PacketError> {
        let (sequence, _, timestamp_ns, numbers) = open::<12>(bytes, STATE, STATE_BYTES)?;
        if !are_within_reason(&numbers) {
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

    /// As a packet.
    pub fn to_bytes(&self) -> [u8; STATE_BYTES] {
        let mut bytes = [0; STATE_BYTES];
        let numbers = [
            self.position_m,
            self.orientation_rad,
            self.force_n,
            self.torque_n_m,
        ];
        close(
            &mut bytes,
            STATE,
            (self.sequence, 0),
            self.timestamp_ns,
            numbers.as_flattened(),
        );
        bytes
    }
}

/// Is nothing beyond [`LARGEST`]? One absurd number would stay in an integrator for the rest of a run.
pub(super) fn are_within_reason(numbers: &[f64]) -> bool {
    numbers.iter().all(|x| x.abs() <= LARGEST)
}

impl Command {
    /// From the bytes of a packet.
    ///
    /// # Errors
    /// [`PacketError`] for anything but a whole, sound packet.
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

    /// As a packet.
    pub fn to_bytes(&self) -> [u8; COMMAND_BYTES] {
        let mut bytes = [0; COMMAND_BYTES];
        let [x, y, z] = self.force_n;
        let numbers = [
            x,
            y,
            z,
            self.current_a,
            self.brake_a,
            f64::from(u8::from(self.running)),
        ];
        close(
            &mut bytes,
            COMMAND,
            (self.sequence, self.answers),
            self.timestamp_ns,
            &numbers,
        );
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
            assert_eq!(
                State::from_bytes(&bytes).is_ok(),
                length == STATE_BYTES,
                "{length}"
            );
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
