//! Pictures as PNG files.

use anyhow::{Context, Result};
use puffer_core::mesh::render::Image;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

/// Writes `image` to `path`.
pub(crate) fn write_png(path: &Path, image: &Image) -> Result<()> {
    encode(path, image).with_context(|| format!("cannot write {}", path.display()))
}

fn encode(path: &Path, image: &Image) -> Result<()> {
    let file = BufWriter::new(File::create(path)?);
    let mut encoder = png::Encoder::new(file, image.width as u32, image.height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&image.rgb)?;
    Ok(writer.finish()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pixels_are_read_back_and_a_missing_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let image = Image { width: 2, height: 1, rgb: vec![255, 0, 1, 2, 3, 4] };
        write_png(&path, &image).unwrap();
        let file = std::io::BufReader::new(File::open(&path).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let frame = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((frame.width, frame.height), (2, 1));
        assert_eq!(pixels, image.rgb);

        let error = write_png(&folder.path().join("missing/a.png"), &image).unwrap_err();
        assert!(error.to_string().contains("missing/a.png"), "{error}");
    }
}
