# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Effects of users that are not made of what effects are made of: refused by file, key, value and what was expected."""

from __future__ import annotations

from pathlib import Path

import pytest

from lugre_steering.effects.own import read_effects
from lugre_steering.errors import EffectError

EFFECT = """\
from lugre_steering.effects.entry import Effect, Parameter
def torque(theta, size):
    return size * theta
EFFECT = Effect(id="own", stage="parallel", tier=2, title="Own", equation="M", source="own", trace="own", coordinate="time",
                parameters=(Parameter("size", "N m", "size", 1.0, 0.0, 5.0),), hooks={"torque": torque})
"""


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('id="own"', "id=5", "id: got 5, expected a name"), ('id="own"', 'id="class"', "id: got 'class'"),
        ('id="own"', f'id="{"a" * 61}"', "of 60 at most"),
        ('title="Own"', 'title="O\\nwn"', "title: got 'O\\\\nwn', expected a text of one"),
        ("tier=2", 'tier="x"', "tier: got 'x'"), ('{"torque": torque}', "torque", "hooks: got <function"),
        ('{"torque": torque}', '{"torque": max}', "hooks.torque: got <built-in"),
        ('{"torque": torque}', '{"torque": 5}', "hooks.torque: got 5"),
        ('(Parameter("size", "N m", "size", 1.0, 0.0, 5.0),)', '("x",)', "parameters: got"),
        ("1.0, 0.0, 5.0", '"x", 0.0, 5.0', "parameters.size.scale: got 'x'"),
        ("1.0, 0.0, 5.0", "1.0, 5.0, 1.0", "parameters.size.low: got 5.0"),
        ("1.0, 0.0, 5.0", "0.0, 0.0, 5.0", "parameters.size.scale: got 0.0"), ("1.0, 0.0, 5.0", "1.0, 0.0, 5.0, (7.0,)", "size.grid: got"),
        ("hooks={", "variants=5, hooks={", "variants: got 5"), ("EFFECT = ", "EFFECT = __import__('sys').exit(3) or ", "SystemExit: 3"),
    ],
)  # fmt: skip
def test_what_is_no_effect_is_refused(tmp_path: Path, old: str, new: str, told: str) -> None:
    file = tmp_path / "own.py"
    assert old in EFFECT
    file.write_text(EFFECT.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(EffectError, match=told.replace("(", "\\(")) as refused:
        read_effects(file)
    assert str(file) in str(refused.value)


def test_two_effects_of_one_id_are_refused_and_one_is_taken(tmp_path: Path) -> None:
    file = tmp_path / "own.py"
    file.write_text(EFFECT, encoding="utf-8")
    assert [effect.id for effect in read_effects(file)[0]] == ["own"]
    file.write_text(EFFECT + "EFFECTS = [EFFECT, EFFECT]\n", encoding="utf-8")
    with pytest.raises(EffectError, match="id: got own more than once"):
        read_effects(file)
