//! Packets of Open Sound Control.

use haptograph_nodes::network::link::Count;
use rosc::{OscMessage, OscPacket};

/// Maximum number of bundles in a packet, nested or side by side.
const MAX_BUNDLES: usize = 8;
/// Maximum number of arrays in a packet, or brackets in its texts; no message here has arrays.
const MAX_ARRAYS: usize = 64;

/// Decodes a packet, which must take up all bytes.
pub(crate) fn decode(bytes: &[u8]) -> Result<OscPacket, Count> {
    // The decoder follows nested bundles without limit.
    if bytes.windows(8).filter(|word| word == b"#bundle\0").count() > MAX_BUNDLES {
        return Err(Count::Malformed);
    }
    // It nests arrays without limit; dropping them overflows the stack.
    if bytes.iter().filter(|byte| **byte == b'[').count() > MAX_ARRAYS {
        return Err(Count::Malformed);
    }
    match rosc::decoder::decode_udp(bytes) {
        Ok(([], packet)) => Ok(packet),
        _ => Err(Count::Malformed),
    }
}

/// Calls `each` with every message of a packet; bundles apply at once.
pub(crate) fn each_message(packet: &OscPacket, each: &mut impl FnMut(&OscMessage)) {
    match packet {
        OscPacket::Message(message) => each(message),
        OscPacket::Bundle(bundle) => bundle.content.iter().for_each(|inner| each_message(inner, each)),
    }
}
