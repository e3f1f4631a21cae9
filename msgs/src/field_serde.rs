//! The serde functions of fields that the derive does not know: arrays of more than 32 elements,
//! and bounded sequences and strings. The generated code uses them.

use serde::de::Error as _;
use serde::ser::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Arrays of any length, without a count before them.
pub mod array {
    use serde::de::{Error, SeqAccess, Visitor};
    use serde::ser::SerializeTuple;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};
    use std::fmt;
    use std::marker::PhantomData;

    /// Serializes the elements in a row.
    pub fn serialize<S: Serializer, T: Serialize, const N: usize>(
        value: &[T; N],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(N)?;
        for element in value {
            tuple.serialize_element(element)?;
        }
        tuple.end()
    }

    /// Deserializes `N` elements in a row.
    pub fn deserialize<'de, D: Deserializer<'de>, T: Deserialize<'de>, const N: usize>(
        deserializer: D,
    ) -> Result<[T; N], D::Error> {
        deserializer.deserialize_tuple(N, Elements::<T, N>(PhantomData))
    }

    struct Elements<T, const N: usize>(PhantomData<T>);

    impl<'de, T: Deserialize<'de>, const N: usize> Visitor<'de> for Elements<T, N> {
        type Value = [T; N];

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(f, "an array of {N} elements")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<[T; N], A::Error> {
            let mut all = Vec::with_capacity(N);
            while let Some(element) = elements.next_element()? {
                all.push(element);
            }
            let length = all.len();
            all.try_into().map_err(|_| A::Error::invalid_length(length, &self))
        }
    }
}

/// The error of a value above the bound of its type.
fn too_long(what: &str, length: usize, bound: usize) -> String {
    format!("a {what} of {length} elements; its type allows {bound}")
}

/// Serializes a sequence of at most `N` elements.
pub fn serialize_sequence<const N: usize, T: Serialize, S: Serializer>(
    value: &Vec<T>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    if value.len() > N {
        return Err(S::Error::custom(too_long("sequence", value.len(), N)));
    }
    value.serialize(serializer)
}

/// Deserializes a sequence of at most `N` elements.
pub fn deserialize_sequence<'de, const N: usize, T: Deserialize<'de>, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Vec<T>, D::Error> {
    let value = Vec::deserialize(deserializer)?;
    if value.len() > N {
        return Err(D::Error::custom(too_long("sequence", value.len(), N)));
    }
    Ok(value)
}

/// Serializes a string of at most `N` bytes.
pub fn serialize_text<const N: usize, S: Serializer>(
    value: &str,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    if value.len() > N {
        return Err(S::Error::custom(too_long("string", value.len(), N)));
    }
    value.serialize(serializer)
}

/// Deserializes a string of at most `N` bytes.
pub fn deserialize_text<'de, const N: usize, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<String, D::Error> {
    let value = String::deserialize(deserializer)?;
    if value.len() > N {
        return Err(D::Error::custom(too_long("string", value.len(), N)));
    }
    Ok(value)
}
