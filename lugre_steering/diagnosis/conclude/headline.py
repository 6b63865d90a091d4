# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The first words of a verdict, for an engineer: what, where, how much of the torque, and what to do."""

from __future__ import annotations

import math
from collections.abc import Container, Mapping, Sequence

import numpy as np

from lugre_steering.counted import counted
from lugre_steering.data.dataset import Run
from lugre_steering.diagnosis.finished import Finished
from lugre_steering.diagnosis.result import Experiment, NamedEffect, Place, Unexplained
from lugre_steering.diagnosis.search import locate
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.recording import Mask
from lugre_steering.report import words

CHECKS = {
    "motion": "check angle sensors, joints and linkage",
    "measurement": "check the pressure sensors, lines and valves",
}
"""What to look at on the machine, by stage of the chain; elsewhere the place that is told says it."""
NEARLY_ALWAYS = 0.9
"""Share of the recorded time from which a place is no news."""
NOT_A_PLACE = frozenset({"time", "direction"})
"""Coordinates whose range says nothing that the share of the time does not say better."""
MOVING = 1e-3
"""Rate above which a machine of travel 1 moves [1/s]."""
LOCAL = 0.75
"""Share of the time spent in the range of its coordinate below which one stretch of time per recording says better where an effect acts."""
EDGE = 0.05
"""Share of a recording within which a stretch begins with it, or ends with it."""
MOST_STRETCHES = 2
"""Recordings whose stretches are told one by one."""


def missing(done: Finished, effects: Sequence[NamedEffect], law: str, advice: Experiment | None, kept: bool) -> str:
    """What the model leaves out, and what to do; ``law``: one that was found beside the effects, if any; ``kept``: augmented.yaml has
    all of it."""
    them = "it" if len(effects) == 1 and not law else "them"
    beside = [f"beside that {law}, which no entry of the catalogue is"] if law else []
    found = "; and ".join([*(_found(done, effect) for effect in effects), *beside])
    if any(effect.bends for effect in effects):
        found += f"; {'that is' if len(effects) == 1 else 'those are'} only the nearest in the catalogue, and much is left that no entry is"
    use = f"Use augmented.yaml, which has {them},"
    if any(bound_to_time(effect.id, effect.parameters) for effect in effects):
        only = f"{use} to replay these recordings, not in the live node"
        acts = [only if kept else "", "look at what changed on the machine or its ground at that time"]
    else:
        acts = [f"{use} in replay and in the live node" if kept else ""]
    acts += dict.fromkeys(CHECKS[effect.stage] for effect in effects if effect.stage in CHECKS)
    if advice is not None:
        acts.append(f"drive {advice.manoeuvre.split(':')[0]} next, which tells apart what may be confused")
    return f"Missing from the model: {found}. {sentence(', and '.join(filter(None, acts)))}"


def bound_to_time(name: str, values: Container[str]) -> bool:
    """Whether an effect with these values acts between two instants of the recordings: other recordings have others."""
    entry = CATALOGUE.get(name)
    ends = {end for pair in entry.places for end in pair} if entry is not None else set()
    return entry is not None and any(p.unit == "s" and p.name in ends and p.name in values for p in entry.parameters)


def lawful(said: str, nearest: Sequence[str]) -> str:
    """For a law that nobody had listed, as ``said``; ``nearest``: entries of the catalogue that resemble it."""
    like = f" (nearest: {' and '.join(nearest)}, which explains less)" if nearest else ""
    return f"Missing from the model: {said}; no entry of the catalogue is that{like}. Use augmented.yaml, which has it under 'laws'."


def unlisted(done: Finished, error: float, said: str) -> str:
    """For structure without a name or a law: ``error`` [N m] is left on held-out data."""
    return (
        f"The model misses {done.torque(error)} ({_share(error / done.amplitude)}), and neither an entry of the catalogue nor a law "
        f"explains it: {said}. Look there on the machine, and drive the next experiment."
    )


def consistent(done: Finished, error: float, left: Unexplained) -> str:
    """For a model that leaves no physics: ``error`` [N m] on held-out data, and what is ``left``."""
    more = f" {sentence(left.description)}" if done.needs_form or left.indistinguishable_from else ""
    return (
        f"No missing physics is seen: recalibrated, the model explains the torque to {done.torque(error)} "
        f"({_share(error / done.amplitude)}).{more} Use augmented.yaml, the recalibrated vehicle file."
    )


def sentence(text: str) -> str:
    """With a capital letter and a full stop; nothing stays nothing."""
    return f"{text[:1].upper()}{text[1:]}." if text else ""


def inside(title: str) -> str:
    """A title within a sentence; abbreviations stay."""
    return title if title[1:2].isupper() else title[:1].lower() + title[1:]


def _found(done: Finished, effect: NamedEffect) -> str:
    parts = [f"{inside(done.title(effect.id))} ({effect.id})", *_where(done, effect)]
    if effect.largest_Nm is not None and effect.largest_share is not None:
        parts.append(f"up to {done.torque(effect.largest_Nm)} ({_share(effect.largest_share)})")
    return ", ".join(parts)


def _share(share: float) -> str:
    return f"{words.percent(share)} of the torque"


def _where(done: Finished, effect: NamedEffect) -> list[str]:
    """Where it acts, over all recordings: its stretches of time or the range of its coordinate, whichever is closer, if either is less
    than nearly everything; and how much of the time."""
    if not effect.where:
        return []
    recorded = sum(float(run.time[-1] - run.time[0]) for run in done.problem.runs)
    active = sum(end - start for place in effect.where for start, end in place.intervals_s) / recorded
    often = "all the time" if active > NEARLY_ALWAYS else f"{words.percent(active)} of the time"
    among = _range(effect.where)
    acts = {place.bag: (place.intervals_s[0][0], place.intervals_s[-1][1]) for place in effect.where if place.intervals_s}
    within, held, driven = _durations(done.problem.runs, acts, among)
    if within < LOCAL * held:
        return [f"{_stretches(done.problem.runs, acts)} ({often})"]
    if among is None or held > NEARLY_ALWAYS * driven:
        return [often]
    name, low, high = among
    axis = words.coordinate_axis(done.problem.vehicle, name)
    from_, to = (words.number(axis.scale * end, 3) for end in (low, high))
    if name.startswith("|"):
        return [f"mostly beyond {from_} {axis.unit} of {axis.name.strip('|')} to either side ({often})"]
    return [f"at {words.with_article(axis.name)} of {from_} to {to} {axis.unit}".rstrip() + f" ({often})"]


def _range(places: Sequence[Place]) -> tuple[str, float, float] | None:
    """The coordinate by which all places are told, and its range over them; nothing where there is none.

    What is met to one side in one recording and to either in another is told by its size.
    """
    names = {place.coordinate for place in places}
    ends = [(low, high) for low, high in (place.range for place in places) if low is not None and high is not None]
    if len(names) > 1:
        names = {f"|{name.strip('|')}|" for name in names}
        ends = [(max(low, -high, 0.0), max(-low, high)) for low, high in ends]
    name = names.pop()
    if names or name in NOT_A_PLACE or not ends:
        return None
    low, high = min(low for low, _ in ends), max(high for _, high in ends)
    return (name, low, high) if low < high else None


def _durations(
    runs: Sequence[Run], acts: Mapping[str, tuple[float, float]], among: tuple[str, float, float] | None
) -> tuple[float, float, float]:
    """Seconds within the one stretch of each recording in which something ``acts``, within a range of a coordinate (``among``; without
    one all that was driven), and driven."""
    within = held = total = 0.0
    for run in runs:
        start, end = acts.get(run.name, (math.inf, -math.inf))
        driven, axes = _driven(run), locate.coordinates(run, run.measured)
        there = driven & (axes[among[0]] >= among[1]) & (axes[among[0]] <= among[2]) if among and among[0] in axes else driven
        step = float(run.time[1] - run.time[0])
        within += step * float(np.sum(driven & (run.time >= start) & (run.time <= end)))
        held += step * float(np.sum(there))
        total += step * float(np.sum(driven))
    return within, held, total


def _stretches(runs: Sequence[Run], acts: Mapping[str, tuple[float, float]]) -> str:
    """The stretches of the first recordings in words, and how many more there are."""
    told = [_stretch(run, *acts[run.name], named=len(runs) > 1) for run in runs if run.name in acts]
    more = len(told) - MOST_STRETCHES
    return " and ".join([*told[:MOST_STRETCHES], *([f"in stretches of {counted(more, 'other recording')}"] if more > 0 else [])])


def _stretch(run: Run, start: float, end: float, named: bool) -> str:
    """'from 10 to 30 s in NAME', 'from 10 s on in NAME', 'all through NAME'."""
    first, last = run.time[_driven(run)][[0, -1]]
    late, early = start > first + EDGE * (last - first), end < last - EDGE * (last - first)
    if not late and not early:
        return f"all through {run.name}"
    from_, to = words.number(start, 3), words.number(end, 3)
    when = f"from {from_} to {to} s" if late and early else f"from {from_} s on" if late else f"until {to} s"
    return f"{when} in {run.name}" if named else when


def _driven(run: Run) -> Mask:
    """Samples from the first to the last motion: what would act before or after cannot be known."""
    moving = np.flatnonzero(np.abs(run.omega).max(axis=0) > MOVING * run.angle_unit)
    index = np.arange(run.time.size)
    return (index >= moving[0]) & (index <= moving[-1]) if moving.size else np.ones(run.time.size, dtype=bool)
