//! System tests of puffer: see `tests/`.
