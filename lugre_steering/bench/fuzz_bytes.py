# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Damage to the bytes of a file, whatever it holds."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

_BLOCK = 4096


def _flip(data: bytearray, dice: random.Random) -> None:
    for _ in range(dice.choice([1, 1, 10, 200])):
        data[dice.randrange(len(data))] ^= 1 << dice.randrange(8)


def _blank(data: bytearray, dice: random.Random) -> None:
    begin = dice.randrange(len(data)) // _BLOCK * _BLOCK
    size = len(data[begin : begin + _BLOCK])
    data[begin : begin + size] = bytes([dice.choice([0, 0x55, 0xFF])]) * size


def _cut(data: bytearray, dice: random.Random) -> None:
    del data[dice.randrange(1, len(data)) :]


def _drop(data: bytearray, dice: random.Random) -> None:
    begin = dice.randrange(len(data))
    del data[begin : begin + dice.choice([1, 8, 100, _BLOCK])]


def _repeat(data: bytearray, dice: random.Random) -> None:
    begin = dice.randrange(len(data))
    data[begin:begin] = data[begin : begin + dice.choice([1, 8, 100, _BLOCK])]


def _extreme(data: bytearray, dice: random.Random) -> None:
    size = dice.choice([1, 2, 4, 8])
    number = dice.choice([0, 1, 2 ** (8 * size - 1), 2 ** (8 * size) - 1, 2 ** (8 * size - 1) - 1])
    begin = dice.randrange(max(len(data) - size, 1))
    data[begin : begin + size] = number.to_bytes(size, dice.choice(["little", "big"]))


_DAMAGES: tuple[Callable[[bytearray, random.Random], None], ...] = (_flip, _blank, _cut, _drop, _repeat, _extreme)


def damage_bytes(file: Path, dice: random.Random) -> str:
    """Damage a file in one way; returns which."""
    data = bytearray(file.read_bytes())
    damage = dice.choice(_DAMAGES)
    damage(data, dice)
    file.write_bytes(data)
    return damage.__name__[1:]
