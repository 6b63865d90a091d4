# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Every name that an effect declares must be one of something: a misspelt one would be dropped in silence."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterator

from lugre_steering.chain.layout import BASELINE_FIELDS
from lugre_steering.effects.entry import NEEDS, RELATIVE_TO, STAGES, Effect
from lugre_steering.errors import EffectError


def check_declared(effect: Effect, known: Collection[str]) -> None:
    """Refuse an effect that declares names which mean nothing; ``known``: ids that may be its rivals."""
    for what, name, among in _declared(effect, known):
        if name not in among:
            near = difflib.get_close_matches(name, among, n=1)
            wanted = f"did you mean '{near[0]}'?" if near else f"expected one of {', '.join(sorted(among)) or 'nothing'}"
            raise EffectError(f"effect '{effect.id}': {what}: got '{name}'; {wanted}")
    if effect.parameters and not effect.hooks and not effect.not_recorded:
        raise EffectError(f"effect '{effect.id}': hooks: got none, expected a law that reads its parameters")


def _declared(effect: Effect, known: Collection[str]) -> Iterator[tuple[str, str, Collection[str]]]:
    """What is declared, the name, and what it must be one of."""
    own = [p.name for p in effect.parameters]
    yield "stage", effect.stage, STAGES
    yield from (("acts_by", name, own) for name in effect.acts_by)
    yield from (("places", name, own) for ends in effect.places for name in ends if name)
    yield from (("play", name, own) for name in (effect.play,) if name)
    yield from (("constants", name, [*own, *effect.tables]) for name in effect.constants)
    yield from (("needs", name, NEEDS) for name in effect.needs)
    yield from (("rivals", name, known) for name in effect.rivals)
    yield from ((f"parameters.{p.name}.relative_to", p.relative_to, RELATIVE_TO) for p in effect.parameters if p.relative_to)
    yield from ((f"memory.{key}", start, BASELINE_FIELDS) for key, start in effect.memory.items() if isinstance(start, str))
