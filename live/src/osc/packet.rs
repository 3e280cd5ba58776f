//! Packets of Open Sound Control.

use haptograph_nodes::network::link::Count;
use rosc::{OscMessage, OscPacket};

/// Bundles in a packet, one within the other or beside it.
const MAX_BUNDLES: usize = 8;
/// Arrays in a packet, or brackets in its texts; nobody here reads arrays.
const MAX_ARRAYS: usize = 64;

/// The packet that `bytes` are, all of them.
pub(crate) fn decode(bytes: &[u8]) -> Result<OscPacket, Count> {
    // The decoder follows bundles within bundles as deep as they go.
    if bytes.windows(8).filter(|word| word == b"#bundle\0").count() > MAX_BUNDLES {
        return Err(Count::Malformed);
    }
    // It builds arrays within arrays without end, and taking these apart again overflows the stack.
    if bytes.iter().filter(|byte| **byte == b'[').count() > MAX_ARRAYS {
        return Err(Count::Malformed);
    }
    match rosc::decoder::decode_udp(bytes) {
        Ok(([], packet)) => Ok(packet),
        _ => Err(Count::Malformed),
    }
}

/// Does something with every message of a packet; bundles are taken at once.
pub(crate) fn each_message(packet: &OscPacket, each: &mut impl FnMut(&OscMessage)) {
    match packet {
        OscPacket::Message(message) => each(message),
        OscPacket::Bundle(bundle) => bundle.content.iter().for_each(|inner| each_message(inner, each)),
    }
}
