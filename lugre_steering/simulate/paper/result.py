# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What published experiments came to, with the names of their JSON files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, Literal

from lugre_steering.provenance import Provenance
from lugre_steering.result import Result
from lugre_steering.serialise import ADDED
from lugre_steering.simulate.paper.outcome import Cell, Check, Outcome

SCHEMA: Final = "lugre_steering/experiment/1"


@dataclass(frozen=True)
class PublishedExperiment(Result):
    """One published experiment by ours: its name, whether all its statements pass, every parameter that was fitted, the table by column,
    where ours and the published text disagree, and the text below the figure."""

    schema: Literal["lugre_steering/experiment/1"]
    experiment: str
    title: str
    synthetic: bool
    passed: bool
    calibrated: Mapping[str, float]
    checks: tuple[Check, ...]
    table: tuple[Mapping[str, Cell | None], ...]
    notes: tuple[str, ...]
    caption: str
    provenance: Provenance | None = field(default=None, metadata=ADDED)

    @classmethod
    def of(cls, outcome: Outcome, made: Provenance | None) -> PublishedExperiment:
        """An outcome without its curves; ``made``: how it came about."""
        return cls(
            schema=SCHEMA,
            experiment=outcome.name,
            title=outcome.title,
            synthetic=True,
            passed=outcome.passed,
            calibrated=dict(outcome.calibrated),
            checks=outcome.checks,
            table=tuple(dict(zip(outcome.columns, row, strict=True)) for row in outcome.rows),
            notes=outcome.notes,
            caption=outcome.caption,
            provenance=made,
        )


@dataclass(frozen=True)
class PublishedExperiments(Result):
    """One or several of them as ``simulate --json`` tells them, and as the file of all together does; ``picture_note``: why there are no
    figures. Its ``schema`` is that of each."""

    schema: Literal["lugre_steering/experiment/1"]
    passed: bool
    picture_note: str | None
    experiments: tuple[PublishedExperiment, ...]
    provenance: Provenance | None = field(default=None, metadata=ADDED)

    @classmethod
    def of(cls, outcomes: Sequence[Outcome], made: Provenance | None, picture_note: str | None) -> PublishedExperiments:
        """All outcomes of a run."""
        each = tuple(PublishedExperiment.of(outcome, made) for outcome in outcomes)
        return cls(SCHEMA, all(one.passed for one in each), picture_note, each, made)
