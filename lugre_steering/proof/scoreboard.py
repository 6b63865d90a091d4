# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Scoring diagnoses against what was hidden: pure functions of finished cases (``blind.Row``)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from scipy.stats import binomtest

from lugre_steering.proof.campaign import RATIOS

Row = dict[str, Any]
Span = Sequence[float]
Outcome = Literal["right name", "right tie", "extra name", "wrong name", "silent", "unlisted", "insufficient data", "failed"]

OUTCOMES: tuple[Outcome, ...] = (
    "right name", "right tie", "extra name", "wrong name", "silent", "unlisted", "insufficient data", "failed",
)  # fmt: skip
RIGHT = ("right name", "right tie")
DETECTED = ("right name", "right tie", "extra name", "wrong name", "unlisted")
SCHEMA = "lugre_steering/scoreboard/1"
CLEAR_RATIO = 0.3 / np.sqrt(3.0)
"""Effects from here on belong to the ratio 0.3 or a higher one (nearest in the logarithm)."""
LOCAL_SHARE = 0.6
"""An effect that acts for a smaller share of the time has a place that can be scored."""


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


TARGETS: dict[str, float] = {
    "nulls_silent": 0.95, "named_from_0.3": 0.9, "named_at_0.1": 0.5, "location_iou": 0.7, "parameter_error": 0.1,
    "removed": 0.9, "both_of_two": 0.8, "unlisted": 0.9,
}  # fmt: skip


def interval(successes: int, trials: int, level: float = 0.95) -> tuple[float, float]:
    """Wilson (1927) score interval of a proportion; (0, 1) without trials."""
    if trials == 0:
        return 0.0, 1.0
    found = binomtest(successes, trials).proportion_ci(level, method="wilson")
    return float(found.low), float(found.high)


def proportion(flags: Iterable[bool]) -> Row:
    """Share of true flags with its count and 95 % Wilson interval; the share is None without any."""
    values = list(flags)
    hits = sum(values)
    return {"share": hits / len(values) if values else None, "hits": hits, "of": len(values), "ci95": list(interval(hits, len(values)))}


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


def both(row: Row) -> int:
    """How many of the hidden effects are answered for, each by a reported effect of its own."""
    if row["diagnosis"] is None:
        return 0
    hidden = [effect["id"] for effect in row["truth"]["effects"]]
    options = [[i for i, effect in enumerate(row["diagnosis"]["effects"]) if name in answers(effect)] for name in hidden]
    if len(hidden) == 2 and options[0] and options[1]:
        return 2 if len({*options[0], *options[1]}) > 1 else 1
    return sum(bool(option) for option in options)


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
            key = true["line"] if meaning.reported == "line" else meaning.reported
            in_time = bool(true.get("in_time", 0.0))
            other_window = (key.startswith("angle_") and in_time) or (key.startswith("time_") and not in_time)
            if key not in values or (name == "surface_patch" and other_window):
                continue
            expected = meaning.factor * true[meaning.true]
            low, high = reported[name][key]["ci95"] if key in reported[name] else (np.nan, np.nan)
            covers = None if np.isnan(low) else bool(low <= expected <= high)
            found[f"{name}.{meaning.reported}"] = (abs(values[key] / expected - 1.0), covers)
    return found


def heldout(row: Row) -> tuple[float, float, float] | None:
    """Held-out mean squares [N2 m2]: after recalibration, with the named physics, and of the noise."""
    diagnosis = row["diagnosis"]
    if diagnosis is None or diagnosis["baseline"]["heldout_rmse_Nm"] is None:
        return None
    bags = row["truth"]["bags"].values()
    noise = np.average([bag["seen_noise_variance"] for bag in bags], weights=[bag["duration_s"] for bag in bags])
    return diagnosis["baseline"]["heldout_rmse_Nm"] ** 2, diagnosis["augmented"]["heldout_rmse_Nm"] ** 2, float(noise)


def removed(row: Row) -> float | None:
    """Share of the removable held-out error that the named physics removed; None where recalibration left none to remove."""
    squares = heldout(row)
    if squares is None:
        return None
    before, after, noise = squares
    return (before - after) / (before - noise) if before > 1.1 * noise else None


def ratio_of(row: Row) -> float | None:
    """The wanted ratio that the achieved one is nearest to (logarithm), None when it is more than a factor of 3.2 off all."""
    if row["ratio"] <= 0.0:
        return None
    off = np.abs(np.log10(row["ratio"] / np.array(RATIOS)))
    return RATIOS[int(np.argmin(off))] if off.min() < 0.5 else None


def summary(values: Iterable[float | None]) -> Row:
    """Median and quartiles of what is there."""
    present = np.array([value for value in values if value is not None])
    if present.size == 0:
        return {"median": None, "quartiles": [None, None], "of": 0}
    low, median, high = np.percentile(present, [25, 50, 75])
    return {"median": float(median), "quartiles": [float(low), float(high)], "of": int(present.size)}


def board(rows: Sequence[Row], made: Mapping[str, Any]) -> Row:
    """The scoreboard: every score with its count and interval, and ``made``: command, versions, seed, date."""
    nulls, pairs, unlisted = (_of(rows, kind) for kind in ("null", "pair", "unlisted"))
    singles = _of(rows, "single")
    clear = [row for row in singles if row["ratio"] >= CLEAR_RATIO]
    unlisted_clear = [row for row in unlisted if row["ratio"] >= CLEAR_RATIO]
    places = {row["name"]: location(row) for row in rows if row["kind"] != "pair"}
    errors = [(key, *value) for row in clear for key, value in parameter_errors(row).items()]
    result: Row = {
        "schema": SCHEMA, "made": dict(made), "cases": dict(Counter(row["kind"] for row in rows)),
        "failed": [{"name": row["name"], "seed": row["seed"], "error": row["error"]} for row in rows if row["error"]],
        "nulls": {
            "silent": proportion(outcome(row) == "silent" for row in nulls),
            "by_noise": _grouped(nulls, lambda row: str(row["noise"]), lambda group: proportion(outcome(r) == "silent" for r in group)),
            "heldout_over_noise": summary(s[0] / s[2] for row in nulls if (s := heldout(row)) is not None),
            "named": dict(Counter(e["id"] for row in nulls if row["diagnosis"] for e in row["diagnosis"]["effects"])),
        },
        "naming": {
            "from_0.3": proportion(outcome(row) in RIGHT for row in clear),
            "outcomes_from_0.3": dict(Counter(outcome(row) for row in clear)),
            "tie_size": summary(
                float(len(row["diagnosis"]["effects"][0]["indistinguishable_from"])) for row in clear if outcome(row) in RIGHT
            ),
            "confusion": _confusion(clear + unlisted_clear),
        },
        "power": [_power(ratio, [row for row in singles if ratio_of(row) == ratio]) for ratio in RATIOS],
        "disguises": {
            kind: proportion(outcome(row) in RIGHT for row in _of(rows, kind) if row["ratio"] >= CLEAR_RATIO)
            for kind in ("one-bag", "late", "barely")
        },
        "masked": [
            {"masked": f"{low:g} to {high:g}", **proportion(outcome(row) in RIGHT for row in clear if low <= row["masked"] < high)}
            for low, high in ((0.0, 0.5), (0.5, 0.9), (0.9, 1.01))
        ],
        "effects": {
            effect: _effect(effect, [row for row in rows if row["truth"]["effects"] and row["truth"]["effects"][0]["id"] == effect])
            for effect in sorted({row["truth"]["effects"][0]["id"] for row in singles + unlisted})
        },
        "location": {
            "listed": summary(places[row["name"]] for row in rows if row["name"] in places and row["kind"] != "unlisted"),
            "unlisted": summary(places[row["name"]] for row in unlisted),
            "above_0.7": proportion(p > TARGETS["location_iou"] for p in places.values() if p is not None),
            "values": [round(p, 3) for p in places.values() if p is not None],
        },
        "parameters": {
            "all": summary(error for _, error, _ in errors),
            "within_10_percent": proportion(error <= TARGETS["parameter_error"] for _, error, _ in errors),
            "interval_covers": proportion(covered for _, _, covered in errors if covered is not None),
            "error": {key: summary(e for k, e, _ in errors if k == key) for key in sorted({key for key, _, _ in errors})},
        },
        "removed": {
            "from_0.3": summary(removed(row) for row in clear),
            "by_ratio": {f"{ratio:g}": summary(removed(row) for row in singles if ratio_of(row) == ratio) for ratio in RATIOS},
        },
        "pairs": {
            "both": proportion(both(row) == 2 for row in pairs), "one_or_more": proportion(both(row) > 0 for row in pairs),
            "both_from_0.3": proportion(both(row) == 2 for row in pairs if min(row["ratio_beside"].values()) >= CLEAR_RATIO),
        },
        "unlisted": {
            "called_unlisted": proportion(outcome(row) == "unlisted" for row in unlisted_clear),
            "by_ratio": [
                {"ratio": ratio, **proportion(outcome(row) == "unlisted" for row in unlisted if ratio_of(row) == ratio)} for ratio in RATIOS
            ],
        },
        "seconds_per_case": summary(row["seconds"]["diagnosis"] for row in rows),
        "peers": _peers(rows),
    }  # fmt: skip
    return {**result, "targets": _targets(result)}


def _of(rows: Sequence[Row], kind: str) -> list[Row]:
    return [row for row in rows if row["kind"] == kind]


def _grouped(rows: Sequence[Row], key: Callable[[Row], str], score: Callable[[list[Row]], Row]) -> dict[str, Row]:
    return {name: score([row for row in rows if key(row) == name]) for name in sorted({key(row) for row in rows})}


def _power(ratio: float, rows: Sequence[Row]) -> Row:
    outcomes = [outcome(row) for row in rows]
    return {"ratio": ratio, "detected": proportion(o in DETECTED for o in outcomes), "right": proportion(o in RIGHT for o in outcomes)}


def _effect(effect: str, rows: Sequence[Row]) -> Row:
    """One row of the table of effects: outcomes by ratio and by disguise, and what it was taken for where it was clear enough."""
    right = ("unlisted",) if any(row["kind"] == "unlisted" for row in rows) else RIGHT
    plain = [row for row in rows if row["kind"] in ("single", "unlisted")]
    missed = [row for row in rows if row["kind"] != "pair" and row["ratio"] >= CLEAR_RATIO and outcome(row) not in right]
    taken: Counter[str] = Counter()
    for row in missed:
        names = {e["id"] for e in row["diagnosis"]["effects"]} - {effect} if row["diagnosis"] else set()
        taken.update(names or {outcome(row)})
    cells = {f"{ratio:g}": [row for row in plain if ratio_of(row) == ratio] for ratio in RATIOS}
    cells |= {kind: _of(rows, kind) for kind in ("one-bag", "late", "barely")}
    return {
        "right": {name: [sum(outcome(row) in right for row in cell), len(cell)] for name, cell in cells.items()},
        "outcomes": dict(Counter(outcome(row) for row in plain)),
        "taken_for": dict(taken),
        "masked": summary(row["masked"] for row in plain),
    }


def _confusion(rows: Sequence[Row]) -> dict[str, dict[str, int]]:
    """True effect -> answer -> count. An answer is the name with the largest share, a tie that holds the truth, or a verdict."""
    table: dict[str, Counter[str]] = {}
    for row in rows:
        result = outcome(row)
        if result in ("right name", "extra name", "wrong name"):
            result_name = max(row["diagnosis"]["effects"], key=lambda effect: effect["energy_share"])["id"]
        else:
            result_name = result
        table.setdefault(row["truth"]["effects"][0]["id"], Counter())[result_name] += 1
    return {true: dict(answers) for true, answers in sorted(table.items())}


def _peers(rows: Sequence[Row]) -> dict[str, Row]:
    """Each peer on the same recordings; our own engine beside them under the same rules."""
    compared = [row for row in rows if row.get("peers")]
    clear = [row for row in compared if row["kind"] == "single" and row["ratio"] >= CLEAR_RATIO]
    found: dict[str, Row] = {}
    for name in sorted({name for row in compared for name in row["peers"]}):
        have = [row for row in clear if name in row["peers"]]
        named = [row for row in have if row["peers"][name]["names"] is not None]
        found[name] = {
            "removed": summary(_removed_by(row, name) for row in have),
            "false_alarms": proportion(row["peers"][name]["alarm"] for row in _of(compared, "null") if name in row["peers"]),
            "named": proportion(row["truth"]["effects"][0]["id"] in row["peers"][name]["names"] for row in named),
            "seconds": summary(row["peers"][name]["seconds"] for row in have),
        }
    if found:
        found["lugre_steering"] = {
            "removed": summary(removed(row) for row in clear),
            "false_alarms": proportion(outcome(row) != "silent" for row in _of(compared, "null")),
            "named": proportion(outcome(row) in RIGHT for row in clear),
            "seconds": summary(row["seconds"]["diagnosis"] for row in clear),
        }
    return found


def _removed_by(row: Row, peer: str) -> float | None:
    """``removed`` of a peer."""
    squares, entry = heldout(row), row["peers"][peer]
    if squares is None or entry["before"] <= 1.1 * squares[2]:
        return None
    return float((entry["before"] - entry["after"]) / (entry["before"] - squares[2]))


def _targets(result: Row) -> list[Row]:
    """Every target with what was reached; ``met`` is None where nothing was measured."""
    weakest = next(power for power in result["power"] if power["ratio"] == RATIOS[0])
    reached: dict[str, tuple[str, float | None]] = {
        "nulls_silent": ("nulls left alone", result["nulls"]["silent"]["share"]),
        "named_from_0.3": ("right name or tie, effect-to-noise 0.3 and above", result["naming"]["from_0.3"]["share"]),
        "named_at_0.1": ("right name or tie, effect-to-noise 0.1", weakest["right"]["share"]),
        "location_iou": ("location IoU of local effects (median)", result["location"]["listed"]["median"]),
        "parameter_error": ("relative error of parameters (median)", result["parameters"]["all"]["median"]),
        "removed": ("removable held-out error removed (median)", result["removed"]["from_0.3"]["median"]),
        "both_of_two": ("both of two effects", result["pairs"]["both"]["share"]),
        "unlisted": ("unlisted effects called unlisted, 0.3 and above", result["unlisted"]["called_unlisted"]["share"]),
    }

    def met(key: str, value: float) -> bool:
        return value <= TARGETS[key] if key == "parameter_error" else value >= TARGETS[key]

    return [
        {"id": key, "what": what, "reached": value, "target": TARGETS[key], "met": None if value is None else met(key, value)}
        for key, (what, value) in reached.items()
    ]
