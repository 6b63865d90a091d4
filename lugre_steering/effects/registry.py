# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The catalogue of physics that the baseline leaves out: every module of this folder that holds an ``EFFECT``, and what
users add to it."""

from __future__ import annotations

import difflib
import importlib
import pkgutil
from collections.abc import Iterable

from lugre_steering.chain.compose import Composition, check, compose
from lugre_steering.effects.entry import STAGES, Effect
from lugre_steering.errors import LugreSteeringError


def _shipped() -> Iterable[Effect]:
    package = __name__.rpartition(".")[0]
    folder = importlib.import_module(package).__path__
    for module in pkgutil.iter_modules(folder):
        found = getattr(importlib.import_module(f"{package}.{module.name}"), "EFFECT", None) if module.name not in _NO_EFFECT else None
        if found is not None:
            yield found


_NO_EFFECT = ("entry", "registry")


def _in_order(effects: Iterable[Effect]) -> dict[str, Effect]:
    return {effect.id: effect for effect in sorted(effects, key=lambda e: (STAGES.index(e.stage), e.tier, e.id))}


CATALOGUE: dict[str, Effect] = _in_order(_shipped())
"""All known effects by id, in the order of the chain."""


def effect(effect_id: str) -> Effect:
    """The entry of that name, or an error that offers the nearest one."""
    if effect_id not in CATALOGUE:
        near = difflib.get_close_matches(effect_id, CATALOGUE, n=1)
        hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(CATALOGUE)}"
        raise LugreSteeringError(f"effect '{effect_id}': not in the catalogue; {hint}")
    return CATALOGUE[effect_id]


def composed(ids: Iterable[str] | None = None) -> Composition:
    """The step with the effects of these ids in place (default: all that is known)."""
    chosen = set(CATALOGUE if ids is None else ids)
    return compose([effect for effect in CATALOGUE.values() if effect.id in chosen])


for _effect in CATALOGUE.values():
    check(_effect)
