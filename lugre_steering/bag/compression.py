# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Decompression that keeps what can be kept of a torn stream (every codec a rosbag2 recording may use).

Compressed data may be made to unpack without end: everything comes out in small pieces, and stops at a limit.
"""

from __future__ import annotations

import importlib
import importlib.util
import io
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import lz4.frame  # type: ignore[import-untyped]

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
CHUNK_LIMIT = 128 << 20  # bytes of one chunk, packed or not: read at once, and a few copies of it must fit into memory
MESSAGE_LIMIT = 32 << 20  # bytes of one message: more than any camera or laser sends
_FED, _STEP = 1 << 16, 1 << 13  # bytes given to a codec, and taken from it, at a time: where it fails, so much may be lost
_FREE, _RATIO = 256 << 20, 50  # bytes; recordings of sensors shrink to a fifteenth at best
_FREE_MESSAGES = 200_000
_CHUNK_MESSAGES = 1_000_000  # rosbag2 closes a chunk after some 10 000
_LEAST = 4  # bytes of a file for each message: no two have the same times, so 7 are left of them at best


class TooLargeError(Exception):
    """Compressed data unpack to more than any recording would."""


class Allowance:
    """How much one pass over a file may unpack: bounds what a small hostile file can cost.

    Bytes and messages count apart: a message costs as much time as some 500 bytes, but what sets a recording apart from
    repeated bytes differs between them. Both grow with the bytes that were recorded, so a recording of any length has enough.
    """

    def __init__(self, size: int = 0) -> None:
        self._bytes = self._bytes_left = _FREE
        self._messages = self._messages_left = _FREE_MESSAGES
        self.earn(size)

    def earn(self, size: int) -> None:
        """Add what ``size`` recorded bytes may unpack to."""
        self._bytes += _RATIO * size
        self._bytes_left += _RATIO * size
        self._messages += size // _LEAST
        self._messages_left += size // _LEAST

    def spend(self, size: int) -> None:
        """Take ``size`` bytes off."""
        if size > self._bytes_left:
            self._bytes_left = 0
            raise TooLargeError(f"they unpack to more than the {self._bytes >> 20} MB that so few bytes may")
        self._bytes_left -= size

    @property
    def chunk_messages(self) -> int:
        """How many messages a chunk may hold."""
        return min(_CHUNK_MESSAGES, self._messages_left)

    def spend_messages(self, count: int) -> None:
        """Take the ``count`` messages of a chunk off."""
        if count > _CHUNK_MESSAGES:
            raise TooLargeError(f"it holds more than {_CHUNK_MESSAGES} messages")
        if count > self._messages_left:
            self._messages_left = 0
            raise TooLargeError(f"they unpack to more than the {self._messages} messages that so few bytes may hold")
        self._messages_left -= count


class _Zstandard:
    """The interface of the standard library over the package zstandard, fed so little that its output stays small."""

    def __init__(self) -> None:
        self._inner = importlib.import_module("zstandard").ZstdDecompressor().decompressobj()
        self._fed = b""

    def decompress(self, data: bytes, _: int) -> bytes:
        self._fed += data
        now, self._fed = self._fed[:64], self._fed[64:]
        return bytes(self._inner.decompress(now))

    @property
    def needs_input(self) -> bool:
        return not self._fed

    @property
    def eof(self) -> bool:
        return bool(self._inner.eof)

    @property
    def unused_data(self) -> bytes:
        return bytes(self._inner.unused_data) + self._fed


def _zstd_decompressor() -> Callable[[], Any]:
    """Factory of streaming zstd decompressors: standard library (3.14), or what the installed rosbags brings."""
    for package in ("compression", "backports"):
        if importlib.util.find_spec(package) and importlib.util.find_spec(f"{package}.zstd"):
            return importlib.import_module(f"{package}.zstd").ZstdDecompressor  # type: ignore[no-any-return]
    return _Zstandard


zstd_decompressor = _zstd_decompressor()
_DECOMPRESSORS: dict[str, Callable[[], Any]] = {
    "zstd": zstd_decompressor,
    "lz4": lz4.frame.LZ4FrameDecompressor,
}


def _pieces(read: Callable[[int], bytes], compression: str) -> Iterator[bytes]:
    """What comes out of a stream, a little at a time: damage costs no more than its own piece. It may raise anything."""
    if compression not in _DECOMPRESSORS:
        raise ValueError(f"unknown compression {compression!r}")
    decompressor = _DECOMPRESSORS[compression]()
    while data := read(_FED):
        yield decompressor.decompress(data, _STEP)
        while not (decompressor.eof or decompressor.needs_input):
            yield decompressor.decompress(b"", _STEP)
        if decompressor.eof:
            if rest := decompressor.unused_data or read(1):
                raise ValueError(f"{len(rest)} or more bytes follow the compressed data")
            return
    raise EOFError("compressed data end early")


def expand(
    data: bytes | bytearray | memoryview, compression: str, limit: int, allowance: Allowance
) -> tuple[bytearray, str]:
    """What a stream of at most ``limit`` bytes holds, and "" or why it ends early (what came before is kept)."""
    plain = bytearray()
    try:
        for piece in _pieces(io.BytesIO(data).read, compression):
            if len(plain) + len(piece) > limit:
                raise TooLargeError(f"they unpack to more than {limit} bytes")
            allowance.spend(len(piece))
            plain += piece
    except TooLargeError:
        raise
    except Exception as error:  # whatever a codec raises on damaged bytes
        return plain, str(error)
    return plain, ""


def expand_file(source: Path, target: Path) -> str:
    """Decompress a zstd file to ``target``; returns "" or why it stopped early (what came before is kept)."""
    allowance = Allowance(source.stat().st_size)
    with source.open("rb") as compressed, target.open("wb") as plain:
        try:
            for piece in _pieces(compressed.read, "zstd"):
                allowance.spend(len(piece))
                plain.write(piece)
        except OSError:
            raise
        except Exception as error:  # whatever a codec raises on damaged bytes
            return f"only a part of the compressed data can be used: {error}"
    return ""
