# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The YAML that users give, read so that no text can mean another number than it shows, or take the program down.

Numbers are decimal as in YAML 1.2: ``25.0e6`` and ``1e4`` are numbers; ``010`` and ``1:30``, which YAML 1.1 takes for 8 and 90,
are texts, and so refused where a number is expected.
"""

from __future__ import annotations

import re
from typing import Any

import yaml
from yaml.nodes import Node

LONGEST = 500_000
"""Characters. A vehicle file with its rubber table has some ten thousand; reading this many takes a few seconds."""
DEEPEST = 50
"""Levels of lists and mappings in one another."""
LARGEST = 100_000
"""Values in all, those that aliases repeat counted each time."""

_NUMBERS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")
_INTEGER = re.compile(r"[-+]?(0|[1-9]\d*)$", re.ASCII)
_FLOAT = re.compile(
    r"[-+]?((0|[1-9]\d*)\.\d*([eE][-+]?\d+)?|\.\d+([eE][-+]?\d+)?|(0|[1-9]\d*)[eE][-+]?\d+|\.(inf|Inf|INF))$|\.(nan|NaN|NAN)$", re.ASCII
)


class Loader(yaml.SafeLoader):
    """SafeLoader with decimal numbers only and with limits; refuses a key that stands twice, of which only the last would
    count, and tags, which turn a text into something else than it shows."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._depth = 0
        self._size: dict[int, int] = {}
        """Values in each finished node, by its identity."""

    def compose_node(self, parent: Node | None, index: Any) -> Node | None:
        event: Any = self.peek_event()  # type: ignore[no-untyped-call]
        alias = isinstance(event, yaml.AliasEvent)
        if not alias and event.tag not in (None, "!"):
            raise _refusal(f"the tag '{event.tag}' is not allowed", event)
        self._depth += 1
        if self._depth > DEEPEST:
            raise _refusal(f"more than {DEEPEST} levels deep", event)
        node = super().compose_node(parent, index)
        self._depth -= 1
        if alias and id(node) not in self._size:
            raise _refusal(f"the alias '{event.anchor}' stands for what it stands in", event)
        if not alias:
            self._size[id(node)] = 1 + sum(self._size[id(inner)] for inner in _inside(node))
        if self._size[id(node)] > LARGEST:
            raise _refusal(f"more than {LARGEST} values, aliases written out", event)
        return node

    def compose_mapping_node(self, anchor: Any) -> yaml.MappingNode:
        node = super().compose_mapping_node(anchor)
        seen = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise yaml.composer.ComposerError(None, None, "a key that is no plain text or number", key.start_mark)
            if (key.tag, key.value) in seen and key.tag != "tag:yaml.org,2002:merge":
                raise yaml.composer.ComposerError(None, None, f"the key '{key.value}' stands twice", key.start_mark)
            seen.add((key.tag, key.value))
        return node


Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag not in _NUMBERS]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
Loader.add_implicit_resolver(_NUMBERS[0], _INTEGER, list("-+0123456789"))
Loader.add_implicit_resolver(_NUMBERS[1], _FLOAT, list("-+.0123456789"))


def parse(text: str) -> object:
    """Plain data of one YAML document; ``yaml.YAMLError`` or ``ValueError`` for anything that is none."""
    if len(text) > LONGEST:
        raise ValueError(f"{len(text)} characters, expected at most {LONGEST}")
    return yaml.load(text, Loader=Loader)


def _inside(node: Any) -> list[Node]:
    if isinstance(node, yaml.MappingNode):
        return [inner for pair in node.value for inner in pair]
    return list(node.value) if isinstance(node, yaml.SequenceNode) else []


def _refusal(reason: str, event: Any) -> yaml.YAMLError:
    return yaml.composer.ComposerError(None, None, reason, event.start_mark)
