# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Counts and quantities in prose."""

from __future__ import annotations

import re
from collections.abc import Callable

_UNIT = re.compile(r"(?<=\d) (?=(?:[kM]?N m|%|deg|rad|s|kN|N|mm)\b|%)")


def counted(count: int, one: str, several: str = "", show: Callable[[int], str] = str) -> str:
    """'1 recording', '2 recordings'; ``one`` and ``several`` may go on: '1 message is lost', '2 messages are lost'."""
    return f"{show(count)} {one if count == 1 else several or one + 's'}"


def unparted(text: str) -> str:
    """Prose in which no line ends between a number and its unit."""
    return _UNIT.sub("\u00a0", text).replace("N m", "N\u00a0m")
