# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Text files to be damaged: vehicle, parameter and effect files, defaults, earlier results, import maps and tables."""

from __future__ import annotations

import random
import shutil
import tempfile
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path

from lugre_steering.bench.fuzz_bytes import damage_bytes
from lugre_steering.errors import ImplausibleWarning, LugreSteeringError
from lugre_steering.resources import config_folder

_SIGNS = (
    "{", "}", "[", "]", ":", ",", "-", "#", "&a ", "*a ", "!!python/object:os.system ", "|", ">", "%", "'", '"', "\t", "\n", "\0",
    "\u2028",
)  # fmt: skip
_NUMBERS = (
    "1e308", "-1e308", "1e-308", "5e-324", ".nan", ".inf", "-.inf", "0", "-0.0", "010", "1:30", "0x10", "1_000", "9" * 400, "1e",
    "true", "null",
)  # fmt: skip


def _insert_sign(text: str, dice: random.Random) -> str:
    at = dice.randrange(len(text) + 1)
    return text[:at] + dice.choice(_SIGNS) * dice.choice([1, 1, 3, 3000]) + text[at:]


def _replace_number(text: str, dice: random.Random) -> str:
    places = [i for i, letter in enumerate(text) if letter.isdigit()]
    if not places:
        return text
    begin = end = dice.choice(places)
    while end < len(text) and (text[end].isalnum() or text[end] in ".+-"):
        end += 1
    return text[:begin] + dice.choice(_NUMBERS) + text[end:]


def _cut(text: str, dice: random.Random) -> str:
    return text[: dice.randrange(len(text) + 1)]


def _drop_line(text: str, dice: random.Random) -> str:
    lines = text.splitlines(keepends=True)
    del lines[dice.randrange(len(lines))]
    return "".join(lines)


def _swap_lines(text: str, dice: random.Random) -> str:
    lines = text.splitlines(keepends=True)
    a, b = dice.randrange(len(lines)), dice.randrange(len(lines))
    lines[a], lines[b] = lines[b], lines[a]
    return "".join(lines)


def _repeat_part(text: str, dice: random.Random) -> str:
    at = dice.randrange(len(text))
    return text[:at] + text[at : at + dice.choice([1, 20, 400])] * dice.choice([2, 2, 50]) + text[at:]


_DAMAGES: tuple[Callable[[str, random.Random], str], ...] = (
    _insert_sign, _replace_number, _replace_number, _cut, _drop_line, _swap_lines, _repeat_part,
)  # fmt: skip


def _damage(file: Path, dice: random.Random) -> str:
    """Damage a file as text, or where it is none, and now and then, as bytes; returns what was done."""
    if file.suffix == ".npz" or dice.random() < 0.1:
        return f"{file.name}: {damage_bytes(file, dice)}"
    text = file.read_text(encoding="utf-8")
    done = []
    for _ in range(dice.choice([1, 1, 2, 5])):
        damage = dice.choice(_DAMAGES)
        text = damage(text or " ", dice)
        done.append(damage.__name__[1:])
    file.write_bytes(text.encode("utf-8", "surrogatepass"))
    return f"{file.name}: {', '.join(done)}"


def copied(names: list[str], folder: Path) -> None:
    """Shipped files of config/ into the corpus."""
    for name in names:
        shutil.copy(config_folder() / name, folder / name)


def tried(folder: Path, case: int, uses: Mapping[str, Callable[[Path], object]]) -> tuple[str, str]:
    """Copy the corpus, damage one of its files, and use it: ``uses`` of the copy, by the name of the file."""
    dice = random.Random(case)
    with tempfile.TemporaryDirectory(prefix="lugre_steering_fuzz_") as temporary, warnings.catch_warnings():
        warnings.simplefilter("ignore", ImplausibleWarning)
        place = Path(temporary) / "corpus"
        shutil.copytree(folder, place)
        name = dice.choice(list(uses))
        done = _damage(place / name, dice)
        try:
            uses[name](place)
        except LugreSteeringError as error:
            return "refused", f"{done}: {error}"
    return "read", done
