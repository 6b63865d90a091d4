# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Counts in words."""

from __future__ import annotations


def counted(count: int, one: str, several: str = "") -> str:
    """'1 recording', '2 recordings'; ``one`` and ``several`` may go on: '1 message is lost', '2 messages are lost'."""
    return f"{count} {one if count == 1 else several or one + 's'}"
