//! The PLY file of one view.

use crate::geometry::Scan;
use crate::mesh::io::Unit;
use crate::mesh::io::ply::{Ply, PlyElement, PlyHeader, PropertyColumn, parse, push_floats};
use crate::mesh::io::{check_extent, trimmed_extent};
use crate::{Error, Result};
use std::path::Path;

/// Number of columns and rows of an organised cloud, in obj_info lines (the names that Stanford's
/// files use).
const COLUMNS: &str = "num_cols";
const ROWS: &str = "num_rows";

const NO_RETURN: [f32; 3] = [f32::NAN; 3];

/// Which frame the points of a file are in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Frame {
    /// The sensor frame: z forward, x right, y down.
    Sensor,
    /// That of Stanford's range grids: looking along -z, x right, y up, with parallel rays.
    RangeGrid,
}

/// Reads the scan of one view into the sensor frame; `width` is known from elsewhere or 0.
pub(super) fn parse_scan(
    bytes: &[u8],
    path: &Path,
    frame: Frame,
    unit: Unit,
    width: usize,
) -> Result<Scan> {
    let ply = parse(bytes, path, &is_read)?;
    let vertex = ply.require_element(path, "vertex", "a scan needs points")?;
    if vertex.count == 0 {
        return Err(Error::format(path, "the cloud is empty: leave its view out"));
    }
    let points = read_triples(vertex, ["x", "y", "z"], unit).ok_or_else(|| {
        let has: Vec<_> = vertex.properties.iter().map(|p| p.name.as_str()).collect();
        let has = has.join(", ");
        Error::format(path, format!("its vertices need the properties x, y and z, but have: {has}"))
    })?;
    let origins = read_triples(vertex, ["vp_x", "vp_y", "vp_z"], unit).unwrap_or_default();
    let mut scan = arrange_in_rows(&ply, Scan { points, width, origins }, path)?;
    if frame == Frame::RangeGrid {
        from_range_grid_frame(&mut scan);
    }
    check_scan(&scan, unit).map_err(|message| Error::format(path, message))?;
    Ok(scan)
}

/// Whether a property of an element says anything about a scan.
fn is_read(element: &str, property: &str) -> bool {
    match element {
        "vertex" => ["x", "y", "z", "vp_x", "vp_y", "vp_z"].contains(&property),
        "range_grid" => property == "vertex_indices",
        _ => false,
    }
}

/// Three properties of the vertices as points in metres; none if one is missing.
fn read_triples(vertex: &PlyElement, names: [&str; 3], unit: Unit) -> Option<Vec<[f32; 3]>> {
    let columns = vertex.vector_columns(names)?;
    let mut rows: Vec<[f32; 3]> = match columns {
        [PropertyColumn::F32(x), PropertyColumn::F32(y), PropertyColumn::F32(z)] => {
            x.iter().zip(y).zip(z).map(|((x, y), z)| [*x, *y, *z]).collect()
        }
        _ => (0..vertex.count).map(|i| columns.map(|column| column.scalar_at(i) as f32)).collect(),
    };
    if unit != Unit::Metre {
        rows.as_flattened_mut()
            .iter_mut()
            .for_each(|v| *v = (f64::from(*v) * unit.metres_per_unit()) as f32);
    }
    Some(rows)
}

/// Finds the rows of an organised cloud: from a range grid, from the remarks, or from `scan.width`.
fn arrange_in_rows(ply: &Ply, mut scan: Scan, path: &Path) -> Result<Scan> {
    let (columns, rows) = (ply.info_number(COLUMNS), ply.info_number(ROWS));
    if let Some(grid) = ply.element("range_grid") {
        let (Some(columns), Some(rows)) = (columns, rows) else {
            return Err(Error::format(
                path,
                format!(
                    "its range_grid needs the lines 'obj_info {COLUMNS} N' and 'obj_info {ROWS} N'"
                ),
            ));
        };
        if columns.checked_mul(rows) != Some(grid.count) || columns == 0 {
            return Err(Error::format(
                path,
                format!("its range_grid has {} cells, not {columns} x {rows}", grid.count),
            ));
        }
        return fill_grid(grid, &scan, columns, path);
    }
    if let (Some(columns), Some(rows)) = (columns, rows)
        && columns.checked_mul(rows) == Some(scan.points.len())
    {
        scan.width = columns;
    }
    if scan.width > 0 && !scan.points.len().is_multiple_of(scan.width) {
        return Err(Error::format(
            path,
            format!("its {} points do not fill rows of {}", scan.points.len(), scan.width),
        ));
    }
    Ok(scan)
}

fn fill_grid(grid: &PlyElement, scan: &Scan, columns: usize, path: &Path) -> Result<Scan> {
    let (starts, indices) = grid
        .list_column(&["vertex_indices"])
        .ok_or_else(|| Error::format(path, "its range_grid has no list 'vertex_indices'"))?;
    let mut organised = Scan { width: columns, ..Scan::default() };
    for (cell, range) in starts.windows(2).enumerate() {
        let found = match indices[range[0]..range[1]] {
            [] => None,
            [index, ..] if index >= 0.0 && index < scan.points.len() as f64 => Some(index as usize),
            [index, ..] => {
                let count = scan.points.len();
                let message =
                    format!("range_grid {cell} names point {index}, but there are {count}");
                return Err(Error::format(path, message));
            }
        };
        organised.points.push(found.map_or(NO_RETURN, |i| scan.points[i]));
        if !scan.origins.is_empty() {
            organised.origins.push(found.map_or(NO_RETURN, |i| scan.origins[i]));
        }
    }
    Ok(organised)
}

/// Half a turn about x. The scanner's carriage moved in a line, so its rays are parallel to z; they
/// are given a length of one metre.
fn from_range_grid_frame(scan: &mut Scan) {
    for point in scan.points.iter_mut().chain(&mut scan.origins) {
        *point = [point[0], -point[1], -point[2]];
    }
    if scan.origins.is_empty() {
        scan.origins = scan.points.iter().map(|[x, y, z]| [*x, *y, z - 1.0]).collect();
    }
}

fn check_scan(scan: &Scan, unit: Unit) -> std::result::Result<(), String> {
    if scan.returns().next().is_none() {
        return Err(format!(
            "none of its {} points has finite coordinates: leave its view out",
            scan.points.len()
        ));
    }
    check_extent(trimmed_extent(scan.points.iter().map(|p| p.map(f64::from))), unit)
}

/// The bytes of a view's file: float x y z, and vp_x vp_y vp_z where the scan has origins.
pub(super) fn encode_scan(scan: &Scan) -> Vec<u8> {
    let mut layout = PlyHeader::default();
    if scan.width > 0 {
        layout.add_info(COLUMNS, scan.width);
        layout.add_info(ROWS, scan.height());
    }
    let mut properties = vec!["float x", "float y", "float z"];
    let has_origins = !scan.origins.is_empty();
    if has_origins {
        properties.extend(["float vp_x", "float vp_y", "float vp_z"]);
    }
    layout.add_element("vertex", scan.points.len(), &properties);
    let mut bytes = layout.into_bytes();
    bytes.reserve(scan.points.len() * 4 * properties.len());
    for (i, point) in scan.points.iter().enumerate() {
        push_floats(&mut bytes, *point);
        if has_origins {
            push_floats(&mut bytes, scan.origins[i]);
        }
    }
    bytes
}
