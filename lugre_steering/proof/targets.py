# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Targets, and when they may be called met: never on fewer cases than the interval of the score allows."""

from __future__ import annotations

from typing import NamedTuple

from lugre_steering.proof.campaign import RATIOS
from lugre_steering.proof.result import OfSimulator, Score, Share, Status, TargetReached
from lugre_steering.proof.scores import interval

FEWEST_FOR_A_MEDIAN = 6
"""The 95 % sign interval of a median does not exist below."""


class Target(NamedTuple):
    """What is wanted of a score: a share or a median at least (or, ``most``, at most) ``value``; ``lower`` of its interval, if asked."""

    what: str
    value: float
    most: bool = False
    lower: float = 0.0


TARGETS: dict[str, Target] = {
    "nulls_silent": Target("nulls left alone", 0.98, lower=0.95),
    "named_from_0.3": Target("right name or tie, effect-to-noise 0.3 and above", 0.97),
    "named_at_0.1": Target("right name or tie, effect-to-noise 0.1", 0.80),
    "extra_names": Target("false second name beside a right one", 0.03, most=True),
    "both_of_two": Target("both of two effects", 0.95), "all_of_three": Target("all of three effects", 0.85),
    "late": Target("right name or tie, begins late", 0.93), "one-bag": Target("right name or tie, in one bag only", 0.93),
    "barely": Target("right name or tie, barely visited", 0.93),
    "unlisted": Target("fixed unlisted kinds called unlisted, 0.3 and above", 0.90),
    "laws": Target("generated laws called unlisted, 0.3 and above", 0.90),
    "laws_foretold": Target("removable error removed on an unseen manoeuvre, generated laws (median)", 0.90),
    "laws_harmed": Target("generated laws: worse than the baseline on the unseen manoeuvre", 0.02, most=True),
    "location_iou": Target("location IoU of local effects (median)", 0.7),
    "parameter_error": Target("relative error of coefficients (median)", 0.1, most=True),
    "measured_error": Target("relative error of measurable quantities (median)", 0.1, most=True),
    "coverage": Target("95 % intervals of coefficients hold the truth", 0.93),
    "measured_coverage": Target("95 % intervals of measurable quantities hold the truth", 0.93),
    "removed": Target("removable held-out error removed (median)", 0.97),
    "dirty_silent": Target("dirty nulls left alone", 0.97), "sheets_told": Target("wrong sheets told, right entry among three", 0.95),
    "beside_named": Target("effect beside shape errors named", 0.90),
    "beside_extra": Target("false names beside shape errors", 0.05, most=True),
    "without": Target("with the entry taken away, of the error that it removes (median)", 0.90),
    "seconds": Target("seconds per diagnosis on one thread (median)", 10.0, most=True),
}  # fmt: skip


def floor(target: float) -> float:
    """How bad a perfect score's interval may look: twice the misses that the target allows, and one percent (0.98: 0.95)."""
    return target - (1.0 - target) - 0.01


def share_status(hits: int, of: int, target: float, lower: float = 0.0) -> Status:
    """Met and not met both need so many cases that a perfect score's interval begins above ``floor``.

    Fewer cases say "not met" only where the whole interval lies below the target.
    """
    low, high = interval(hits, of)
    enough = interval(of, of)[0] >= floor(target)
    if hits / of >= target:
        return "met" if enough and low >= lower else "too few cases"
    return "not met" if enough or high < target else "too few cases"


def status(target: Target, score: Score) -> Status | None:
    """Of a share or a median; None where nothing was measured."""
    if isinstance(score, Share):
        hits = score.of - score.hits if target.most else score.hits
        return share_status(hits, score.of, 1.0 - target.value if target.most else target.value, target.lower) if score.of else None
    if score.median is None:
        return None
    if score.of < FEWEST_FOR_A_MEDIAN:
        return "too few cases"
    return "met" if (score.median <= target.value if target.most else score.median >= target.value) else "not met"


def scores_of(part: OfSimulator) -> dict[str, Score]:
    """The score behind each target."""
    weakest = next(power for power in part.power if power.ratio == RATIOS[0])
    return {
        "nulls_silent": part.nulls.silent, "named_from_0.3": part.naming.from_0_3, "named_at_0.1": weakest.right,
        "extra_names": part.naming.extra_names, "both_of_two": part.pairs.all, "all_of_three": part.triples.all,
        **{kind: part.disguises[kind] for kind in ("late", "one-bag", "barely")},
        "unlisted": part.unlisted.called_unlisted, "laws": part.laws.called_unlisted,
        "laws_foretold": part.laws.foretold, "laws_harmed": part.laws.harmed, "location_iou": part.location.listed,
        "parameter_error": part.parameters.all, "measured_error": part.measurable.all,
        "coverage": part.parameters.interval_covers, "measured_coverage": part.measurable.interval_covers,
        "removed": part.removed.from_0_3, "dirty_silent": part.dirty.silent, "sheets_told": part.sheets.told,
        "beside_named": part.beside.named, "beside_extra": part.beside.extra_names,
        "without": part.without.removed, "seconds": part.seconds_per_case,
    }  # fmt: skip


def judged(part: OfSimulator) -> tuple[TargetReached, ...]:
    """Every target of one simulator that has cases, with its score and whether it is met."""
    return tuple(
        TargetReached(name, TARGETS[name].what, TARGETS[name].value, TARGETS[name].most, score, status(TARGETS[name], score))
        for name, score in scores_of(part).items() if score.of
    )  # fmt: skip
