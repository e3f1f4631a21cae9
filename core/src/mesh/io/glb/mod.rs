//! Binary glTF 2.0 (Khronos, glTF 2.0 Specification, §4.4 GLB file format).
//!
//! glTF asks for y up, the product for z up: a node's rotation turns z to y on writing, and all that is read
//! is turned back.

mod accessor;
mod read;
mod write;

pub(super) use read::parse;
pub(super) use write::write;

const MAGIC: &[u8; 4] = b"glTF";
const JSON: u32 = 0x4E4F_534A;
const BINARY: u32 = 0x004E_4942;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
const UNSIGNED_BYTE: u64 = 5121;
const UNSIGNED_SHORT: u64 = 5123;
const UNSIGNED_INT: u64 = 5125;
const FLOAT: u64 = 5126;
/// Tells our own files, whose vertices are shared already, from those of exporters that split them.
const GENERATOR: &str = "puffer";
