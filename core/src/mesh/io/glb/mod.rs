//! Binary glTF 2.0 (Khronos, glTF 2.0 Specification, §4.4 GLB file format).
//!
//! glTF has y up, meshes here have z up. A written file has a node whose rotation maps z to y, and
//! everything that is read is rotated back.

mod accessor;
mod reader;
mod writer;

pub(super) use reader::parse;
pub(super) use writer::write;

/// The first bytes of a file.
const GLB_MAGIC: &[u8; 4] = b"glTF";
/// Type of the chunk with the document.
const JSON_CHUNK: u32 = 0x4E4F_534A;
/// Type of the chunk with the data.
const BINARY_CHUNK: u32 = 0x004E_4942;
/// Target of buffer views with vertex attributes.
const ARRAY_BUFFER_TARGET: u32 = 34962;
/// Target of buffer views with indices.
const ELEMENT_ARRAY_BUFFER_TARGET: u32 = 34963;
// Component types of accessors.
const UNSIGNED_BYTE_COMPONENT: u64 = 5121;
const UNSIGNED_SHORT_COMPONENT: u64 = 5123;
const UNSIGNED_INT_COMPONENT: u64 = 5125;
const FLOAT_COMPONENT: u64 = 5126;
/// Marks files of this program, whose triangles share vertices; other exporters may split them.
const GENERATOR_NAME: &str = "puffer";
