//! Parameters with one source: default, range, unit and description are written at the struct
//! field, and the YAML, the `--help` texts and the reference table are made from them.
//!
//! ```
//! use puffer_core::params::Value;
//!
//! puffer_core::params! {
//!     /// How a gripper closes.
//!     pub struct GripperParams("gripper") {
//!         /// Largest force of the jaws.
//!         max_force: f64 = 20.0, in [0.0, 100.0], unit "N";
//!     }
//! }
//!
//! let mut gripper = GripperParams::default();
//! gripper.set("max_force", &Value::from(35.0))?;
//! assert_eq!(gripper.max_force, 35.0);
//! assert!(gripper.set("max_force", &Value::from(200.0)).is_err());
//! assert_eq!(GripperParams::specs()[0].description, "Largest force of the jaws.");
//! # Ok::<(), puffer_core::Error>(())
//! ```

use crate::{Error, Result};
pub use serde_json::Value;

/// The declaration of one parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct ParamSpec {
    /// Full name, `group.field`.
    pub name: String,
    /// The type: "float", "integer", "boolean", "string" or "choice".
    pub kind: &'static str,
    /// Value when the user gives none.
    pub default: Value,
    /// Smallest and largest value allowed, for numbers.
    pub range: Option<[f64; 2]>,
    /// Words allowed, for choices.
    pub choices: &'static [&'static str],
    /// SI unit, empty if there is none.
    pub unit: &'static str,
    /// What the parameter is, in whole sentences.
    pub description: String,
}

/// A type that a parameter can have.
pub trait ParamValue: Sized {
    /// As in [`ParamSpec::kind`].
    const KIND: &'static str;
    /// As in [`ParamSpec::choices`].
    const CHOICES: &'static [&'static str] = &[];
    /// The value as JSON.
    fn to_value(&self) -> Value;
    /// Reads the value; `None` if the JSON has another type or the word is not among the choices.
    fn from_value(value: &Value) -> Option<Self>;
    /// The value as a number that is compared with the range; `None` if it is not a number.
    fn as_number(&self) -> Option<f64> {
        None
    }
}

impl ParamValue for f64 {
    const KIND: &'static str = "float";
    fn to_value(&self) -> Value {
        Value::from(*self)
    }
    fn from_value(value: &Value) -> Option<Self> {
        value.as_f64()
    }
    fn as_number(&self) -> Option<f64> {
        Some(*self)
    }
}

impl ParamValue for usize {
    const KIND: &'static str = "integer";
    fn to_value(&self) -> Value {
        Value::from(*self)
    }
    fn from_value(value: &Value) -> Option<Self> {
        value.as_u64().and_then(|v| usize::try_from(v).ok())
    }
    fn as_number(&self) -> Option<f64> {
        Some(*self as f64)
    }
}

impl ParamValue for bool {
    const KIND: &'static str = "boolean";
    fn to_value(&self) -> Value {
        Value::from(*self)
    }
    fn from_value(value: &Value) -> Option<Self> {
        value.as_bool()
    }
}

/// A set of parameters by full name, `group.field`: one group of [`params!`](crate::params!), or
/// several under [`param_groups!`](crate::param_groups!).
pub trait Parameters: Clone + Default + Send + Sync + 'static {
    /// The declarations of the parameters, in their order.
    fn all_specs() -> Vec<ParamSpec>;
    /// Sets the parameter `group.field`.
    ///
    /// # Errors
    /// [`Error::Parameter`] if there is none of that name, or the value has the wrong type or is
    /// out of range.
    fn set_named(&mut self, group: &str, field: &str, value: &Value) -> Result<()>;
    /// The values with their full names, in the order of declaration.
    fn all_values(&self) -> Vec<(String, Value)>;

    /// Sets all that `document`, a map of groups to maps of fields, names.
    ///
    /// # Errors
    /// As [`Parameters::set_named`], and [`Error::Parameter`] for what is no map.
    fn set_all(&mut self, document: &Value) -> Result<()> {
        for (group, fields) in as_map(document, "parameters")? {
            for (field, value) in as_map(fields, group)? {
                self.set_named(group, field, value)?;
            }
        }
        Ok(())
    }
}

/// The map `value`, called `name` in the error if it is none.
fn as_map<'a>(value: &'a Value, name: &str) -> Result<&'a serde_json::Map<String, Value>> {
    value.as_object().ok_or_else(|| Error::Parameter {
        name: name.to_owned(),
        message: format!("is {value}; expected a map such as `{name}: {{field: value}}`"),
    })
}

impl ParamValue for String {
    const KIND: &'static str = "string";
    fn to_value(&self) -> Value {
        Value::from(self.as_str())
    }
    fn from_value(value: &Value) -> Option<Self> {
        value.as_str().map(str::to_owned)
    }
}

/// Reads one field; used by [`params!`](crate::params!).
///
/// # Errors
/// [`Error::Parameter`] if the type is wrong or the value out of range.
pub fn read_field<T: ParamValue>(name: &str, value: &Value, range: Option<[f64; 2]>) -> Result<T> {
    let parsed = T::from_value(value).ok_or_else(|| {
        let message = match T::CHOICES {
            [] => format!("{value} is not of type {}", T::KIND),
            choices => format!("{value} is not one of {}", choices.join(", ")),
        };
        Error::Parameter { name: name.to_owned(), message }
    })?;
    if let (Some([low, high]), Some(number)) = (range, parsed.as_number())
        && !(low..=high).contains(&number)
    {
        let message = format!("{number} is out of range; allowed are {low} to {high}");
        return Err(Error::Parameter { name: name.to_owned(), message });
    }
    Ok(parsed)
}

/// Declares an enum whose variants are the words that a choice parameter may take.
#[macro_export]
macro_rules! choice {
    ($(#[$meta:meta])* pub enum $name:ident { $($(#[$vmeta:meta])* $variant:ident = $word:literal,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum $name { $($(#[$vmeta])* $variant,)* }

        impl $crate::params::ParamValue for $name {
            const KIND: &'static str = "choice";
            const CHOICES: &'static [&'static str] = &[$($word),*];
            fn to_value(&self) -> $crate::params::Value {
                $crate::params::Value::from(match self { $($name::$variant => $word,)* })
            }
            fn from_value(value: &$crate::params::Value) -> Option<Self> {
                match value.as_str()? { $($word => Some($name::$variant),)* _ => None }
            }
        }
    };
}

/// Declares a struct of parameter groups, each a struct of [`params!`](crate::params!), that
/// implements [`Parameters`](crate::params::Parameters).
#[macro_export]
macro_rules! param_groups {
    ($(#[$meta:meta])* pub struct $name:ident { $($(#[doc = $doc:literal])* $field:ident: $type:ty,)* }) => {
        $(#[$meta])*
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct $name { $($(#[doc = $doc])* pub $field: $type,)* }

        impl $crate::params::Parameters for $name {
            fn all_specs() -> Vec<$crate::params::ParamSpec> {
                [$(<$type>::specs()),*].concat()
            }
            fn set_named(
                &mut self, group: &str, field: &str, value: &$crate::params::Value,
            ) -> $crate::Result<()> {
                match group {
                    $(<$type>::GROUP => self.$field.set(field, value),)*
                    _ => Err($crate::Error::Parameter {
                        name: format!("{group}.{field}"),
                        message: format!(
                            "there is no group {group}; the groups are {}",
                            [$(<$type>::GROUP),*].join(", ")
                        ),
                    }),
                }
            }
            fn all_values(&self) -> Vec<(String, $crate::params::Value)> {
                let mut all = Vec::new();
                $(all.extend(self.$field.values().into_iter().map(|(field, value)| {
                    (format!("{}.{field}", <$type>::GROUP), value)
                }));)*
                all
            }
        }
    };
}

/// Declares a parameter struct; each field has a default, range, unit and description.
#[macro_export]
macro_rules! params {
    ($(#[$meta:meta])* pub struct $name:ident($group:literal) {
        $($(#[doc = $doc:literal])* $field:ident: $type:ty = $default:expr
            $(, in [$low:expr, $high:expr])? $(, unit $unit:literal)?;)*
    }) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq)]
        pub struct $name { $($(#[doc = $doc])* pub $field: $type,)* }

        impl Default for $name {
            fn default() -> Self { Self { $($field: $default,)* } }
        }

        impl $name {
            /// Name of the group in a parameter file.
            pub const GROUP: &'static str = $group;

            /// The declarations of the parameters, in their order.
            pub fn specs() -> Vec<$crate::params::ParamSpec> {
                let defaults = Self::default();
                vec![$($crate::params::ParamSpec {
                    name: concat!($group, ".", stringify!($field)).to_owned(),
                    kind: <$type as $crate::params::ParamValue>::KIND,
                    default: $crate::params::ParamValue::to_value(&defaults.$field),
                    range: $crate::params!(@range $([$low, $high])?),
                    choices: <$type as $crate::params::ParamValue>::CHOICES,
                    unit: concat!("" $(, $unit)?),
                    description: [$($doc),*].concat().trim().to_owned(),
                }),*]
            }

            /// Sets one field from JSON.
            ///
            /// # Errors
            /// [`Error::Parameter`](crate::Error::Parameter) if there is no such field, or the
            /// value has the wrong type or is out of range.
            pub fn set(&mut self, field: &str, value: &$crate::params::Value) -> $crate::Result<()> {
                match field {
                    $(stringify!($field) => {
                        self.$field = $crate::params::read_field(
                            concat!($group, ".", stringify!($field)), value,
                            $crate::params!(@range $([$low, $high])?))?;
                    })*
                    _ => return Err($crate::Error::Parameter {
                        name: format!("{}.{field}", $group),
                        message: format!("unknown; {} has {}", $group, [$(stringify!($field)),*].join(", ")),
                    }),
                }
                Ok(())
            }

            /// The values as JSON, in the order of declaration.
            pub fn values(&self) -> Vec<(&'static str, $crate::params::Value)> {
                vec![$((stringify!($field), $crate::params::ParamValue::to_value(&self.$field))),*]
            }
        }
    };
    (@range) => { None };
    (@range [$low:expr, $high:expr]) => { Some([$low as f64, $high as f64]) };
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    crate::choice! {
        /// A colour.
        pub enum Colour {
            /// Red.
            Red = "red",
            /// Green.
            Green = "green",
        }
    }

    crate::params! {
        /// For the tests.
        pub struct Sample("sample") {
            /// How far.
            reach: f64 = 0.5, in [0.0, 1.0], unit "m";
            /// How many.
            count: usize = 3, in [1, 10];
            /// Which.
            colour: Colour = Colour::Red;
        }
    }

    #[test]
    fn a_field_is_read_compared_with_its_range_and_described() {
        let mut sample = Sample::default();
        sample.set("reach", &json!(0.25)).unwrap();
        sample.set("count", &json!(7)).unwrap();
        sample.set("colour", &json!("green")).unwrap();
        assert_eq!(sample, Sample { reach: 0.25, count: 7, colour: Colour::Green });
        for (field, value, says) in [
            ("reach", json!(2.0), "out of range; allowed are 0 to 1"),
            ("count", json!(2.5), "not of type integer"),
            ("colour", json!("blue"), "red, green"),
            ("speed", json!(1), "unknown; sample has reach, count, colour"),
        ] {
            let error = sample.set(field, &value).unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        }
        assert_eq!(Sample::GROUP, "sample");
        assert_eq!(sample.values()[1], ("count", json!(7)));
        let specs = Sample::specs();
        assert_eq!(specs[0].name, "sample.reach");
        assert_eq!(specs[0].description, "How far.");
        assert_eq!(specs[0].unit, "m");
        assert_eq!(specs[1].range, Some([1.0, 10.0]));
    }

    crate::param_groups! {
        /// For the tests.
        pub struct Groups {
            /// The only one.
            sample: Sample,
        }
    }

    #[test]
    fn groups_are_set_by_a_document_and_name_what_they_do_not_know() {
        use crate::params::Parameters;
        let mut groups = Groups::default();
        groups.set_all(&json!({"sample": {"reach": 0.75, "count": 2}})).unwrap();
        assert_eq!((groups.sample.reach, groups.sample.count), (0.75, 2));
        assert_eq!(groups.all_values()[0], ("sample.reach".to_owned(), json!(0.75)));
        assert_eq!(Groups::all_specs().len(), 3);
        for (document, says) in [
            (json!({"other": {"reach": 1}}), "there is no group other"),
            (json!({"sample": 3}), "expected a map"),
            (json!(3), "parameters"),
        ] {
            let error = groups.set_all(&document).unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        }
    }

    #[test]
    fn values_read_back_what_they_wrote() {
        use crate::params::ParamValue;
        assert_eq!(f64::from_value(&0.1_f64.to_value()), Some(0.1));
        assert_eq!(usize::from_value(&7_usize.to_value()), Some(7));
        assert_eq!(usize::from_value(&json!(-1)), None);
        assert_eq!(bool::from_value(&true.to_value()), Some(true));
        assert_eq!(String::from_value(&"a".to_owned().to_value()).as_deref(), Some("a"));
        assert_eq!(Colour::from_value(&Colour::Green.to_value()), Some(Colour::Green));
    }
}
