# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The first sentence of a verdict: what, where, how many N m and percent of the torque, what to do."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lugre_steering import units
from lugre_steering.diagnosis.conclude import headline
from lugre_steering.diagnosis.result import Experiment, FittedValue, NamedEffect, Place
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.report import words
from lugre_steering.vehicle import load

VEHICLE = load(Path(__file__).resolve().parents[2] / "config" / "test_vehicle.yaml")


def finished(**more: Any) -> Any:
    """As much of a finished search of two recordings of 100 s as the sentence needs; a torque amplitude of 50 kN m."""
    runs = [SimpleNamespace(name=name, time=np.linspace(0.0, 100.0, 11)) for name in ("a", "b")]
    given = {
        "problem": SimpleNamespace(runs=runs, vehicle=VEHICLE), "amplitude": 50e3, "needs_form": False,
        "torque": lambda value: words.torque(VEHICLE, value), "title": lambda name: units.title(VEHICLE, CATALOGUE[name]),
    }  # fmt: skip
    return SimpleNamespace(**(given | more))


def stop(**more: Any) -> NamedEffect:
    places = tuple(Place(bag, ((10.0, 20.0), (30.0, 40.0)), "|steering angle|", (0.5, 0.6), "rad") for bag in ("a", "b"))
    fitted = {"stiffness": FittedValue(6e4, (5e4, 7e4), "N m/rad")}
    effect = NamedEffect("end_stop", "parallel_torque", "", 1e-9, fitted, places, 0.9, 0.4, (), 12_345.0, 0.2469)
    return replace(effect, **more)


def test_what_where_how_much_and_what_to_do() -> None:
    assert headline.missing(finished(), [stop()], "", None, kept=True) == (
        "Missing from the model: elastic end stop of the steering (end_stop), mostly beyond 28.6 deg of steering angle to either side "
        "(20 % of the time), up to 12.3 kN m (25 % of the torque). Use augmented.yaml, which has it, in replay and in the live node."
    )


def test_sensors_are_to_be_checked_and_ties_to_be_told_apart_by_a_drive() -> None:
    drift = stop(id="pressure_offset", stage="measurement", where=(Place("a", ((0.0, 100.0),), "time", (0.0, 100.0), "s"),))
    advice = Experiment("slow-sweeps: half sweeps at 0.5, 1, 4 and 2 deg/s", ("a", "b"), "")
    said = headline.missing(finished(), [stop(), drift], "", advice, kept=True)
    assert "(end_stop), mostly beyond" in said
    assert "; and a pressure sensor reads a constant too much (pressure_offset), 50 % of the time, up to" in said
    assert said.endswith(
        "Use augmented.yaml, which has them, in replay and in the live node, and check the pressure sensors, lines and valves, "
        "and drive slow-sweeps next, which tells apart what may be confused."
    )
    assert "augmented.yaml" not in headline.missing(finished(), [stop()], "", None, kept=False)


@pytest.mark.parametrize(
    ("coordinate", "ends", "place"),
    [
        ("steering rate", (-0.1, 0.2), "at a steering rate of -5.73 to 11.5 deg/s (10 % of the time)"),
        ("angle since reversal", (0.0, 0.05), "at an angle since reversal of 0 to 2.86 deg (10 % of the time)"),
        ("direction", (-1.0, 1.0), "(end_stop), 10 % of the time, up to"),
        ("time", (10.0, 30.0), "(end_stop), 10 % of the time, up to"),
        ("dwell", (None, None), "(end_stop), 10 % of the time, up to"),
    ],
)
def test_places_are_told_where_they_are_some(coordinate: str, ends: tuple[float, float], place: str) -> None:
    where = (Place("a", ((10.0, 30.0),), coordinate, ends, "rad"),)
    assert place in headline.missing(finished(), [stop(where=where)], "", None, kept=True)


def test_other_verdicts_say_the_error_and_what_to_do() -> None:
    assert headline.consistent(finished(), 100.0, "what is left is noise") == (
        "No missing physics is seen: recalibrated, the model explains the torque to 100 N m (0.2 % of the torque). "
        "Use augmented.yaml, the recalibrated vehicle file."
    )
    assert "misses 500 N m (1.0 % of the torque)" in headline.unlisted(finished(), 500.0, "it follows the angle")
    assert headline.lawful("a loss (up to 5 N m)", ()).endswith("catalogue is that. Use augmented.yaml, which has it under 'laws'.")
    assert "(nearest: end_stop, which explains less)" in headline.lawful("a loss (up to 5 N m)", ["end_stop"])


@pytest.mark.parametrize(
    ("value", "text"),
    [(3317.4, "3320 N m"), (71.54, "71.5 N m"), (9994.0, "9990 N m"), (9996.0, "10 kN m"), (-38_240.0, "-38.2 kN m"), (0.0, "0 N m")],
)
def test_a_torque_has_the_same_digits_everywhere(value: float, text: str) -> None:
    assert words.torque(VEHICLE, value) == text


def test_what_is_counted_in_ones_has_no_unit() -> None:
    assert (words.quantity(2.0, "1"), words.quantity(2.0, "rad")) == ("2", "2 rad")


def test_sentences_of_a_statement() -> None:
    text = "Error 1.5 N m. friction.static stopped (see x). rubber.heat_W_m2K is so. end_stop cannot be told from y. So, e.g. 3 %."
    assert words.sentences(text) == [
        "Error 1.5 N m.", "friction.static stopped (see x).", "rubber.heat_W_m2K is so.",
        "end_stop cannot be told from y.", "So, e.g. 3 %.",
    ]  # fmt: skip
