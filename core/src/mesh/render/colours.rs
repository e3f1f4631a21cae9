//! Colours of pictures, sRGB.

/// Background; no shaded surface has this colour.
pub const BACKGROUND_RGB: [u8; 3] = [255, 255, 255];
/// Surface without sigma.
pub(super) const SURFACE_RGB: [u8; 3] = [215, 215, 220];
/// Triangles seen from inside, which show holes and wrong orientation.
pub(super) const BACK_FACE_RGB: [u8; 3] = [150, 50, 200];
