//! Fields as VTU, the XML unstructured grid that ParaView, VisIt and PyVista open.
//!
//! Written by hand: the crate for the format, vtkio, has had only release candidates since 0.6.3, and it writes one
//! block too many where an array fills its compressed blocks exactly. The needed part of the format is one page.

use std::io::Write;

use base64::{Engine, engine::general_purpose::STANDARD as BASE64};
use flate2::write::ZlibEncoder;

use crate::deflate;
use crate::fields::{Data, check, plane, point_data};
use crate::number::Number;
use solver::element::Family;
use solver::solution::Fields;

/// VTK's number of the quadratic triangle. VTK orders the nodes of triangles and quadrilaterals as we do.
const QUADRATIC_TRIANGLE: u8 = 22;
/// VTK's number of the quadratic quadrilateral.
const QUADRATIC_QUAD: u8 = 23;

/// The number of bytes that are compressed at a time; a multiple of the size of every number type.
const BLOCK: usize = 1 << 18;

/// Writes the fields as VTU: nodes before deformation at z = 0, cells, values at both.
///
/// # Errors
///
/// The reason in words, if the columns of the fields do not fit together.
pub fn file(fields: &Fields) -> Result<Vec<u8>, String> {
    check(fields)?;
    written(fields).map_err(|error| error.to_string())
}

fn written(fields: &Fields) -> std::io::Result<Vec<u8>> {
    let mut out = Vec::new();
    let (nodes, cells) = (fields.x.len(), fields.elements.len());
    writeln!(
        out,
        r#"<?xml version="1.0"?>
<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64" compressor="vtkZLibDataCompressor">
<UnstructuredGrid>
<Piece NumberOfPoints="{nodes}" NumberOfCells="{cells}">
<PointData Vectors="displacement" Tensors="stress">"#
    )?;
    for array in point_data(fields) {
        match &array.data {
            Data::Real(values) => data_array(&mut out, array.name, array.components, values)?,
            Data::Small(values) => data_array(&mut out, array.name, array.components, values)?,
        }
    }
    writeln!(out, "</PointData>\n<CellData>")?;
    data_array(&mut out, "element_error", &[], &fields.element_error)?;
    writeln!(out, "</CellData>\n<Points>")?;
    let points = plane(&fields.x, &fields.y);
    data_array(&mut out, "Points", &["x", "y", "z"], &points)?;
    writeln!(out, "</Points>\n<Cells>")?;
    let (mut connectivity, mut offsets, mut types) = (Vec::new(), Vec::new(), Vec::new());
    for element in &fields.elements {
        connectivity.extend(element.iter().map(|node| i64::from(*node)));
        offsets.push(connectivity.len() as i64);
        types.push(match element.family() {
            Family::Quad => QUADRATIC_QUAD,
            Family::Triangle => QUADRATIC_TRIANGLE,
        });
    }
    data_array(&mut out, "connectivity", &[], &connectivity)?;
    data_array(&mut out, "offsets", &[], &offsets)?;
    data_array(&mut out, "types", &[], &types)?;
    writeln!(out, "</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>")?;
    Ok(out)
}

/// Writes one array: a header of 64-bit numbers (the number of blocks, the bytes of a block, the bytes of the last
/// block if it is not full, else 0, and the compressed bytes of each block), then the compressed blocks. Header and
/// blocks are in base64.
fn data_array<T: Number>(
    out: &mut Vec<u8>,
    name: &str,
    components: &[&str],
    values: &[T],
) -> std::io::Result<()> {
    write!(
        out,
        r#"<DataArray type="{}" Name="{name}" NumberOfComponents="{}""#,
        T::VTK,
        components.len().max(1)
    )?;
    for (number, component) in components.iter().enumerate() {
        write!(out, r#" ComponentName{number}="{component}""#)?;
    }
    writeln!(out, r#" format="binary">"#)?;

    let bytes = size_of_val(values);
    let blocks = bytes.div_ceil(BLOCK);
    let mut header = Vec::new();
    for number in [blocks, BLOCK, bytes % BLOCK] {
        (number as i64).put(&mut header);
    }
    let (mut compressed, mut plain) = (Vec::new(), Vec::with_capacity(BLOCK.min(bytes)));
    for block in values.chunks(BLOCK / size_of::<T>()) {
        plain.clear();
        block.iter().for_each(|value| value.put(&mut plain));
        let before = compressed.len();
        // computed digits compress little at any level
        let mut encoder = ZlibEncoder::new(&mut compressed, deflate::FAST);
        encoder.write_all(&plain)?;
        encoder.finish()?;
        ((compressed.len() - before) as i64).put(&mut header);
    }
    out.write_all(BASE64.encode(&header).as_bytes())?;
    out.write_all(BASE64.encode(&compressed).as_bytes())?;
    writeln!(out, "\n</DataArray>")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fields::tests::mixed;
    use std::io::Read;

    /// The bytes of an array, read block by block.
    fn read(text: &str, name: &str) -> Vec<u8> {
        let start = text.find(&format!("Name=\"{name}\"")).unwrap();
        let line = text[start..].lines().nth(1).unwrap();
        let number = |bytes: &[u8], i: usize| {
            u64::from_le_bytes(bytes[8 * i..8 * i + 8].try_into().unwrap()) as usize
        };
        let encoded = |bytes: usize| bytes.div_ceil(3) * 4;
        let blocks = number(&BASE64.decode(&line[..encoded(24)]).unwrap(), 0);
        let (header, body) = line.split_at(encoded(8 * (3 + blocks)));
        let (header, body) = (BASE64.decode(header).unwrap(), BASE64.decode(body).unwrap());
        let (mut place, mut all) = (0, Vec::new());
        for block in 0..blocks {
            let end = place + number(&header, 3 + block);
            let mut plain = Vec::new();
            flate2::read::ZlibDecoder::new(&body[place..end])
                .read_to_end(&mut plain)
                .unwrap();
            let full = number(&header, 2) == 0 || block + 1 < blocks;
            assert_eq!(plain.len(), number(&header, if full { 1 } else { 2 }));
            all.extend(plain);
            place = end;
        }
        assert_eq!(place, body.len());
        all
    }

    #[test]
    fn a_mixed_mesh_has_both_kinds_of_cell_with_our_node_order() {
        let text = String::from_utf8(file(&mixed()).unwrap()).unwrap();
        assert!(text.contains(r#"NumberOfPoints="11" NumberOfCells="2""#));
        assert_eq!(read(&text, "types"), [23, 22]);
        let numbers = |name| -> Vec<u8> { read(&text, name).into_iter().step_by(8).collect() };
        assert_eq!(numbers("offsets"), [8, 14]);
        assert_eq!(
            numbers("connectivity"),
            [0, 1, 2, 3, 4, 5, 6, 7, 1, 8, 2, 9, 10, 5]
        );
        assert_eq!(read(&text, "Points").len(), 8 * 33);
        assert_eq!(read(&text, "contact_state")[..4], [255, 255, 2, 0]);
        let principal = read(&text, "principal_stress");
        assert_eq!(principal[..8], 5f64.to_le_bytes());
    }

    #[test]
    fn arrays_of_any_number_of_blocks_are_read_back() {
        let block = BLOCK / 8;
        for count in [0, 1, block - 1, block, block + 1, 2 * block] {
            let values: Vec<f64> = (0..count).map(|i| i as f64 / 7.0).collect();
            let mut out = Vec::new();
            data_array(&mut out, "a", &[], &values).unwrap();
            let sent: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            let text = String::from_utf8(out).unwrap();
            assert!(read(&text, "a") == sent, "{count}");
        }
    }
}
