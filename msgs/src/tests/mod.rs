//! Tests of the generated types: those of the files, and those of `tests/kinds`, which hold every
//! kind of field.

mod golden;
mod kinds;
