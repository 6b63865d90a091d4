# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""How effects are shown in the pictures and the page of a diagnosis."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from lugre_steering.diagnosis.conclude.headline import bound_to_time
from lugre_steering.diagnosis.result import BagTrace

EFFECT_COLOURS = ("#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a5195", "#8c6d31")
"""One per named effect in pictures, in the order of the page's series; apart from the black, blue and red of the torques."""
MEASURED, BASELINE, AUGMENTED, QUIET = "#111111", "#1f4fb4", "#d62728", "#8a8f98"


def effect_colours(ids: Sequence[str]) -> dict[str, str]:
    """Colour of each finding in pictures."""
    return {name: EFFECT_COLOURS[i % len(EFFECT_COLOURS)] for i, name in enumerate(ids)}

WIDESPREAD = 0.6
"""Share of a bag's duration above which shading would cover nearly everything."""


def law_coordinate(effect: Mapping[str, Any], told_by: str, coordinates: Collection[str]) -> str:
    """Name of the recorded coordinate an effect is drawn along: the catalogue's, else the one it was located by.

    A law of the direction is drawn along the angle, where it opens into a loop; one between two instants over time.
    """
    if bound_to_time(effect["id"], effect["parameters"]):
        return "time"
    found = [entry.get("coordinate") for entry in effect["where"]]
    name = next((name for name in (told_by, *found) if name in coordinates), "time")
    return "steering angle" if name == "direction" else name


def is_local(trace: BagTrace, effect_id: str) -> bool:
    """Whether an effect acts for so little of a bag that shading it tells something."""
    acts = sum(end - start for start, end in trace.intervals.get(effect_id, ()))
    return 0.0 < acts < WIDESPREAD * float(trace.time[-1] - trace.time[0])
