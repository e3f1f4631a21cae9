//! `puffer render`: a picture of a mesh.

use super::input::check_output;
use crate::exit_status::usage_error;
use crate::png_file::write_png;
use anyhow::Result;
use clap::Args;
use puffer_core::geometry::Vec3;
use puffer_core::mesh::io::read_mesh;
use puffer_core::mesh::render::{RenderView, render, render_sheet};
use std::path::PathBuf;

/// Shaded, coloured by uncertainty if there is one: green certain, red uncertain; back faces stand
/// out.
#[derive(Args)]
pub struct RenderCommand {
    /// Mesh to draw
    mesh: PathBuf,
    /// Picture to write, .png
    #[arg(short, long, value_name = "PICTURE")]
    output: PathBuf,
    /// Direction from the object to the eye, as x,y,z [default: all six sides on one sheet]
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    from: Option<String>,
    /// Width and height, pixels
    #[arg(long, default_value = "1200x800", value_name = "WxH")]
    size: String,
}

impl RenderCommand {
    pub(super) fn run(&self) -> Result<()> {
        check_output(&self.output, &["png"])?;
        let (width, height) = self.pixels()?;
        let direction = self.direction()?;
        let mesh = read_mesh(&self.mesh)?;
        let image = match direction {
            None => render_sheet(&mesh, width, height),
            Some(eye) => {
                let up = if eye.x.hypot(eye.y) > 1e-6 * eye.norm() { Vec3::z() } else { Vec3::y() };
                render(&mesh, RenderView { direction: -eye, up }, width, height)
            }
        };
        write_png(&self.output, &image)
    }

    fn pixels(&self) -> Result<(usize, usize)> {
        let parsed =
            self.size.split_once('x').and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
        match parsed {
            Some((w, h)) if (16..=16384).contains(&w) && (16..=16384).contains(&h) => Ok((w, h)),
            _ => Err(usage_error(format!(
                "--size {}: expected two numbers from 16 to 16384, as in 1200x800",
                self.size
            ))),
        }
    }

    fn direction(&self) -> Result<Option<Vec3>> {
        let Some(text) = &self.from else { return Ok(None) };
        let numbers: std::result::Result<Vec<f64>, _> =
            text.split(',').map(|number| number.trim().parse()).collect();
        let length = numbers.iter().flatten().map(|number| number * number).sum::<f64>().sqrt();
        match numbers.as_deref() {
            Ok(&[x, y, z]) if length.is_finite() && length > 0.0 => Ok(Some(Vec3::new(x, y, z))),
            _ => Err(usage_error(format!("--from {text}: expected three numbers, as in 1,-1,0.5"))),
        }
    }
}
