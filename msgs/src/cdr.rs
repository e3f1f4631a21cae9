//! Messages as bytes, as DDS sends and bags store them: the encapsulation header, four bytes that
//! name the encoding, then CDR.
//!
//! ```
//! use puffer_msgs::cdr;
//! use puffer_msgs::std_msgs::msg::Header;
//!
//! let header = Header { frame_id: "sensor".to_owned(), ..Header::default() };
//! let bytes = cdr::to_bytes(&header)?;
//! assert_eq!(bytes[..4], [0, 1, 0, 0]);
//! assert_eq!(cdr::from_bytes::<Header>(&bytes)?, header);
//! assert!(cdr::from_bytes::<Header>(&bytes[..7]).is_err());
//! # Ok::<(), cdr::CdrError>(())
//! ```

use byteorder::{BigEndian, LittleEndian};
use serde::{Serialize, de::DeserializeOwned};

/// Representation identifier of plain CDR, most significant byte first.
const BIG_ENDIAN: [u8; 2] = [0, 0];
/// Representation identifier of plain CDR, least significant byte first.
const LITTLE_ENDIAN: [u8; 2] = [0, 1];
/// Length of the encapsulation header.
const ENCAPSULATION_BYTES: usize = 4;
/// Writers may fill the end up to a multiple of four bytes.
const MAX_PADDING_BYTES: usize = 3;

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
        /// Number of bytes in all.
        length: usize,
        /// What the decoder said.
        reason: String,
    },
    /// Bytes are left over behind the message.
    #[error("{left} of {length} bytes are left over behind the message; is its type another one?")]
    Leftover {
        /// Number of bytes behind the message.
        left: usize,
        /// Number of bytes in all.
        length: usize,
    },
}

/// The message as little-endian CDR, behind the encapsulation header.
///
/// # Errors
/// [`CdrError::Write`] if a field is longer than its type allows.
pub fn to_bytes<T: Serialize>(message: &T) -> Result<Vec<u8>, CdrError> {
    let mut bytes = Vec::with_capacity(ENCAPSULATION_BYTES + 2 * size_of::<T>());
    bytes.extend(LITTLE_ENDIAN);
    bytes.extend([0, 0]);
    cdr_encoding::to_writer::<T, LittleEndian, _>(&mut bytes, message)
        .map_err(|e| CdrError::Write(e.to_string()))?;
    Ok(bytes)
}

/// Reads a message of either byte order, behind the encapsulation header.
///
/// # Errors
/// If the bytes are no CDR, end too early or too late, or break a bound of the type.
pub fn from_bytes<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, CdrError> {
    let Some((header, body)) = bytes.split_first_chunk::<ENCAPSULATION_BYTES>() else {
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
        left if left > MAX_PADDING_BYTES => Err(CdrError::Leftover { left, length }),
        _ => Ok(message),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin_interfaces::msg::Time;

    #[test]
    fn both_byte_orders_are_read() {
        let time = Time { sec: 258, nanosec: 5 };
        let little = [0, 1, 0, 0, 2, 1, 0, 0, 5, 0, 0, 0];
        assert_eq!(to_bytes(&time).unwrap(), little);
        assert_eq!(from_bytes::<Time>(&little).unwrap(), time);
        assert_eq!(from_bytes::<Time>(&[0, 0, 0, 0, 0, 0, 1, 2, 0, 0, 0, 5]).unwrap(), time);
    }

    #[test]
    fn up_to_three_bytes_of_padding_are_no_error() {
        let mut bytes = to_bytes(&Time::default()).unwrap();
        for padding in 1..=4 {
            bytes.push(0);
            let read = from_bytes::<Time>(&bytes);
            assert_eq!(read.is_ok(), padding <= 3, "{read:?}");
        }
        let left = from_bytes::<Time>(&bytes);
        assert!(matches!(left, Err(CdrError::Leftover { left: 4, length: 16 })));
    }

    #[test]
    fn a_message_cut_anywhere_is_an_error() {
        let bytes = to_bytes(&Time { sec: 1, nanosec: 2 }).unwrap();
        for length in 0..bytes.len() {
            let error = from_bytes::<Time>(&bytes[..length]).unwrap_err();
            assert_eq!(matches!(error, CdrError::Encoding(_)), length < 4, "{error}");
        }
    }
}
