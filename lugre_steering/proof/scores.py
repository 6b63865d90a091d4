# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What became of one case: pure functions of a finished row (``blind.Row``), and shares and medians with their intervals."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy.stats import binomtest

from lugre_steering.proof.campaign import RATIOS
from lugre_steering.proof.result import Median, Share

Row = dict[str, Any]
Span = Sequence[float]
Outcome = Literal["right name", "right tie", "extra name", "wrong name", "silent", "unlisted", "insufficient data", "failed"]

OUTCOMES: tuple[Outcome, ...] = (
    "right name", "right tie", "extra name", "wrong name", "silent", "unlisted", "insufficient data", "failed",
)  # fmt: skip
RIGHT = ("right name", "right tie")
DETECTED = ("right name", "right tie", "extra name", "wrong name", "unlisted")
CLEAR_RATIO = 0.3 / np.sqrt(3.0)
"""Effects from here on belong to the ratio 0.3 or a higher one (nearest in the logarithm)."""
LOCAL_SHARE = 0.6
"""An effect that acts for a smaller share of the time has a place that can be scored."""
FIRST_SUSPECTS = 3
WORSE = 1.02
"""A diagnosed file does harm on an unseen manoeuvre where its error is by more than this factor above the baseline's."""


class Meaning(NamedTuple):
    """A true parameter and the catalogue parameter of the same meaning, which is ``factor`` times the true one."""

    true: str
    reported: str
    factor: float = 1.0


SAME_MEANING: dict[str, tuple[Meaning, ...]] = {
    "end_stop": (Meaning("threshold", "engage_angle"), Meaning("secant", "secant")),
    "backlash": (Meaning("width", "width"),),
    "linkage_compliance": (Meaning("compliance", "compliance"),),
    "viscous_friction": (Meaning("sigma2", "sigma_2"),),
    "static_ageing": (Meaning("rate", "rate"), Meaning("slip_scale", "slip_scale")),
    "stress_relaxation": (Meaning("share_per_decade", "per_decade"),),
    "payne_softening": (Meaning("amount", "amplitude"), Meaning("angle", "angle")),
    "surface_patch": (
        Meaning("amount", "change"), Meaning("low", "angle_low"), Meaning("high", "angle_high"),
        Meaning("low", "time_start"), Meaning("high", "time_end"),
    ),
    "direction_asymmetry": (Meaning("a", "asymmetry"),),
    "distributed_contact": (Meaning("spread", "spread"),),
    "carcass_heat_sink": (Meaning("conductance", "conductance"), Meaning("capacity", "capacity")),
    "heat_partition": (Meaning("lost_share", "ground_share"),),
    "angle_offset": (Meaning("offset", "offset"),),
    "angle_scale": (Meaning("scale", "scale"),),
    "yaw_inertia": (Meaning("inertia", "inertia"),),
    "kingpin_jacking": (Meaning("slope", "slope"),),
    "slope_bias": (Meaning("torque", "torque"),),
    "cylinder_friction": (Meaning("coulomb", "coulomb"), Meaning("load_share", "load_share")),
    # Hidden losses follow the mean rate of both tracks, the catalogue's are of one track: half of the hidden one.
    "line_loss_linear": (Meaning("b", "b", 0.5),),
    "line_loss_quadratic": (Meaning("c", "c", 0.5),),
    "trapped_pressure": (Meaning("share", "share"), Meaning("time", "time_constant")),
    "time_delay": (Meaning("delay", "delay"),),
    "pressure_lag": (Meaning("tau", "tau"),),
    "pressure_offset": (Meaning("offset", "line"),),  # reported under the line's own name
    "pressure_drift": (Meaning("drift", "line", 0.83),),  # the mean rate of a drift that levels off, over some 110 s
    "moment_arm_error": (Meaning("a", "linear"), Meaning("b", "quadratic")),
}  # fmt: skip
"""Left out: parameters whose law differs so much that equal numbers would not mean equal physics."""

STOP_DEPTH_RAD = 0.05


def derived(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters, true or reported, with what their trade-offs leave alone, where the parameters for it are there.

    ``secant``: stiffness k1 + k3 x^2 of an end stop at x = STOP_DEPTH_RAD. ``slope``: of a jacking torque about the middle [N m/rad].
    """
    out, get = dict(parameters), parameters.get
    for linear, cubic in (("k1", "k3"), ("stiffness", "cubic_stiffness")):
        if linear in parameters:
            out["secant"] = parameters[linear] + get(cubic, 0.0) * STOP_DEPTH_RAD**2
    if "amplitude" in parameters:
        out["slope"] = parameters["amplitude"] + 2.0 * get("second_harmonic", 0.0)
    return out


def interval(successes: int, trials: int, level: float = 0.95) -> tuple[float, float]:
    """Wilson (1927) score interval of a proportion; (0, 1) without trials."""
    if trials == 0:
        return 0.0, 1.0
    found = binomtest(successes, trials).proportion_ci(level, method="wilson")
    return float(found.low), float(found.high)


def proportion(flags: Iterable[bool]) -> Share:
    """Share of true flags with its count and 95 % Wilson interval; the share is None without any."""
    values = list(flags)
    hits = sum(values)
    return Share(hits / len(values) if values else None, hits, len(values), interval(hits, len(values)))


def answers(effect: Mapping[str, Any]) -> set[str]:
    """The names that a reported effect stands for: its own and those it says it cannot be told from."""
    return {effect["id"], *effect["indistinguishable_from"]}


def outcome(row: Row) -> Outcome:
    """What became of a case with at most one hidden effect. A name beside the right one spoils it ('extra name')."""
    diagnosis = row["diagnosis"]
    if diagnosis is None:
        return "failed"
    verdicts: dict[str, Outcome] = {"consistent": "silent", "unlisted_physics": "unlisted", "insufficient_data": "insufficient data"}
    if diagnosis["verdict"] in verdicts:
        return verdicts[diagnosis["verdict"]]
    hidden = {effect["id"] for effect in row["truth"]["effects"]}
    reported = diagnosis["effects"]
    if not any(hidden & answers(effect) for effect in reported):
        return "wrong name"
    if len(reported) > 1:
        return "extra name"
    return "right name" if reported[0]["id"] in hidden else "right tie"


def answered(row: Row) -> int:
    """How many of the hidden effects are answered for, each by a reported effect of its own (the largest matching)."""
    if row["diagnosis"] is None:
        return 0
    hidden = [effect["id"] for effect in row["truth"]["effects"]]
    options = [[i for i, effect in enumerate(row["diagnosis"]["effects"]) if name in answers(effect)] for name in hidden]

    def most(left: list[list[int]], used: frozenset[int]) -> int:
        if not left:
            return 0
        free = [1 + most(left[1:], used | {i}) for i in left[0] if i not in used]
        return max([most(left[1:], used), *free])

    return most(options, frozenset())


def all_answered(row: Row) -> bool:
    return answered(row) == len(row["truth"]["effects"])


def names_named(row: Row) -> int:
    return len(row["diagnosis"]["effects"]) if row["diagnosis"] is not None else 0


def has_wrong_extra(row: Row) -> bool:
    """A reported effect stands beside the right ones that answers for none of what is hidden."""
    hidden = {effect["id"] for effect in row["truth"]["effects"]}
    reported = row["diagnosis"]["effects"] if row["diagnosis"] is not None else []
    return any(not hidden & answers(effect) for effect in reported)


def called_unlisted(row: Row) -> bool:
    """Unlisted physics is called so: by the verdict, by a law of its own, or as the nearest entry that is said to bend."""
    diagnosis = row["diagnosis"]
    if diagnosis is None:
        return False
    return bool(outcome(row) == "unlisted" or diagnosis.get("laws") or any(effect.get("bends") for effect in diagnosis["effects"]))


def wrong_sheet(row: Row) -> Row | None:
    """The finding that the sheet is wrong, if there is one."""
    findings: list[Row] = row["diagnosis"].get("findings", []) if row["diagnosis"] is not None else []
    return next((finding for finding in findings if finding["finding"] == "wrong_sheet"), None)


def sheet_told(row: Row) -> bool:
    """A wrong sheet is told as such, nothing is named, and a right entry is among the first suspects."""
    finding = wrong_sheet(row)
    if finding is None or names_named(row):
        return False
    suspects = [str(suspect["key"] if isinstance(suspect, Mapping) else suspect) for suspect in (finding.get("suspects") or [])]
    suspects = suspects[:FIRST_SUSPECTS]
    return any(re.search(pattern, suspect) for pattern in row["mistake"]["suspects"] for suspect in suspects)


def overlap(one: Sequence[Span], other: Sequence[Span]) -> tuple[float, float]:
    """Lengths of the intersection and of the union of two sets of intervals; intervals within a set may overlap."""
    cuts = np.unique([edge for span in (*one, *other) for edge in span])
    middles, lengths = 0.5 * (cuts[1:] + cuts[:-1]), np.diff(cuts)
    inside = [np.any([(a < middles) & (middles < b) for a, b in spans] or [np.zeros(middles.size, bool)], axis=0) for spans in (one, other)]
    return float(lengths[inside[0] & inside[1]].sum()), float(lengths[inside[0] | inside[1]].sum())


def location(row: Row) -> float | None:
    """Intersection over union of the time in which the hidden effect acts and the reported one does, all bags together.

    None where there is no place to score: an effect that acts nearly always, several effects, or nothing found.
    """
    bags = row["truth"]["bags"]
    if len(row["truth"]["effects"]) != 1 or row["diagnosis"] is None:
        return None
    hidden = row["truth"]["effects"][0]["id"]
    true = {name: bag["intervals_s"].get(hidden, []) for name, bag in bags.items()}
    active = sum(b - a for spans in true.values() for a, b in spans)
    if not 0.0 < active < LOCAL_SHARE * sum(bag["duration_s"] for bag in bags.values()):
        return None
    if row["kind"] == "unlisted":
        places = row["diagnosis"]["unexplained"]["where"] if outcome(row) == "unlisted" else None
    else:
        places = next((effect["where"] for effect in row["diagnosis"]["effects"] if hidden in answers(effect)), None)
    if places is None:
        return None
    reported = {name: [span for place in places if place["bag"] == name for span in place["intervals_s"]] for name in bags}
    shared, either = np.sum([overlap(true[name], reported[name]) for name in bags], axis=0)
    return float(shared / either)


def parameter_errors(row: Row) -> dict[str, tuple[float, bool | None]]:
    """Relative error of each reported parameter that means the same as a true one, and whether its interval (if any) covers it.

    Keys are 'effect.parameter'. Only effects that bear the right name count: another law's parameters mean something else.
    """
    found: dict[str, tuple[float, bool | None]] = {}
    reported = {effect["id"]: effect["parameters"] for effect in row["diagnosis"]["effects"]} if row["diagnosis"] is not None else {}
    for hidden in row["truth"]["effects"]:
        name, true = hidden["id"], derived(hidden["parameters"])
        if name not in reported:
            continue
        values = derived({key: entry["value"] for key, entry in reported[name].items()})
        for meaning in SAME_MEANING.get(name, ()):
            key = str(true["line"]) if meaning.reported == "line" else meaning.reported
            in_time = bool(true.get("in_time", 0.0))
            other_window = (key.startswith("angle_") and in_time) or (key.startswith("time_") and not in_time)
            if key not in values or meaning.true not in true or (name == "surface_patch" and other_window):
                continue
            expected = meaning.factor * true[meaning.true]
            low, high = reported[name][key]["ci95"] if key in reported[name] else (np.nan, np.nan)
            covers = None if np.isnan(low) else bool(low <= expected <= high)
            found[f"{name}.{meaning.reported}"] = (abs(values[key] / expected - 1.0), covers)
    return found


def measured_errors(row: Row) -> dict[str, tuple[float, bool]]:
    """Relative error of each measurable quantity (``probe.MEASURES``) and whether its interval covers the truth, by effect."""
    found: dict[str, tuple[float, bool]] = {}
    for name, entry in row.get("measured", {}).items():
        true, value, (low, high) = entry["true"], entry["value"], entry["ci95"]
        if true is not None and value is not None and true != 0.0:
            found[name] = (abs(value / true - 1.0), bool(low <= true <= high))
    return found


def measured_width(row: Row) -> dict[str, float]:
    """Half width of each measurable quantity's interval relative to the true value."""
    shown = {name: entry for name, entry in row.get("measured", {}).items() if entry["true"] and entry["value"] is not None}
    return {name: 0.5 * (entry["ci95"][1] - entry["ci95"][0]) / abs(entry["true"]) for name, entry in shown.items()}


def heldout(row: Row) -> tuple[float, float, float] | None:
    """Held-out mean squares [N2 m2]: after recalibration, with the named physics, and of the noise."""
    diagnosis = row["diagnosis"]
    if diagnosis is None or diagnosis["baseline"]["heldout_rmse_Nm"] is None:
        return None
    bags = row["truth"]["bags"].values()
    noise = np.average([bag["seen_noise_variance"] for bag in bags], weights=[bag["duration_s"] for bag in bags])
    return diagnosis["baseline"]["heldout_rmse_Nm"] ** 2, diagnosis["augmented"]["heldout_rmse_Nm"] ** 2, float(noise)


def removed(row: Row) -> float | None:
    """Share of the removable held-out error that the named physics removed; None where recalibration left none to remove.

    Second simulator: what is left to a perfect model is the noise. Third: the friction's own shape stays as well, so the
    removable part is what the effect adds after recalibration.
    """
    squares = heldout(row)
    if squares is None:
        return None
    before, after, noise = squares
    removable = before - noise if row.get("simulator", 2) == 2 else row["removable_variance"]
    return (before - after) / removable if removable > 0.1 * noise else None


def removed_without(row: Row) -> float | None:
    """What is removed of the held-out error with the right entry taken away from the catalogue, as a share of what is removed with it;
    None where the entry was not found, or there was next to nothing to remove."""
    with_it, instead = heldout(row), heldout({**row, "diagnosis": row["without"]})
    if with_it is None or instead is None or outcome(row) not in RIGHT:
        return None
    before, after, noise = with_it
    return (before - instead[1]) / (before - after) if before - after > 0.1 * noise else None


def foretold(row: Row) -> float | None:
    """Share of the removable error on an unseen manoeuvre that the diagnosed file removes: of what the recalibrated baseline leaves there
    beyond what it leaves where nothing is hidden; None where that is next to nothing."""
    squares = _unseen(row)
    if squares is None:
        return None
    before, after, least = squares
    return (before - after) / (before - least) if before - least > 0.1 * least else None


def harmed(row: Row) -> bool | None:
    """Whether the diagnosed file is clearly worse than the recalibrated baseline on an unseen manoeuvre."""
    squares = _unseen(row)
    return None if squares is None else squares[1] > WORSE**2 * squares[0]


def _unseen(row: Row) -> tuple[float, float, float] | None:
    """Mean squares [N2 m2] on an unseen manoeuvre: of the recalibrated baseline, the diagnosed file, and where nothing is hidden."""
    unseen = row.get("unseen") or {}
    squares = [unseen[key] ** 2 for key in ("baseline_Nm", "augmented_Nm", "floor_Nm") if unseen.get(key)]
    return (squares[0], squares[1], squares[2]) if len(squares) == 3 else None


def ratio_of(row: Row) -> float | None:
    """The wanted ratio that the achieved one is nearest to (logarithm), None when it is more than a factor of 3.2 off all."""
    if row["ratio"] <= 0.0:
        return None
    off = np.abs(np.log10(row["ratio"] / np.array(RATIOS)))
    return RATIOS[int(np.argmin(off))] if off.min() < 0.5 else None


def summary(values: Iterable[float | None]) -> Median:
    """Median and quartiles of what is there."""
    present = np.array([value for value in values if value is not None])
    if present.size == 0:
        return Median(None, (None, None), 0)
    low, median, high = np.percentile(present, [25, 50, 75])
    return Median(float(median), (float(low), float(high)), int(present.size))
