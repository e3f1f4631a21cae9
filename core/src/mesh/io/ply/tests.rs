use super::*;

fn parse_all(bytes: &[u8]) -> Result<Ply> {
    parse(bytes, Path::new("x.ply"), &|_, _| true)
}

fn error_of(bytes: &[u8]) -> String {
    parse_all(bytes).unwrap_err().to_string()
}

const HEADER: &str = "comment made by hand\nobj_info num_cols 7\nelement vertex 2\n\
    property char a\nproperty uint8 b\nproperty short c\nproperty uint16 d\nproperty int e\n\
    property uint32 f\nproperty float g\nproperty float64 h\nelement odd 1\n\
    property list uchar short l\nproperty uchar after\nelement nothing 3\nelement last 1\n\
    property int v\n";

/// The same rows in all three encodings.
fn file(format: &str, newline: &str) -> Vec<u8> {
    let header = format!("ply\nformat {format} 1.0\n{HEADER}end_header\n").replace('\n', newline);
    let mut bytes = header.into_bytes();
    if format == "ascii" {
        let body = "-1 255 -300 65535 -70000 4000000000 0.5 1e-9\n\n \
                    2 3 4 5 6 7 nan -nan(ind) \n3 -1 2 -3 9\n42";
        bytes.extend(body.replace('\n', newline).bytes());
        return bytes;
    }
    let little_endian: Vec<Vec<u8>> = vec![
        (-1i8).to_le_bytes().into(),
        vec![255],
        (-300i16).to_le_bytes().into(),
        65535u16.to_le_bytes().into(),
        (-70000i32).to_le_bytes().into(),
        4_000_000_000u32.to_le_bytes().into(),
        0.5f32.to_le_bytes().into(),
        1e-9f64.to_le_bytes().into(),
        vec![2],
        vec![3],
        4i16.to_le_bytes().into(),
        5u16.to_le_bytes().into(),
        6i32.to_le_bytes().into(),
        7u32.to_le_bytes().into(),
        f32::NAN.to_le_bytes().into(),
        f64::NAN.to_le_bytes().into(),
        vec![3],
        (-1i16).to_le_bytes().into(),
        2i16.to_le_bytes().into(),
        (-3i16).to_le_bytes().into(),
        vec![9],
        42i32.to_le_bytes().into(),
    ];
    for mut number in little_endian {
        if format == "binary_big_endian" {
            number.reverse();
        }
        bytes.extend(number);
    }
    bytes
}

fn check(ply: &Ply) {
    assert_eq!(ply.comments, ["made by hand"]);
    assert_eq!(ply.info_number("num_cols"), Some(7));
    let vertex = ply.element("vertex").unwrap();
    let rows = [0, 1].map(|i| -> Vec<f64> {
        vertex.properties.iter().map(|p| p.column.as_ref().unwrap().scalar_at(i)).collect()
    });
    assert_eq!(rows[0], [-1.0, 255.0, -300.0, 65535.0, -70000.0, 4e9, 0.5, 1e-9]);
    assert_eq!(rows[1][..6], [2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    assert!(rows[1][6].is_nan() && rows[1][7].is_nan());
    let odd = ply.element("odd").unwrap();
    assert_eq!(odd.list_column(&["l"]), Some((&[0, 3][..], &[-1.0, 2.0, -3.0][..])));
    assert_eq!(odd.scalar_column(&["after"]).unwrap().scalar_at(0), 9.0);
    assert_eq!(ply.element("last").unwrap().scalar_column(&["v"]).unwrap().scalar_at(0), 42.0);
}

#[test]
fn every_type_is_read_in_every_encoding_and_with_every_newline() {
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for newline in ["\n", "\r\n", "\r"] {
            check(&parse_all(&file(format, newline)).unwrap());
        }
    }
}

#[test]
fn unwanted_columns_are_not_kept() {
    let bytes = file("binary_big_endian", "\n");
    let ply = parse(&bytes, Path::new("x.ply"), &|e, p| e == "last" && p == "v").unwrap();
    assert!(ply.element("vertex").unwrap().properties.iter().all(|p| p.column.is_none()));
    assert_eq!(ply.element("last").unwrap().scalar_column(&["v"]).unwrap().scalar_at(0), 42.0);
}

/// An ASCII file with two vertices and a face in its header.
fn ascii(body: &str) -> String {
    format!(
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty uchar n\n\
         element face 1\nproperty list char int vertex_indices\nend_header\n{body}"
    )
}

#[test]
fn malformed_files_say_what_and_where() {
    let cases: Vec<(Vec<u8>, &str)> = vec![
        (b"solid".to_vec(), "not a PLY file"),
        (b"plywood\n".to_vec(), "not a PLY file"),
        (b"ply\nformat ascii 1.0\nelement vertex 1\n".to_vec(), "without 'end_header'"),
        (b"ply\nend_header\n".to_vec(), "no 'format' line"),
        (b"ply\nformat utf 1.0\n".to_vec(), "line 2, 'format utf 1.0': unknown format"),
        (b"ply\nelement vertex -5\n".to_vec(), "'-5' is not a count"),
        (b"ply\nproperty float x\n".to_vec(), "needs an element before it"),
        (b"ply\nelement v 1\nproperty quad x\n".to_vec(), "unknown type 'quad'"),
        (b"ply\nelement v 1\nproperty list float int x\n".to_vec(), "integer type"),
        (b"ply\nelephant v 1\n".to_vec(), "unknown word"),
        (ascii("1.5 2\n\n").into(), "ends at line 11, before vertex 1 of 2"),
        (ascii("1 2\n3 4\n").into(), "only 0 bytes follow from line 11 on"),
        (ascii("1 2\n3 x\n1 2\n").into(), "line 10 (vertex 1 of 2): 'x' is not a number"),
        (ascii("1 2\n3\n1 2\n").into(), "ends before property 'n'"),
        (ascii("1 2\n3 4 5\n1 2\n").into(), "'5' stands after the last property"),
        (ascii("1 2\n3 256\n1 2\n").into(), "not an integer from 0 to 255"),
        (ascii("1 2\n3 2.5\n1 2\n").into(), "not an integer from 0 to 255"),
        (ascii("1 2\n3 4\n-3 1 2 3\n").into(), "negative count -3"),
        (ascii("1 2\n3 4\n127 1 2 3\n").into(), "ends before property 'vertex_indices'"),
        (
            ascii("1 2\n").replace("vertex 2", "vertex 99999999999999").into(),
            "promises 99999999999999 rows",
        ),
    ];
    for (bytes, says) in cases {
        let error = error_of(&bytes);
        assert!(error.starts_with("x.ply: ") && error.contains(says), "{error}\nnot: {says}");
    }
}

/// The error of a binary file with this count of vertices, type of list counts and body.
fn binary_error(vertices: &str, count: &str, body: &[u8]) -> String {
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty float x\n\
         element face 2\nproperty list {count} int vertex_indices\nend_header\n"
    );
    let mut bytes = header.into_bytes();
    bytes.extend(body);
    error_of(&bytes)
}

#[test]
fn malformed_binary_files_say_what_and_where() {
    let error = binary_error("3", "uchar", &[0; 9]);
    assert!(error.contains("promises 3 rows of element 'vertex'"), "{error}");
    assert!(error.contains("in vertex 2: it is truncated"), "{error}");
    let error = binary_error("4611686018427387905", "uchar", &[0; 9]);
    assert!(error.contains("the count is wrong"), "{error}");
    let mut body = vec![0; 4];
    body.extend((-2i32).to_le_bytes());
    body.extend([0; 8]);
    let error = binary_error("1", "int", &body);
    assert!(error.contains("face 0 of 2): list 'vertex_indices' has the count -2"), "{error}");
    let mut body = vec![0; 4];
    body.extend(u32::MAX.to_le_bytes());
    body.extend([0; 8]);
    let error = binary_error("1", "uint", &body);
    assert!(error.contains("has the count 4294967295, but 8 bytes follow"), "{error}");
}

#[test]
fn a_huge_element_without_properties_takes_neither_time_nor_room() {
    let bytes = b"ply\nformat ascii 1.0\nelement vertex 18446744073709551615\nend_header\n";
    assert_eq!(parse_all(bytes).unwrap().element("vertex").unwrap().count, usize::MAX);
}
