//! The syntax of the files, and what is said of broken ones.

use crate::model::{Base, Count, Kind, Part, Primitive, Value};
use crate::{Package, file_syntax, generate};
use std::fs;
use std::path::Path;

fn message(text: &str) -> Result<Part, String> {
    let parts = file_syntax::read(text, Kind::Msg, "own", Path::new("own/msg/A.msg"));
    parts.map(|mut parts| parts.remove(0)).map_err(|e| e.to_string())
}

/// Writes files into a package `own` and generates.
fn generated(files: &[(&str, &str)]) -> Result<String, String> {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    let package = Package { name: "own".into(), folder: folder.path().to_path_buf() };
    let prefix = format!("{}/", folder.path().display());
    generate(&[package], "own").map_err(|e| e.to_string().replace(&prefix, ""))
}

#[test]
fn types_are_read_with_all_their_counts() {
    let part = message(
        "bool a\nstring b\nstring<=5 c\nfloat64[3] d\nuint8[] e\nint8[<=4] f\nstring<=2[<=3] g\n\
         Other h\nfar_msgs/Other[] i\nfar_msgs/msg/Other j\n",
    )
    .unwrap();
    let kinds: Vec<_> = part.fields.iter().map(|f| (&f.kind.base, f.kind.count)).collect();
    let unbounded = Count::Sequence { bound: None };
    assert_eq!(kinds[0], (&Base::Primitive(Primitive::Bool), Count::One));
    assert_eq!(kinds[1], (&Base::Text { bound: None }, Count::One));
    assert_eq!(kinds[2], (&Base::Text { bound: Some(5) }, Count::One));
    assert_eq!(kinds[3], (&Base::Primitive(Primitive::F64), Count::Fixed(3)));
    assert_eq!(kinds[4], (&Base::Primitive(Primitive::U8), unbounded));
    assert_eq!(kinds[5], (&Base::Primitive(Primitive::I8), Count::Sequence { bound: Some(4) }));
    assert_eq!(kinds[6], (&Base::Text { bound: Some(2) }, Count::Sequence { bound: Some(3) }));
    let packages = part.fields[7..].iter().map(|field| match &field.kind.base {
        Base::Message(name) => format!("{}/{}", name.package, name.name),
        other => panic!("{other:?}"),
    });
    assert_eq!(packages.collect::<Vec<_>>(), ["own/Other", "far_msgs/Other", "far_msgs/Other"]);
}

#[test]
fn constants_and_defaults_are_told_apart() {
    let part =
        message("int32 A=-3\nint32 B = 4 # four\nint32 c -5\nstring d 'a = b'\nbyte[] e [1,2]")
            .unwrap();
    let values: Vec<_> = part.constants.iter().map(|c| (c.name.as_str(), &c.value)).collect();
    assert_eq!(values, [("A", &Value::Integer(-3)), ("B", &Value::Integer(4))]);
    let defaults: Vec<_> = part.fields.iter().map(|f| f.default.clone().unwrap()).collect();
    let list = Value::List(vec![Value::Integer(1), Value::Integer(2)]);
    assert_eq!(defaults, [Value::Integer(-5), Value::Text("a = b".into()), list]);
}

#[test]
fn strings_keep_quotes_hashes_and_escapes() {
    let part =
        message("string A=\"x \\\" # 'y'\" # note\nstring B='\\n\\\\'\nstring C= bare words ")
            .unwrap();
    let texts: Vec<_> = part.constants.iter().map(|c| c.value.clone()).collect();
    assert_eq!(texts, ["x \" # 'y'", "\n\\", "bare words"].map(|t| Value::Text(t.into())));
    assert_eq!(part.constants[0].docs, ["note"]);
}

#[test]
fn comments_go_to_what_they_stand_by() {
    let part = message(
        "# The message.\n# The first field.\nbool a # behind\n# Lost.\n\n# Second.\n# More.\nbool b\nbool c",
    )
    .unwrap();
    assert_eq!(part.docs, ["The message."]);
    assert_eq!(part.fields[0].docs, ["The first field.", "behind"]);
    assert_eq!(part.fields[1].docs, ["Second.", "More."]);
    assert_eq!(part.fields[2].docs, Vec::<String>::new());
    let part = message("# All of it\n# is about the message.\n\nbool a").unwrap();
    assert_eq!(part.docs, ["All of it", "is about the message."]);
    assert_eq!(part.fields[0].docs, Vec::<String>::new());
}

#[test]
fn a_fault_in_a_line_is_told_with_the_line_and_the_way_out() {
    let faults = [
        ("bool a\nfloat b", "A.msg:2: there is no type float: use float32 or float64"),
        (
            "wstring a",
            "A.msg:1: there is no type wstring: wide strings are not supported: use string",
        ),
        ("octet a", "use byte"),
        ("time a", "use builtin_interfaces/Time"),
        ("pose a", "\"pose\" is neither a primitive type nor the name of an interface"),
        ("a/b/c/D a", "write package/Name"),
        ("bool", "write a type, a space and a name"),
        ("bool A", "\"A\" is no field name"),
        ("bool a__b", "is no field name"),
        ("bool a=1", "\"a\" is no constant's name"),
        ("bool[2] A=1", "A.msg:1: the constant A cannot be an array"),
        ("bool a\nint8 a", "A.msg:2: the name a is used twice"),
        ("int8 A=200", "200 does not fit i8: -128 to 127"),
        ("uint64 A=-1", "-1 does not fit u64"),
        ("int8 A=x", "\"x\" is no value of type i8"),
        ("bool a yes", "write true or false"),
        ("float32 a 1,5", "\"1,5\" is no value of type f32"),
        ("string a \"x", "has no closing quote"),
        ("string a \"x\" y", "put a # before a comment"),
        ("string<=3 a 'abcd'", "longer than the 3 bytes of string<=3"),
        ("int8[2] a [1]", "a list of 1 values does not fit int8[2]"),
        ("int8[<=2] a [1, 2, 3]", "a list of 3 values does not fit int8[<=2]"),
        ("int8[] a 1", "is a list: [a, b]"),
        ("int8[] a [1", "does not end with ]"),
        ("int8[0] a", "needs a whole number above 0 in place of \"0\""),
        ("int8[<=x] a", "needs a whole number above 0 in place of \"x\""),
        ("int8[2 a", "does not end with ]"),
        ("Other a 1", "cannot have a value of its own"),
        ("bool a\n---\nbool b", "a .msg file has 0 lines ---, not 1"),
    ];
    for (text, wanted) in faults {
        let error = message(text).expect_err(text);
        assert!(error.starts_with("own/msg/A.msg"), "{error}");
        assert!(error.contains(wanted), "{text:?} gave {error:?}, not {wanted:?}");
    }
}

#[test]
fn faults_that_only_the_whole_shows_are_told_too() {
    let faults: [(&[(&str, &str)], &str); 7] = [
        (&[("msg/A.msg", "bool a\nown/B b")], "msg/A.msg:2: there is no message own/B"),
        (&[("msg/A.msg", "B[] b"), ("msg/B.msg", "A a")], "this message contains itself"),
        (&[("msg/a.msg", "")], "msg/a.msg: file name: \"a\" is neither"),
        (&[("msg/A.txt", "")], "msg/A.txt: only .msg files belong in this folder"),
        (&[("srv/A.srv", "bool a")], "srv/A.srv: a .srv file has 1 lines ---, not 0"),
        (&[("action/A.action", "---")], "a .action file has 2 lines ---, not 1"),
        (&[("srv/A.srv", "---\nMissing m")], "srv/A.srv:2: there is no message own/Missing"),
    ];
    for (files, wanted) in faults {
        let error = generated(files).expect_err(wanted);
        assert!(error.contains(wanted), "{error:?}, not {wanted:?}");
    }
    let twice = Package { name: "own".into(), folder: "does/not/exist".into() };
    assert!(generate(&[twice], "own").is_ok(), "a package may have no interfaces");
    let name = Package { name: "My-Package".into(), folder: "x".into() };
    assert!(generate(&[name], "own").unwrap_err().to_string().contains("is no package name"));
}

#[test]
fn keywords_become_names_that_rust_takes() {
    let code = generated(&[("msg/A.msg", "bool type\nbool self\nbool match")]).unwrap();
    assert!(code.contains("pub r#type: bool,\n"));
    assert!(code.contains("#[serde(rename = \"self\")]\n    pub self_: bool,\n"));
    assert!(code.contains("pub r#match: bool,\n"));
}

#[test]
fn octets_go_in_one_piece_and_fixed_arrays_without_a_count() {
    let text = "uint8[] a\nbyte[] b\nchar[] c\nint8[] d\nuint8[4] e\nuint8[40] f\nuint8[<=4] g";
    let code = generated(&[("msg/A.msg", text)]).unwrap();
    assert_eq!(code.matches("with = \"::serde_bytes\"").count(), 3);
    assert!(code.contains("    /// `uint8[4] e`\n    pub e: [u8; 4],"));
    assert!(code.contains("#[serde(with = \"crate::field_serde::array\")]\n    pub f: [u8; 40],"));
    assert!(code.contains("serialize_sequence::<4, _, _>"));
}

#[test]
fn the_same_files_give_the_same_code() {
    let files = [("msg/B.msg", "A a"), ("msg/A.msg", "bool a"), ("srv/C.srv", "B b\n---\n")];
    assert_eq!(generated(&files), generated(&files));
}
