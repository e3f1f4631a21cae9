//! Pictures as PNG files.

use anyhow::{Context, Result};
use puffer_core::mesh::render::Image;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

/// Writes `image` to `path`.
pub(crate) fn write_png(path: &Path, image: &Image) -> Result<()> {
    let context = || format!("cannot write {}", path.display());
    let file = File::create(path).with_context(context)?;
    let mut encoder =
        png::Encoder::new(BufWriter::new(file), image.width as u32, image.height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().with_context(context)?;
    writer.write_image_data(&image.rgb).with_context(context)?;
    writer.finish().with_context(context)
}
