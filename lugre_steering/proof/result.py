# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a campaign came to, with the names of ``scoreboard.json``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Literal

from lugre_steering.provenance import Provenance, Source
from lugre_steering.result import Result
from lugre_steering.serialise import ADDED, in_order, key

SCHEMA: Final = "lugre_steering/scoreboard/2"
Status = Literal["met", "not met", "too few cases"]
Counts = Mapping[str, int]


@dataclass(frozen=True)
class Share:
    """``hits`` of so many cases, and the 95 % Wilson interval of the share; the share is None without any case."""

    share: float | None
    hits: int
    of: int
    ci95: tuple[float, float]


@dataclass(frozen=True)
class Median:
    """Median and quartiles of so many values; None without any."""

    median: float | None
    quartiles: tuple[float | None, float | None]
    of: int


Score = Share | Median


@dataclass(frozen=True)
class AtRatio(Share):
    """The share at one wanted ratio of effect to noise."""

    ratio: float


@dataclass(frozen=True)
class AtMasked(Share):
    """The share where recalibration hides this much of the effect: '0.5 to 0.9'."""

    masked: str


@dataclass(frozen=True)
class HowMade:
    """How the cases came about. ``source``: hash of the code, ``versions`` of what it ran with."""

    synthetic: bool
    command: str
    seed: int
    date: str
    planned_cases: int
    source: str
    versions: Mapping[str, str]
    vehicle: Source | None = field(default=None, metadata=ADDED)


@dataclass(frozen=True)
class Failure:
    """A case that ended in an error."""

    name: str
    seed: int
    error: str


@dataclass(frozen=True)
class Nulls:
    """Cases in which nothing is hidden; ``named``: what was named all the same."""

    silent: Share
    by_noise: Mapping[str, Share]
    heldout_over_noise: Median
    named: Counts


@dataclass(frozen=True)
class Naming:
    """Single effects of ratio 0.3 and above; ``confusion``: true effect, answer, count."""

    from_0_3: Share = field(metadata=key("from_0.3"))
    extra_names: Share
    outcomes_from_0_3: Counts = field(metadata=key("outcomes_from_0.3"))
    tie_size: Median
    confusion: Mapping[str, Counts]


@dataclass(frozen=True)
class Power:
    """Single effects of one wanted ratio of effect to noise."""

    ratio: float
    detected: Share
    right: Share


@dataclass(frozen=True)
class OfEffect:
    """One effect: right answers and cases by ratio and disguise, outcomes of its single cases, what it was taken for where it was clear."""

    right: Mapping[str, tuple[int, int]]
    outcomes: Counts
    taken_for: Counts
    masked: Median


@dataclass(frozen=True)
class Location:
    """Intersection over union of true and reported time, of effects that act for a part of it."""

    listed: Median
    unlisted: Median
    above_0_7: Share = field(metadata=key("above_0.7"))
    values: tuple[float, ...]


@dataclass(frozen=True)
class Parameters:
    """Relative errors of coefficients that mean the same in the hidden and in the reported law, and how often intervals hold the truth."""

    all: Median
    within_10_percent: Share
    interval_covers: Share
    error: Mapping[str, Median]


@dataclass(frozen=True)
class Measurable:
    """The same of what an engineer would measure; half width of the intervals relative to the truth."""

    all: Median
    within_10_percent: Share
    interval_covers: Share
    half_width: Median
    error: Mapping[str, Median]
    covers: Mapping[str, Share]


@dataclass(frozen=True)
class Removed:
    """Share of the removable held-out error that the named physics removed."""

    from_0_3: Median = field(metadata=key("from_0.3"))
    by_ratio: Mapping[str, Median]


@dataclass(frozen=True)
class SeveralEffects:
    """Several effects at once."""

    all: Share
    one_or_more: Share
    all_from_0_3: Share = field(metadata=key("all_from_0.3"))
    extra_names: Share


@dataclass(frozen=True)
class Unlisted:
    """The fixed kinds of unlisted physics."""

    called_unlisted: Share
    by_ratio: tuple[AtRatio, ...] = field(metadata=in_order("ratio"))


@dataclass(frozen=True)
class Laws:
    """Unlisted laws from the generator; ``foretold``: of the error on an unseen manoeuvre, ``harmed``: clearly worse there."""

    called_unlisted: Share
    inside_grammar: Share
    outside_grammar: Share
    with_memory: Share
    by_channel: Mapping[str, Share]
    named: Counts
    outcomes: Counts
    foretold: Median
    harmed: Share


@dataclass(frozen=True)
class Dirty:
    """Nothing is hidden, but the recording is as the field's are."""

    silent: Share
    outcomes: Counts
    named: Counts
    blamed_on_the_sheet: Share


@dataclass(frozen=True)
class Sheets:
    """Wrong sheets: told with a right entry among the first suspects and no name, told at all, and by what is wrong."""

    told: Share
    finding: Share
    by_mistake: Mapping[str, Share]
    named_nothing: Share
    named: Counts
    other_findings: Counts


@dataclass(frozen=True)
class BesideForm:
    """Effects beside a friction law of another form."""

    named: Share
    extra_names: Share
    outcomes: Counts


@dataclass(frozen=True)
class Without:
    """What stands in the place of an entry that was taken away; ``share`` by effect, of what the entry removes."""

    enough: Share
    removed: Median
    by_laws: Median
    share: Mapping[str, float]


@dataclass(frozen=True)
class Peer:
    """Another method on the same recordings, or this one under the same rules."""

    removed: Median
    false_alarms: Share
    named: Share
    seconds: Median


@dataclass(frozen=True)
class TargetReached:
    """A target that has cases: its score is to be at least ``target``, or at ``most``."""

    id: str
    what: str
    target: float
    most: bool
    score: Score
    status: Status | None


@dataclass(frozen=True)
class OfSimulator:
    """All scores of one simulator."""

    cases: Counts
    nulls: Nulls
    naming: Naming
    power: tuple[Power, ...]
    disguises: Mapping[str, Share]
    masked: tuple[AtMasked, ...] = field(metadata=in_order("masked"))
    effects: Mapping[str, OfEffect]
    location: Location
    parameters: Parameters
    measurable: Measurable
    removed: Removed
    pairs: SeveralEffects
    triples: SeveralEffects
    unlisted: Unlisted
    laws: Laws
    dirty: Dirty
    sheets: Sheets
    beside: BesideForm
    without: Without
    seconds_per_case: Median
    peers: Mapping[str, Peer]
    targets: tuple[TargetReached, ...] = ()


@dataclass(frozen=True)
class Scoreboard(Result):
    """What became of a campaign's cases, by simulator: they are never pooled."""

    schema: Literal["lugre_steering/scoreboard/2"]
    made: HowMade
    cases: Counts
    failed: tuple[Failure, ...]
    simulators: Mapping[str, OfSimulator]
    provenance: Provenance | None = field(default=None, metadata=ADDED)
    """As of all results; ``made`` says more of it."""
