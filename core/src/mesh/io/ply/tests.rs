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
    let mut push = |mut little: Vec<u8>| {
        if format == "binary_big_endian" {
            little.reverse();
        }
        bytes.extend(little);
    };
    push((-1i8).to_le_bytes().into());
    push(vec![255]);
    push((-300i16).to_le_bytes().into());
    push(65535u16.to_le_bytes().into());
    push((-70000i32).to_le_bytes().into());
    push(4_000_000_000u32.to_le_bytes().into());
    push(0.5f32.to_le_bytes().into());
    push(1e-9f64.to_le_bytes().into());
    push(vec![2]);
    push(vec![3]);
    push(4i16.to_le_bytes().into());
    push(5u16.to_le_bytes().into());
    push(6i32.to_le_bytes().into());
    push(7u32.to_le_bytes().into());
    push(f32::NAN.to_le_bytes().into());
    push(f64::NAN.to_le_bytes().into());
    push(vec![3]);
    for item in [-1i16, 2, -3] {
        push(item.to_le_bytes().into());
    }
    push(vec![9]);
    push(42i32.to_le_bytes().into());
    bytes
}

fn check(ply: &Ply) {
    assert_eq!(ply.comments, ["made by hand"]);
    assert_eq!(ply.info_number("num_cols"), Some(7));
    let vertex = ply.element("vertex").unwrap();
    let row = |i| -> Vec<f64> {
        vertex.properties.iter().map(|p| p.column.as_ref().unwrap().get(i)).collect()
    };
    assert_eq!(row(0), [-1.0, 255.0, -300.0, 65535.0, -70000.0, 4e9, 0.5, 1e-9]);
    assert_eq!(row(1)[..6], [2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    assert!(row(1)[6].is_nan() && row(1)[7].is_nan());
    let odd = ply.element("odd").unwrap();
    assert_eq!(odd.list(&["l"]), Some((&[0, 3][..], &[-1.0, 2.0, -3.0][..])));
    assert_eq!(odd.scalar(&["after"]).unwrap().get(0), 9.0);
    assert_eq!(ply.element("last").unwrap().scalar(&["v"]).unwrap().get(0), 42.0);
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
    assert_eq!(ply.element("last").unwrap().scalar(&["v"]).unwrap().get(0), 42.0);
}

#[test]
fn malformed_files_say_what_and_where() {
    let ascii = |body: &str| {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty uchar n\n\
             element face 1\nproperty list char int vertex_indices\nend_header\n{body}"
        )
    };
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

#[test]
fn malformed_binary_files_say_what_and_where() {
    let header = |vertices: &str, count: &str| {
        format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty float x\n\
             element face 2\nproperty list {count} int vertex_indices\nend_header\n"
        )
    };
    let with = |vertices: &str, count: &str, body: &[u8]| {
        let mut bytes = header(vertices, count).into_bytes();
        bytes.extend(body);
        error_of(&bytes)
    };
    let error = with("3", "uchar", &[0; 9]);
    assert!(error.contains("promises 3 rows of element 'vertex'"), "{error}");
    assert!(error.contains("in vertex 2: it is truncated"), "{error}");
    let error = with("4611686018427387905", "uchar", &[0; 9]);
    assert!(error.contains("the count is wrong"), "{error}");
    let mut body = vec![0; 4];
    body.extend((-2i32).to_le_bytes());
    body.extend([0; 8]);
    let error = with("1", "int", &body);
    assert!(error.contains("face 0 of 2): list 'vertex_indices' has the count -2"), "{error}");
    let mut body = vec![0; 4];
    body.extend(u32::MAX.to_le_bytes());
    body.extend([0; 8]);
    let error = with("1", "uint", &body);
    assert!(error.contains("has the count 4294967295, but 8 bytes follow"), "{error}");
}

#[test]
fn a_huge_element_without_properties_takes_neither_time_nor_room() {
    let bytes = b"ply\nformat ascii 1.0\nelement vertex 18446744073709551615\nend_header\n";
    assert_eq!(parse_all(bytes).unwrap().element("vertex").unwrap().count, usize::MAX);
}
