//! Pictures as arrays of pixels.

use super::colours::BACKGROUND_RGB;

/// A picture: rows from the top, three bytes (sRGB) for each pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Pixels in a row.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// `3 * width * height` bytes.
    pub rgb: Vec<u8>,
}

impl Image {
    /// A picture of the background alone.
    pub(super) fn empty(width: usize, height: usize) -> Image {
        Image { width, height, rgb: BACKGROUND_RGB.repeat(width * height) }
    }

    /// Copies `part`, which must fit, into the picture with its upper left corner at (x, y).
    pub(super) fn paste(&mut self, part: &Image, x: usize, y: usize) {
        if part.width == 0 {
            return;
        }
        for (row, source) in part.rgb.chunks_exact(3 * part.width).enumerate() {
            let start = 3 * ((y + row) * self.width + x);
            self.rgb[start..start + source.len()].copy_from_slice(source);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pasted_part_replaces_its_pixels_only() {
        let mut image = Image::empty(5, 4);
        let part = Image { width: 2, height: 2, rgb: (1..=12).collect() };
        image.paste(&part, 3, 1);
        for y in 0..4 {
            for x in 0..5 {
                let i = 3 * (y * 5 + x);
                let pixel = &image.rgb[i..i + 3];
                if x >= 3 && (1..3).contains(&y) {
                    let from = 3 * ((y - 1) * 2 + x - 3);
                    assert_eq!(pixel, &part.rgb[from..from + 3]);
                } else {
                    assert_eq!(pixel, BACKGROUND_RGB);
                }
            }
        }
    }
}
