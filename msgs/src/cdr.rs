//! Messages as bytes, as DDS sends and bags store them: four bytes that name the encoding, then CDR.

use byteorder::{BigEndian, LittleEndian};
use serde::{Serialize, de::DeserializeOwned};

/// Plain CDR, most significant byte first.
const BIG_ENDIAN: [u8; 2] = [0, 0];
/// Plain CDR, least significant byte first.
const LITTLE_ENDIAN: [u8; 2] = [0, 1];
const HEADER: usize = 4;
/// Writers may fill the end up to a multiple of four.
const PADDING: usize = 3;

/// Why bytes are not the message asked for, or a message cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum CdrError {
    /// A field breaks a bound of its type, or is too long to be counted.
    #[error("the message cannot be written as CDR: {0}")]
    Write(String),
    /// The bytes do not begin with the four of an encoding that ROS 2 uses.
    #[error(
        "the bytes are no CDR message: they begin with {0:02x?}, not 00 00 or 00 01; were they \
         written by something other than ROS 2?"
    )]
    Encoding(Vec<u8>),
    /// The bytes end too early or hold impossible values.
    #[error("{length} bytes do not hold the message: {reason}; is its type another one?")]
    Read {
        /// Bytes in all.
        length: usize,
        /// What the decoder said.
        reason: String,
    },
    /// The message ends before the bytes do.
    #[error("{left} of {length} bytes are left over behind the message; is its type another one?")]
    Leftover {
        /// Bytes behind the message.
        left: usize,
        /// Bytes in all.
        length: usize,
    },
}

/// The message with the header before it, little-endian.
///
/// # Errors
/// [`CdrError::Write`] if a field is longer than its type allows.
pub fn to_bytes<T: Serialize>(message: &T) -> Result<Vec<u8>, CdrError> {
    let mut bytes = Vec::with_capacity(HEADER + 2 * size_of::<T>());
    bytes.extend(LITTLE_ENDIAN);
    bytes.extend([0, 0]);
    cdr_encoding::to_writer::<T, LittleEndian, _>(&mut bytes, message)
        .map_err(|e| CdrError::Write(e.to_string()))?;
    Ok(bytes)
}

/// Reads a message of either byte order, with the header before it.
///
/// # Errors
/// The bytes are no CDR, end too early or too late, or break a bound.
pub fn from_bytes<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, CdrError> {
    let Some((header, body)) = bytes.split_first_chunk::<HEADER>() else {
        return Err(CdrError::Encoding(bytes.to_vec()));
    };
    let read = match [header[0], header[1]] {
        LITTLE_ENDIAN => cdr_encoding::from_bytes::<T, LittleEndian>(body),
        BIG_ENDIAN => cdr_encoding::from_bytes::<T, BigEndian>(body),
        _ => return Err(CdrError::Encoding(header.to_vec())),
    };
    let length = bytes.len();
    let (message, used) = read.map_err(|e| CdrError::Read { length, reason: e.to_string() })?;
    match body.len() - used {
        left if left > PADDING => Err(CdrError::Leftover { left, length }),
        _ => Ok(message),
    }
}
