# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Which recordings a proof consists of: nulls, every effect at graded sizes and in disguise, pairs, and unlisted physics."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np

from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.errors import DataError
from lugre_steering.proof.conceal import EFFECT_IDS, UNLISTED_IDS, ZONED
from lugre_steering.proof.sensors import NoiseKind

NOISES: tuple[NoiseKind, ...] = ("white", "coloured", "ripple")
RATIOS = (0.1, 0.3, 1.0, 10.0)
"""Wanted variance of an effect after recalibration over the variance of the noise."""
DISGUISE_RATIO = 1.0
PAIR_RATIO = 1.0
NULLS, REPEATS, PAIRS, UNLISTED_REPEATS = 102, 2, 24, 3
PEERS_EVERY = 4
"""The peers, which take about as long as the diagnosis, are compared on one in so many of the cases."""
WITHOUT_LATE_START = ("mullins_softening",)
"""Acts on the first sweep only, so it cannot begin late."""

QUICK = {"null": 8, "single": 14, "one-bag": 2, "late": 2, "barely": 1, "pair": 3, "unlisted": 4}
QUICK_RATIO = 1.0
"""Least wanted ratio of the effects of a quick run: it shows the naming, not the limit of detection."""


@dataclass(frozen=True)
class Hiding:
    """One recording to be made: what it hides and how; ``ratio`` is wanted of each effect, sizes are found by simulation.

    ``disguise``: 'one-bag', 'late', 'barely' or none. ``seed`` belongs to the name, so any subset repeats the same cases.
    """

    name: str
    kind: str
    effects: tuple[str, ...]
    ratio: float
    noise: NoiseKind
    seed: int
    disguise: str = ""


def campaign(seed: int) -> list[Hiding]:
    """Every case of the full run, in random order, so that an unfinished run is a fair sample."""
    cases = [
        *(_hiding(seed, f"null/{NOISES[i % 3]}/{i // 3:02d}", "null", (), 0.0, NOISES[i % 3]) for i in range(NULLS)),
        *(
            _hiding(seed, f"single/{effect}/{ratio:g}/{i}", "single", (effect,), ratio)
            for effect in EFFECT_IDS for ratio in RATIOS for i in range(REPEATS)
        ),
        *(
            _hiding(seed, f"{disguise}/{effect}", disguise, (effect,), DISGUISE_RATIO, disguise=disguise)
            for disguise in ("one-bag", "late", "barely") for effect in EFFECT_IDS if _fits(disguise, effect)
        ),
        *(_hiding(seed, f"pair/{a}+{b}", "pair", (a, b), PAIR_RATIO) for a, b in _pairs(seed)),
        *(
            _hiding(seed, f"unlisted/{effect}/{ratio:g}/{i}", "unlisted", (effect,), ratio)
            for effect in UNLISTED_IDS for ratio in RATIOS for i in range(UNLISTED_REPEATS)
        ),
    ]  # fmt: skip
    return [cases[i] for i in np.random.default_rng((seed, 1)).permutation(len(cases))]


def quick(cases: Sequence[Hiding]) -> list[Hiding]:
    """A stratified few of each kind, different effects; one of every kind first, so that a run cut short has them all."""
    chosen: dict[str, list[Hiding]] = {kind: [] for kind in QUICK}
    seen: set[tuple[str, tuple[str, ...]]] = set()
    for case in cases:
        plenty = len(chosen[case.kind]) >= QUICK[case.kind] or (case.kind != "null" and case.ratio < QUICK_RATIO)
        if plenty or (case.effects and (case.kind, case.effects) in seen):
            continue
        seen.add((case.kind, case.effects))
        chosen[case.kind].append(case)
    share = {case.name: i / len(group) for group in chosen.values() for i, case in enumerate(group)}
    return sorted((case for group in chosen.values() for case in group), key=lambda case: share[case.name])


def matching(cases: Sequence[Hiding], pattern: str) -> list[Hiding]:
    """Cases whose name fits a shell pattern such as ``single/end_stop/*``."""
    found = [case for case in cases if fnmatchcase(case.name, pattern)]
    if not found:
        raise DataError(f"--cases {pattern!r}: no case has such a name; expected a pattern such as 'null/*' or 'single/end_stop/*'")
    return found


def _hiding(
    seed: int, name: str, kind: str, effects: tuple[str, ...], ratio: float, noise: NoiseKind | None = None, disguise: str = ""
) -> Hiding:
    own = int(np.random.SeedSequence([seed, zlib.crc32(name.encode())]).generate_state(1)[0])
    return Hiding(name, kind, effects, ratio, noise or NOISES[own % 3], own, disguise)


def _fits(disguise: str, effect: str) -> bool:
    if disguise == "barely":
        return effect in ZONED
    return not (disguise == "late" and effect in WITHOUT_LATE_START)


def _pairs(seed: int) -> list[tuple[str, str]]:
    """Random pairs of effects that recordings can tell apart: none is in the other's list of rivals."""
    possible = [
        (a, b) for i, a in enumerate(EFFECT_IDS) for b in EFFECT_IDS[i + 1 :]
        if b not in CATALOGUE[a].rivals and a not in CATALOGUE[b].rivals
    ]  # fmt: skip
    chosen = np.random.default_rng((seed, 2)).choice(len(possible), PAIRS, replace=False)
    return [possible[i] for i in chosen]
