# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Which recordings a proof consists of: nulls, effects at graded sizes, in disguise and together, unlisted physics, dirt, wrong sheets."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import combinations, zip_longest

import numpy as np

from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.errors import DataError
from lugre_steering.proof.conceal import EFFECT_IDS, UNLISTED_IDS, ZONED
from lugre_steering.proof.field.hidden import CATALOGUE as FIELD_CATALOGUE
from lugre_steering.proof.field.hidden import ZONED as FIELD_ZONED
from lugre_steering.proof.sensors import NoiseKind

NOISES: tuple[NoiseKind, ...] = ("white", "coloured", "ripple")
RATIOS = (0.1, 0.3, 1.0, 10.0)
"""Wanted variance of an effect after recalibration over the variance of the noise."""
LAW_RATIOS = (1.0, 3.0, 10.0)
DISGUISES = ("one-bag", "late", "barely")
FIELD_IDS = tuple(FIELD_CATALOGUE)
DISGUISE_RATIO = 1.0
PAIR_RATIO = 1.0
NULLS, REPEATS, PAIRS, TRIPLES, UNLISTED_REPEATS = 102, 2, 24, 12, 3
LEAST = 32
"""Cases of each disguise at least: fewer say too little."""
LAWS, DIRTY, SHEETS, FIELD_NULLS, FIELD_PAIRS, FIELD_TRIPLES = 45, 102, 63, 30, 24, 12
WITHOUT = "without"
"""Kind of the cases that are diagnosed a second time, with what they hide taken away from the catalogue."""
PEERS_EVERY = 4
"""The peers, which take about as long as the diagnosis, are compared on one in so many of the cases."""
WITHOUT_LATE_START = ("mullins_softening",)
"""Acts on the first sweep only, so it cannot begin late."""

QUICK = {
    "null": 6, "single": 10, "one-bag": 1, "late": 1, "barely": 1, "pair": 2, "triple": 1, "unlisted": 3, "law": 2, "dirty": 4, "sheet": 4,
    "beside": 4, "without": 2,
}  # fmt: skip
"""Cases of each kind, all simulators together."""
QUICK_RATIO = 1.0
"""Least wanted ratio of the effects of a quick run: it shows the naming, not the limit of detection."""


@dataclass(frozen=True)
class Hiding:
    """One recording to be made: what it hides and how; ``ratio`` is wanted of each effect, sizes are found by simulation.

    ``disguise``: 'one-bag', 'late', 'barely' or none. ``seed`` belongs to the name, so any subset repeats the same cases.
    ``simulator``: 2 or 3. ``which``: number of the wrong sheet.
    """

    name: str
    kind: str
    effects: tuple[str, ...]
    ratio: float
    noise: NoiseKind
    seed: int
    disguise: str = ""
    simulator: int = 2
    which: int = 0


def campaign(seed: int, simulators: Sequence[int] = (2, 3)) -> list[Hiding]:
    """Every case of the full run, in random order, so that an unfinished run is a fair sample."""
    cases = [case for simulator in simulators for case in {2: _second, 3: _third}[simulator](seed)]
    return [cases[i] for i in np.random.default_rng((seed, 1)).permutation(len(cases))]


def _second(seed: int) -> list[Hiding]:
    """The second simulator: a world like the sheet's, every effect at graded sizes."""
    return [
        *(_hiding(seed, f"null/{NOISES[i % 3]}/{i // 3:02d}", "null", (), 0.0, NOISES[i % 3]) for i in range(NULLS)),
        *(
            _hiding(seed, f"single/{effect}/{ratio:g}/{i}", "single", (effect,), ratio)
            for effect in EFFECT_IDS for ratio in RATIOS for i in range(REPEATS)
        ),
        *(
            _hiding(seed, f"{disguise}/{effect}{again}", disguise, (effect,), DISGUISE_RATIO, disguise=disguise)
            for disguise in DISGUISES for effect, again in _repeated([e for e in EFFECT_IDS if _fits(disguise, e)])
        ),
        *(_hiding(seed, f"pair/{'+'.join(some)}", "pair", some, PAIR_RATIO) for some in _together(seed, EFFECT_IDS, 2, PAIRS)),
        *(_hiding(seed, f"triple/{'+'.join(some)}", "triple", some, PAIR_RATIO) for some in _together(seed, EFFECT_IDS, 3, TRIPLES)),
        *(
            _hiding(seed, f"unlisted/{effect}/{ratio:g}/{i}", "unlisted", (effect,), ratio)
            for effect in UNLISTED_IDS for ratio in RATIOS for i in range(UNLISTED_REPEATS)
        ),
        *(_hiding(seed, f"law/{i:02d}", "law", ("law",), LAW_RATIOS[i % 3]) for i in range(LAWS)),
        *(_hiding(seed, f"{WITHOUT}/{effect}", WITHOUT, (effect,), RATIOS[-1]) for effect in EFFECT_IDS),
    ]  # fmt: skip


def _third(seed: int) -> list[Hiding]:
    """The third simulator: friction of another form, other machines, sensors and sheets of the field."""

    def case(name: str, kind: str, effects: tuple[str, ...], ratio: float, which: int = 0, disguise: str = "") -> Hiding:
        return _hiding(seed, f"3/{name}", kind, effects, ratio, disguise=disguise, simulator=3, which=which)

    return [
        *(case(f"dirty/{i:03d}", "dirty", (), 0.0) for i in range(DIRTY)),
        *(case(f"null/{i:02d}", "null", (), 0.0) for i in range(FIELD_NULLS)),
        *(case(f"sheet/{i:02d}", "sheet", (), 0.0, which=i) for i in range(SHEETS)),
        *(case(f"beside/{effect}/{ratio:g}", "beside", (effect,), ratio) for effect in FIELD_IDS for ratio in RATIOS[1:]),
        *(case(f"single/{effect}/{ratio:g}", "single", (effect,), ratio) for effect in FIELD_IDS for ratio in RATIOS[1:]),
        *(
            case(f"{disguise}/{effect}{again}", disguise, (effect,), DISGUISE_RATIO, disguise=disguise)
            for disguise in DISGUISES for effect, again in _repeated([e for e in FIELD_IDS if disguise != "barely" or e in FIELD_ZONED])
        ),
        *(case(f"pair/{'+'.join(some)}", "pair", some, PAIR_RATIO) for some in _together(seed, FIELD_IDS, 2, FIELD_PAIRS)),
        *(case(f"triple/{'+'.join(some)}", "triple", some, PAIR_RATIO) for some in _together(seed, FIELD_IDS, 3, FIELD_TRIPLES)),
        *(case(f"law/{i:02d}", "law", ("law",), LAW_RATIOS[i % 3]) for i in range(LAWS)),
    ]  # fmt: skip


def _repeated(effects: Sequence[str]) -> list[tuple[str, str]]:
    """Effects in turn until there are LEAST of them, with what makes the names of repeats different."""
    turns = max(-(-LEAST // len(effects)), 1)
    return [(effect, f"/{turn}" if turn else "") for turn in range(turns) for effect in effects]


def quick(cases: Sequence[Hiding]) -> list[Hiding]:
    """A stratified few of each kind, different effects; one of every kind first, so that a run cut short has them all."""
    chosen: dict[str, list[Hiding]] = {kind: [] for kind in QUICK}
    seen: set[tuple[str, tuple[str, ...]]] = set()
    for case in cases:
        plenty = len(chosen[case.kind]) >= QUICK[case.kind] or (bool(case.effects) and case.ratio < QUICK_RATIO)
        if plenty or (case.effects and case.kind != "law" and (case.kind, case.effects) in seen):
            continue
        seen.add((case.kind, case.effects))
        chosen[case.kind].append(case)
    share = {case.name: i / len(group) for group in chosen.values() for i, case in enumerate(group)}
    return sorted((case for group in chosen.values() for case in group), key=lambda case: share[case.name])


def sampled(cases: Sequence[Hiding], each: int) -> list[Hiding]:
    """At most so many at random of each kind of each simulator; one of every kind first, so that a run cut short has them all."""
    groups: dict[tuple[int, str], list[Hiding]] = {}
    for case in sorted(cases, key=lambda case: case.seed):  # seeds are drawn by the seed of the campaign
        groups.setdefault((case.simulator, case.kind), []).append(case)
    return [case for some in zip_longest(*(group[:each] for group in groups.values())) for case in some if case is not None]


def matching(cases: Sequence[Hiding], pattern: str) -> list[Hiding]:
    """Cases whose name fits a shell pattern such as ``single/end_stop/*``."""
    found = [case for case in cases if fnmatchcase(case.name, pattern)]
    if not found:
        raise DataError(f"--cases {pattern!r}: no case has such a name; expected a pattern such as 'null/*' or 'single/end_stop/*'")
    return found


def of_kinds(cases: Sequence[Hiding], kinds: str) -> list[Hiding]:
    """Cases of some kinds, written with commas between."""
    wanted, known = [kind.strip() for kind in kinds.split(",")], set(QUICK)
    unknown = [kind for kind in wanted if kind not in known]
    if unknown:
        raise DataError(f"--kinds {kinds!r}: {unknown[0]!r} is no kind; expected some of {', '.join(QUICK)}")
    found = [case for case in cases if case.kind in wanted]
    if not found:
        raise DataError(f"--kinds {kinds!r}: the chosen simulator has no such cases")
    return found


def _hiding(
    seed: int, name: str, kind: str, effects: tuple[str, ...], ratio: float, noise: NoiseKind | None = None, disguise: str = "",
    simulator: int = 2, which: int = 0,
) -> Hiding:  # fmt: skip
    own = int(np.random.SeedSequence([seed, zlib.crc32(name.encode())]).generate_state(1)[0])
    return Hiding(name, kind, effects, ratio, noise or NOISES[own % 3], own, disguise, simulator, which)


def _fits(disguise: str, effect: str) -> bool:
    if disguise == "barely":
        return effect in ZONED
    return not (disguise == "late" and effect in WITHOUT_LATE_START)


def _together(seed: int, effects: Sequence[str], size: int, count: int) -> list[tuple[str, ...]]:
    """Random sets of effects that recordings can tell apart: none is in another's list of rivals."""
    possible = [
        some for some in combinations(effects, size)
        if not any(b in CATALOGUE[a].rivals or a in CATALOGUE[b].rivals for a, b in combinations(some, 2))
    ]  # fmt: skip
    chosen = np.random.default_rng((seed, size)).choice(len(possible), count, replace=False)
    return [possible[i] for i in chosen]
