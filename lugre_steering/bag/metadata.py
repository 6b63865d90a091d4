# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The few facts that a reader needs of metadata.yaml, without building the rest of it.

YAML can be made to grow without end (aliases of aliases) or to nest deeper than a parser's stack. So the file is gone
through event by event, and nothing but the wanted scalars is kept.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import NamedTuple

import yaml

_LIMIT = 2 << 20  # bytes; some 4000 topics
_DEPTH = 32
_ROOT = "rosbag2_bagfile_information"
_TOPICS = (_ROOT, "topics_with_message_count")
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the same in C where PyYAML has it


class Metadata(NamedTuple):
    """Files of a bag in order, and how many messages they hold together and of each topic, as far as that is told."""

    files: list[str]
    messages: int
    of_topic: Counter[str]


def read_metadata(path: Path) -> Metadata:
    """Read a rosbag2 metadata.yaml; raises ValueError with the reason where it is not one."""
    with path.open("rb") as file:
        text = file.read(_LIMIT + 1)
    if len(text) > _LIMIT:
        raise ValueError(f"more than {_LIMIT >> 20} MB")
    found = _scalars(text)
    files, count = found.get("relative_file_paths", []), found.get("message_count", [""])[0]
    if not files or not _is_count(count):
        raise ValueError(f"got message_count {count[:40]!r} and {len(files)} relative_file_paths, expected a number and paths")
    topics, counts = found.get("topic name", []), found.get("topic message_count", [])
    of_topic: Counter[str] = Counter()
    if len(topics) == len(counts) and all(map(_is_count, counts)):
        for topic, of_one in zip(topics, counts, strict=True):
            of_topic[topic] += int(of_one)
    return Metadata(files, int(count), of_topic)


def _is_count(text: str) -> bool:
    return text.isascii() and text.isdigit() and len(text) < 19


def _scalars(text: bytes) -> dict[str, list[str]]:
    """Scalars, alone or in a list, by their key in the mapping of the bag; of its topics the names and counts."""
    found: dict[str, list[str]] = {}
    open_keys: list[str | None] = []  # of each open mapping the key whose value comes next; "" for a list
    try:
        for event in yaml.parse(text, _LOADER):
            if isinstance(event, yaml.CollectionStartEvent):
                open_keys.append("" if isinstance(event, yaml.SequenceStartEvent) else None)
                if len(open_keys) > _DEPTH:
                    raise ValueError(f"nested more than {_DEPTH} deep")
                continue
            key = "?"  # of what is no plain text
            if isinstance(event, yaml.ScalarEvent):
                key = event.value or key
                match open_keys:
                    case [root, str(name)] | [root, str(name), ""] if root == _ROOT:
                        found.setdefault(name, []).append(event.value)
                    case [root, topics, "", str(name)] | [root, topics, "", "topic_metadata", str(name)] if (root, topics) == _TOPICS:
                        found.setdefault(f"topic {name}", []).append(event.value)
            elif isinstance(event, yaml.CollectionEndEvent):
                open_keys.pop()
            elif not isinstance(event, yaml.AliasEvent):
                continue
            if open_keys and open_keys[-1] != "":  # in a mapping a key and its value take turns
                open_keys[-1] = key if open_keys[-1] is None else None
    except yaml.YAMLError as error:
        raise ValueError(str(error).partition("\n")[0]) from error
    return found
