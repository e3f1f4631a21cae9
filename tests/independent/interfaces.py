"""The interface files of puffer, read by rosbags, which has a parser and a CDR writer of its own."""

from pathlib import Path

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

ROOT = Path(__file__).parents[2]
PARTS = {"msg": [""], "srv": ["_Request", "_Response"], "action": ["_Goal", "_Result", "_Feedback"]}


def packages() -> dict[str, Path]:
    """Folder of each package: ours, the standard ones, and that of the generator's tests."""
    found = {"puffer_msgs": ROOT / "msgs", "kinds": ROOT / "msgs/tests/kinds"}
    found |= {folder.name: folder for folder in sorted((ROOT / "msgs/standard").iterdir())}
    return found


def texts() -> dict[str, str]:
    """Text of each message and part, by its ROS name."""
    found = {}
    for package, folder in packages().items():
        for kind, ends in PARTS.items():
            for path in sorted((folder / kind).glob(f"*.{kind}")):
                parts = [""]
                for line in path.read_text().splitlines():
                    if line.strip() == "---":
                        parts.append("")
                    else:
                        parts[-1] += line + "\n"
                for end, part in zip(ends, parts, strict=True):
                    found[f"{package}/{kind}/{path.stem}{end}"] = part
                if kind == "action":
                    found[f"{package}/action/{path.stem}_FeedbackMessage"] = (
                        "unique_identifier_msgs/UUID goal_id\n"
                        f"{package}/action/{path.stem}_Feedback feedback\n"
                    )
    return dict(sorted(found.items()))


def store() -> Typestore:
    """All types, in a store that holds nothing else."""
    types = get_typestore(Stores.EMPTY)
    for name, text in texts().items():
        # rosbags takes no empty text; ROS 2 puts this field into an empty message.
        text = text.strip() or "uint8 structure_needs_at_least_one_member"
        # rosbags' parser knows messages only; the parts of services and actions are such under another name.
        package, _, short = name.split("/")
        (fields,) = get_types_from_msg(text, f"{package}/msg/{short}").values()
        types.register({name: fields})
    return types


def jazzy() -> Typestore:
    """The types of ROS 2 Jazzy as rosbags ships them."""
    return get_typestore(Stores.ROS2_JAZZY)
