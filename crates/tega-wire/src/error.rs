//! What can be wrong with the input.

use tega_error::OutOfRange;

/// An input that cannot be encoded, or a packet that cannot be decoded; the message names the thing, its value and
/// its unit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WireError {
    /// A number is out of its range or not finite.
    #[error(transparent)]
    OutOfRange(#[from] OutOfRange),
    /// A decoder was asked for with a setting it does not have.
    #[error(transparent)]
    Setting(OutOfRange),
    /// An array has the wrong number of elements.
    #[error("{name} has {got} elements, {wanted} are needed")]
    Length {
        /// The array.
        name: &'static str,
        /// Its length.
        got: usize,
        /// What would be accepted.
        wanted: &'static str,
    },
    /// A packet has the wrong number of bytes.
    #[error("{packet} of {got} bytes, {wanted} are needed")]
    PacketLength {
        /// The kind of packet.
        packet: &'static str,
        /// Its length.
        got: usize,
        /// What would be accepted.
        wanted: &'static str,
    },
    /// A name is empty, or none that is known.
    #[error("{name} is empty")]
    Empty {
        /// The argument.
        name: &'static str,
    },
    /// A field of a packet has a value the format does not have.
    #[error("{packet}: {field} is {got:#x}, {wanted} is needed")]
    Field {
        /// The kind of packet.
        packet: &'static str,
        /// The field.
        field: &'static str,
        /// The value found.
        got: u32,
        /// What would be accepted.
        wanted: &'static str,
    },
    /// The checksum in a packet is not that of its bytes.
    #[error("{packet}: the checksum in the packet is {got:#010x}, its bytes give {computed:#010x}")]
    Checksum {
        /// The kind of packet.
        packet: &'static str,
        /// The checksum found.
        got: u32,
        /// The checksum computed.
        computed: u32,
    },
}

impl WireError {
    /// The next step for the person who reads the message; empty where the message says it all.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::OutOfRange(OutOfRange { unit: "tau", .. }) => {
                "stop the controller and look for the NaN or overflow in its inputs; no torque is sent from it"
            }
            Self::Checksum { .. } | Self::Field { .. } | Self::PacketLength { .. } => {
                "drop the packet and count it; if it repeats, the two ends use different versions"
            }
            Self::OutOfRange(_) | Self::Setting { .. } | Self::Length { .. } | Self::Empty { .. } => "",
        }
    }
}
