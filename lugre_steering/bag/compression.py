# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Decompression that keeps what can be kept of a torn stream (every codec a rosbag2 recording may use)."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import Any

import lz4.frame  # type: ignore[import-untyped]

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"


def _zstd_decompressor() -> Callable[[], Any]:
    """Factory of streaming zstd decompressors: standard library (3.14), or what the installed rosbags brings."""
    for package in ("compression", "backports"):
        if importlib.util.find_spec(package) and importlib.util.find_spec(f"{package}.zstd"):
            return importlib.import_module(f"{package}.zstd").ZstdDecompressor  # type: ignore[no-any-return]
    zstandard = importlib.import_module("zstandard")
    return lambda: zstandard.ZstdDecompressor().decompressobj()


zstd_decompressor = _zstd_decompressor()


def expand(data: bytes, compression: str) -> bytes:
    """Decompress a whole or torn stream; of a torn one, what its complete blocks hold. Damage may raise anything."""
    if compression == "":
        return data
    if compression == "zstd":
        return bytes(zstd_decompressor().decompress(data))
    if compression == "lz4":
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data))
    raise ValueError(f"unknown compression {compression!r}")


def expand_file(source: Path, target: Path) -> str:
    """Decompress a zstd file to ``target``; returns "" or why it stopped early (what came before is kept)."""
    decompressor = zstd_decompressor()
    with source.open("rb") as compressed, target.open("wb") as plain:
        try:
            while data := compressed.read(1 << 20):
                plain.write(decompressor.decompress(data))
                if getattr(decompressor, "eof", False):
                    if rest := decompressor.unused_data + compressed.read(1):
                        return f"{len(rest)} or more bytes follow the compressed data"
                    return ""
        except Exception as error:
            return f"compressed data are damaged: {error}"
    return "compressed data end early"
