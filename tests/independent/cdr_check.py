"""Holds our interfaces and our CDR against rosbags, an implementation of its own.

1. The standard interfaces have the fields and constants that ROS 2 Jazzy has.
2. msgs/tests/golden.tsv holds, for every type, bytes that rosbags wrote and the values in them; the test
   msgs/tests/golden.rs reads and writes the same. This script fails if the file is not what rosbags writes today.

cdr_check.py --write makes the file.
"""

import json
import sys

import numpy
from rosbags.typesys.store import Typestore

import interfaces

GOLDEN = interfaces.ROOT / "msgs/tests/golden.tsv"
BASE, NAME, ARRAY, SEQUENCE = 1, 2, 3, 4



class Filler:
    """Values that differ from field to field, and are exact in single precision."""

    def __init__(self, store: Typestore) -> None:
        self.store = store
        self.count = 0

    def base(self, kind: str, bound: int) -> bool | int | float | str:
        self.count += 1
        if kind == "bool":
            return self.count % 2 == 1
        if kind == "string":
            text = f"t{self.count}" + "é" * (self.count % 3)
            return text if not bound else text.encode()[:bound].decode(errors="ignore")
        if kind.startswith("float"):
            return self.count * 0.25 - 3.0
        if kind in ("byte", "char"):
            # rosbags takes a char for signed.
            return self.count % 128
        bits = int(kind.removeprefix("u").removeprefix("int"))
        value = self.count % 100
        return (1 << bits) - 1 - value if kind.startswith("u") else -(1 << (bits - 1)) + value

    def value(self, node: tuple, depth: int) -> tuple:
        """The value as rosbags wants it, and as JSON."""
        nodetype, args = int(node[0]), node[1]
        if nodetype == BASE:
            value = self.base(*args)
            return value, value
        if nodetype == NAME:
            return self.message(args, depth)
        element, length = args
        if nodetype == SEQUENCE:
            length = min(length or 3, 3 if depth < 1 else 1)
        pairs = [self.value(element, depth + 1) for _ in range(length)]
        values, plain = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
        if int(element[0]) == BASE and element[1][0] != "string":
            kind = {"byte": "uint8", "char": "uint8"}.get(element[1][0], element[1][0])
            values = numpy.array(values, dtype=numpy.dtype(kind))
        return values, plain

    def message(self, name: str, depth: int) -> tuple:
        values, plain = {}, {}
        for field, node in self.store.fielddefs[name][1]:
            if field == "structure_needs_at_least_one_member":
                values[field] = plain[field] = 0
            else:
                values[field], plain[field] = self.value(node, depth)
        return self.store.types[name](*values.values()), plain


def golden(store: Typestore) -> str:
    lines = ["# Type, bytes that rosbags wrote, values. Made by tests/independent/cdr_check.py --write."]
    for name in interfaces.texts():
        message, plain = Filler(store).message(name, 0)
        data = bytes(store.serialize_cdr(message, name, little_endian=True))
        values = json.dumps(plain, ensure_ascii=False, separators=(",", ":"))
        lines.append(f"{name}\t{data.hex()}\t{values}")
    return "\n".join(lines) + "\n"


def differences(ours: Typestore, theirs: Typestore) -> tuple[list[str], list[str]]:
    """Standard types that differ from Jazzy's, and those that rosbags does not know."""
    found, unknown = [], []
    for name in interfaces.texts():
        if name.startswith(("puffer_msgs/", "kinds/")):
            continue
        if name not in theirs.fielddefs:
            unknown.append(name)
        elif sorted(ours.fielddefs[name][0]) != sorted(theirs.fielddefs[name][0]) or (
            ours.fielddefs[name][1] != theirs.fielddefs[name][1]
        ):
            found.append(f"{name}: {ours.fielddefs[name]} is {theirs.fielddefs[name]} in Jazzy")
    return found, unknown


def main() -> int:
    store = interfaces.store()
    found, unknown = differences(store, interfaces.jazzy())
    print(f"{len(interfaces.texts())} types; rosbags' Jazzy does not hold {len(unknown)}: {unknown}")
    for line in found:
        print(f"FAILED {line}")
    text = golden(store)
    if sys.argv[1:] == ["--write"]:
        GOLDEN.write_text(text)
    elif GOLDEN.read_text() != text:
        print(f"FAILED {GOLDEN} is not what rosbags writes; run cdr_check.py --write")
        return 1
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
