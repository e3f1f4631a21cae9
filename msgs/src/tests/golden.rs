//! Every type against bytes and values from another implementation
//! (tests/independent/cdr_check.py).

use crate::{Interface, TypeVisitor, cdr, definitions, visit_types};
use serde_json::Value;
use std::collections::BTreeMap;

const GOLDEN: &str = include_str!("../../tests/golden.tsv");

/// What the file says of a type.
struct Golden {
    bytes: Vec<u8>,
    values: Value,
}

fn golden() -> BTreeMap<String, Golden> {
    let lines = GOLDEN.lines().filter(|line| !line.starts_with('#'));
    lines
        .map(|line| {
            let [name, hex, values] = line.split('\t').collect::<Vec<_>>().try_into().unwrap();
            let bytes = (0..hex.len()).step_by(2).map(|at| &hex[at..at + 2]);
            let bytes = bytes.map(|digits| u8::from_str_radix(digits, 16).unwrap()).collect();
            (name.to_string(), Golden { bytes, values: serde_json::from_str(values).unwrap() })
        })
        .collect()
}

/// Holds each type against the file and takes it off the list.
struct Check(BTreeMap<String, Golden>);

impl TypeVisitor for Check {
    fn visit<T: Interface>(&mut self) {
        let name = T::TYPE_NAME;
        let golden = self.0.remove(name).unwrap_or_else(|| panic!("no golden bytes of {name}"));
        let message: T = cdr::from_bytes(&golden.bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(serde_json::to_value(&message).unwrap(), golden.values, "values of {name}");
        assert_eq!(cdr::to_bytes(&message).unwrap(), golden.bytes, "bytes of {name}");
        let from_values: T = serde_json::from_value(golden.values).unwrap();
        assert_eq!(from_values, message, "{name} from its values");

        let cut = &golden.bytes[..golden.bytes.len() - 1];
        assert!(cdr::from_bytes::<T>(cut).is_err(), "{name} was read from too few bytes");
        let long = [golden.bytes, vec![0; 4]].concat();
        assert!(cdr::from_bytes::<T>(&long).is_err(), "{name} was read from too many bytes");
    }
}

#[test]
fn all_types_read_and_write_the_bytes_of_another_implementation() {
    let mut check = Check(golden());
    visit_types(&mut check);
    assert_eq!(check.0.keys().collect::<Vec<_>>(), Vec::<&String>::new(), "unknown types");
}

#[test]
fn the_list_of_definitions_is_sorted_and_complete() {
    let names: Vec<&str> = definitions().iter().map(|(name, _)| *name).collect();
    assert!(names.is_sorted() && names.len() > 90);
    for (name, text) in definitions() {
        for line in text.lines().filter_map(|line| line.strip_prefix("MSG: ")) {
            let (package, short) = line.split_once('/').unwrap();
            let known = ["msg", "action"].iter().any(|kind| {
                let inner = format!("{package}/{kind}/{short}");
                definitions().iter().any(|(other, _)| *other == inner)
            });
            assert!(known, "{name} contains the unknown {line}");
        }
    }
}
