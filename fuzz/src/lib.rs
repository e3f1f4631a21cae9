//! Broken input for decoders: valid files and messages, damaged by a list of edits.
//!
//! Random bytes seldom come past the first line of a header. A valid input with a few bytes
//! changed, moved or cut off reaches what stands behind it, as does a file that a full disk, a
//! broken transfer or another program has left.
//!
//! `cargo test --release -p puffer_fuzz` runs each target of `tests/decoders.rs` on the same
//! [`numbered_edits`] each time. With `BOLERO_RANDOM_ITERATIONS=100000` before it, random ones
//! follow, and `cargo bolero test -p puffer_fuzz TARGET` (`cargo install cargo-bolero`) runs a
//! target for as long as you like, guided by coverage.

use bolero::TypeGenerator;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// One damage to a sequence of bytes. Places are taken modulo the length, so that every edit fits
/// every input.
#[derive(Clone, Debug, TypeGenerator)]
pub enum Edit {
    /// Sets one byte.
    Set {
        /// Where.
        at: u32,
        /// To what.
        byte: u8,
    },
    /// Writes one of the numbers at which decoders go wrong, little endian, over what is there.
    SetNumber {
        /// Where.
        at: u32,
        /// Which of the numbers, modulo their count.
        which: u8,
    },
    /// Replaces the decimal number at or behind a place in a text.
    SetDecimal {
        /// Where to look for a digit from.
        at: u32,
        /// Which of the texts, modulo their count.
        which: u8,
    },
    /// Copies a stretch from one place to another, which makes the input longer.
    Copy {
        /// From where.
        from: u32,
        /// How much, at most.
        length: u8,
        /// To where.
        to: u32,
    },
    /// Takes a stretch out.
    Remove {
        /// From where.
        at: u32,
        /// How much, at most.
        length: u8,
    },
    /// Cuts the end off.
    Truncate {
        /// From where.
        at: u32,
    },
}

/// Numbers around which lengths, counts and offsets overflow.
const NUMBERS: [u64; 8] = [0, 1, 0x7f, 0xffff, 0x7fff_ffff, 0xffff_ffff, 1 << 53, u64::MAX];
/// The same as texts, and numbers that are none.
const DECIMALS: [&str; 8] =
    ["0", "-1", "3", "4294967296", "18446744073709551615", "1e400", "nan", "x"];

/// The largest number of edits in a list of [`numbered_edits`].
const MAX_NUMBERED_EDITS: usize = 6;

/// The list of edits of a number: the same on every machine, so that a test that failed once fails
/// again.
///
/// ```
/// use puffer_fuzz::numbered_edits;
/// assert_eq!(format!("{:?}", numbered_edits(7)), format!("{:?}", numbered_edits(7)));
/// assert!(!numbered_edits(8).is_empty());
/// ```
pub fn numbered_edits(number: u64) -> Vec<Edit> {
    let mut rng = ChaCha8Rng::seed_from_u64(number);
    let count = rng.random_range(1..=MAX_NUMBERED_EDITS);
    (0..count).map(|_| random_edit(&mut rng)).collect()
}

fn random_edit(rng: &mut ChaCha8Rng) -> Edit {
    let at = rng.random();
    match rng.random_range(0..6) {
        0 => Edit::Set { at, byte: rng.random() },
        1 => Edit::SetNumber { at, which: rng.random() },
        2 => Edit::SetDecimal { at, which: rng.random() },
        3 => Edit::Copy { from: at, length: rng.random(), to: rng.random() },
        4 => Edit::Remove { at, length: rng.random() },
        _ => Edit::Truncate { at },
    }
}

/// `input` after all `edits`, one after the other.
///
/// ```
/// use puffer_fuzz::{Edit, damaged};
/// assert_eq!(damaged(b"ply", &[Edit::Set { at: 4, byte: b'?' }]), b"p?y");
/// assert_eq!(damaged(b"n 12 m", &[Edit::SetDecimal { at: 0, which: 1 }]), b"n -1 m");
/// let edits = [Edit::Truncate { at: 2 }, Edit::Remove { at: 0, length: 1 }];
/// assert_eq!(damaged(b"abcd", &edits), b"b");
/// assert_eq!(damaged(b"", &[Edit::SetNumber { at: 9, which: 0 }]), b"");
/// ```
pub fn damaged(input: &[u8], edits: &[Edit]) -> Vec<u8> {
    let mut bytes = input.to_vec();
    for edit in edits {
        apply(edit, &mut bytes);
    }
    bytes
}

fn apply(edit: &Edit, bytes: &mut Vec<u8>) {
    if bytes.is_empty() {
        return;
    }
    let length_now = bytes.len();
    let place = |at: u32| at as usize % length_now;
    match *edit {
        Edit::Set { at, byte } => bytes[place(at)] = byte,
        Edit::SetNumber { at, which } => {
            let number = NUMBERS[which as usize % NUMBERS.len()].to_le_bytes();
            let target = bytes[place(at)..].iter_mut();
            target.zip(number).for_each(|(byte, new)| *byte = new);
        }
        Edit::SetDecimal { at, which } => {
            let text = DECIMALS[which as usize % DECIMALS.len()];
            let from = place(at);
            let Some(first) = bytes[from..].iter().position(u8::is_ascii_digit) else { return };
            let digits = bytes[from + first..].iter().take_while(|b| b.is_ascii_digit()).count();
            bytes.splice(from + first..from + first + digits, text.bytes());
        }
        Edit::Copy { from, length, to } => {
            let from = place(from);
            let end = (from + length as usize).min(length_now);
            let stretch = bytes[from..end].to_vec();
            let to = place(to);
            bytes.splice(to..to, stretch);
        }
        Edit::Remove { at, length } => {
            let at = place(at);
            bytes.drain(at..(at + length as usize).min(length_now));
        }
        Edit::Truncate { at } => bytes.truncate(place(at)),
    }
}
