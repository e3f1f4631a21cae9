//! What the files say, as data.

use std::path::PathBuf;

/// Types of one value without parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Primitive {
    Bool,
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Primitive {
    /// By its name in a .msg file; `byte` and `char` are unsigned octets in ROS 2.
    pub fn from_ros(name: &str) -> Option<Self> {
        Some(match name {
            "bool" => Primitive::Bool,
            "int8" => Primitive::I8,
            "uint8" | "byte" | "char" => Primitive::U8,
            "int16" => Primitive::I16,
            "uint16" => Primitive::U16,
            "int32" => Primitive::I32,
            "uint32" => Primitive::U32,
            "int64" => Primitive::I64,
            "uint64" => Primitive::U64,
            "float32" => Primitive::F32,
            "float64" => Primitive::F64,
            _ => return None,
        })
    }

    /// Name in Rust.
    pub fn rust(self) -> &'static str {
        match self {
            Primitive::Bool => "bool",
            Primitive::I8 => "i8",
            Primitive::U8 => "u8",
            Primitive::I16 => "i16",
            Primitive::U16 => "u16",
            Primitive::I32 => "i32",
            Primitive::U32 => "u32",
            Primitive::I64 => "i64",
            Primitive::U64 => "u64",
            Primitive::F32 => "f32",
            Primitive::F64 => "f64",
        }
    }

    /// Octets in memory and on the wire.
    pub fn size(self) -> usize {
        match self {
            Primitive::Bool | Primitive::I8 | Primitive::U8 => 1,
            Primitive::I16 | Primitive::U16 => 2,
            Primitive::I32 | Primitive::U32 | Primitive::F32 => 4,
            Primitive::I64 | Primitive::U64 | Primitive::F64 => 8,
        }
    }

    pub fn is_float(self) -> bool {
        matches!(self, Primitive::F32 | Primitive::F64)
    }
}

/// Name of a message, `package/msg/name`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct MessageName {
    pub package: String,
    pub name: String,
}

/// What one element of a field is.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Base {
    Primitive(Primitive),
    Text { bound: Option<usize> },
    Message(MessageName),
}

/// How many elements a field has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Count {
    One,
    Fixed(usize),
    Sequence { bound: Option<usize> },
}

/// Type of a field, and as it is written in the file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FieldType {
    pub base: Base,
    pub count: Count,
    pub written: String,
}

/// Value of a constant or default of a field.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    Bool(bool),
    Integer(i128),
    Float(f64),
    Text(String),
    List(Vec<Value>),
}

impl Value {
    /// Whether `Default` of the type is this value.
    pub fn is_rust_default(&self, count: Count) -> bool {
        match self {
            Value::Bool(value) => !value,
            Value::Integer(value) => *value == 0,
            Value::Float(value) => *value == 0.0 && value.is_sign_positive(),
            Value::Text(text) => text.is_empty(),
            Value::List(values) => match count {
                Count::Fixed(_) => values.iter().all(|v| v.is_rust_default(Count::One)),
                Count::One | Count::Sequence { .. } => values.is_empty(),
            },
        }
    }
}

/// One field.
#[derive(Clone, Debug)]
pub(crate) struct Field {
    pub name: String,
    pub kind: FieldType,
    pub default: Option<Value>,
    pub docs: Vec<String>,
    pub line: usize,
}

/// One constant.
#[derive(Clone, Debug)]
pub(crate) struct Constant {
    pub name: String,
    pub kind: FieldType,
    pub value: Value,
    pub docs: Vec<String>,
}

/// A message, or one of the parts of a service or action between `---`.
#[derive(Clone, Debug, Default)]
pub(crate) struct Part {
    pub docs: Vec<String>,
    pub constants: Vec<Constant>,
    pub fields: Vec<Field>,
    pub text: String,
}

/// The three kinds of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    Msg,
    Srv,
    Action,
}

impl Kind {
    pub const ALL: [Kind; 3] = [Kind::Msg, Kind::Srv, Kind::Action];

    /// Name of the folder, ending of the files, and Rust module.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Msg => "msg",
            Kind::Srv => "srv",
            Kind::Action => "action",
        }
    }

    /// Parts that `---` separates.
    pub fn parts(self) -> usize {
        match self {
            Kind::Msg => 1,
            Kind::Srv => 2,
            Kind::Action => 3,
        }
    }
}

/// One file.
#[derive(Clone, Debug)]
pub(crate) struct Interface {
    pub package: String,
    pub name: String,
    pub kind: Kind,
    pub path: PathBuf,
    pub parts: Vec<Part>,
}
