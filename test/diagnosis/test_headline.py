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
from lugre_steering.diagnosis.result import Experiment, FittedValue, NamedEffect, Place, Unexplained
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.report import words
from lugre_steering.vehicle import load

VEHICLE = load(Path(__file__).resolve().parents[2] / "config" / "test_vehicle.yaml")


def recording(name: str) -> Any:
    time = np.linspace(0.0, 100.0, 1001)
    theta, omega = (np.tile(motion, (2, 1)) for motion in (0.6 * np.sin(0.04 * np.pi * time), 0.024 * np.pi * np.cos(0.04 * np.pi * time)))
    still = np.zeros((2, time.size))
    return SimpleNamespace(
        name=name, time=time, theta=theta, omega=omega, alpha=still, pressure=still, measured=still[0], angle_unit=1.0
    )  # fmt: skip


def finished(**more: Any) -> Any:
    """As much of a finished search of two recordings of 100 s as the sentence needs; a torque amplitude of 50 kN m, four sweeps between
    -0.6 and 0.6 rad without a pause."""
    runs = [recording(name) for name in ("a", "b")]
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


@pytest.mark.parametrize(("count", "told"), [(1, "that is only the nearest"), (2, "those are only the nearest")])
def test_names_that_leave_much_are_told_as_the_nearest_of_the_catalogue(count: int, told: str) -> None:
    said = headline.missing(finished(), [stop(bends=True)] * count, "", None, kept=True)
    assert f"(25 % of the torque); {told} in the catalogue, and much is left that no entry is. Use" in said


def test_sensors_are_to_be_checked_and_ties_to_be_told_apart_by_a_drive() -> None:
    drift = stop(id="pressure_offset", stage="measurement", where=(Place("a", ((0.0, 100.0),), "time", (0.0, 100.0), "s"),))
    advice = Experiment("slow-sweeps: half sweeps at 0.5, 1, 4 and 2 deg/s", ("a", "b"), "")
    said = headline.missing(finished(), [stop(), drift], "", advice, kept=True)
    assert "(end_stop), mostly beyond" in said
    assert "; and a pressure sensor reads a constant too much (pressure_offset), all through a (50 % of the time), up to" in said
    assert said.endswith(
        "Use augmented.yaml, which has them, in replay and in the live node, and check the pressure sensors, lines and valves, "
        "and drive slow-sweeps next, which tells apart what may be confused."
    )
    assert "augmented.yaml" not in headline.missing(finished(), [stop()], "", None, kept=False)


@pytest.mark.parametrize(
    ("coordinate", "ends", "place"),
    [
        ("steering rate", (0.02, 0.05), "at a steering rate of 1.15 to 2.86 deg/s (10 % of the time)"),
        ("steering rate", (-0.1, 0.2), "(end_stop), 10 % of the time, up to"),  # all rates that were driven are no place
        ("angle since reversal", (0.0, 0.05), "at an angle since reversal of 0 to 2.86 deg (10 % of the time)"),
        ("direction", (-1.0, 1.0), "(end_stop), 10 % of the time, up to"),
        ("time", (0.0, 100.0), "(end_stop), 10 % of the time, up to"),
        ("dwell", (None, None), "(end_stop), 10 % of the time, up to"),
    ],
)
def test_places_are_told_where_they_are_some(coordinate: str, ends: tuple[float, float], place: str) -> None:
    where = tuple(Place(bag, ((1.0, 6.0), (94.0, 99.0)), coordinate, ends, "rad") for bag in ("a", "b"))
    assert place in headline.missing(finished(), [stop(where=where)], "", None, kept=True)


@pytest.mark.parametrize("coordinate", ["steering angle", "direction", "time"])
@pytest.mark.parametrize(
    ("acts", "place"),
    [
        ({"b": ((40.0, 60.0), (61.0, 99.0))}, "from 40 s on in b (29 % of the time)"),
        ({"a": ((1.0, 30.0),), "b": ((40.0, 60.0),)}, "until 30 s in a and from 40 to 60 s in b (24 % of the time)"),
        ({"a": ((1.0, 99.0),)}, "all through a (49 % of the time)"),
        ({"a": ((1.0, 99.0),), "b": ((80.0, 99.0),)}, "all through a and from 80 s on in b (58 % of the time)"),
    ],
)
def test_what_is_local_in_time_is_told_by_time(acts: dict[str, Any], place: str, coordinate: str) -> None:
    where = tuple(Place(bag, spans, coordinate, (-0.6, 0.6), "rad") for bag, spans in acts.items())
    assert f"(end_stop), {place}, up to" in headline.missing(finished(), [stop(where=where)], "", None, kept=True)


def test_what_is_bound_to_the_time_of_its_recordings_is_nothing_for_the_live_node() -> None:
    window = {"change": FittedValue(0.2, (0.1, 0.3), "1"), "time_start": FittedValue(55.0, (54.0, 56.0), "s")}
    said = headline.missing(finished(), [stop(id="surface_patch", stage="contact", parameters=window)], "", None, kept=True)
    assert said.endswith(
        "Use augmented.yaml, which has it, to replay these recordings, not in the live node, and look at what changed on the machine or "
        "its ground at that time."
    )
    somewhere = {"change": window["change"], "angle_low": FittedValue(0.1, (0.0, 0.2), "rad")}
    said = headline.missing(finished(), [stop(id="surface_patch", parameters=somewhere)], "", None, kept=True)
    assert said.endswith("Use augmented.yaml, which has it, in replay and in the live node.")


def test_many_stretches_are_counted_and_a_lone_recording_is_not_named() -> None:
    late = [Place(name, ((70.0, 100.0),), "steering angle", (-0.6, 0.6), "rad") for name in "abcd"]
    done = finished(problem=SimpleNamespace(runs=[recording(name) for name in "abcd"], vehicle=VEHICLE))
    said = headline.missing(done, [stop(where=tuple(late))], "", None, kept=True)
    assert "(end_stop), from 70 s on in a and from 70 s on in b and in stretches of 2 other recordings (30 % of the time)" in said
    done = finished(problem=SimpleNamespace(runs=[recording("a")], vehicle=VEHICLE))
    assert "(end_stop), from 70 s on (30 % of the time)" in headline.missing(done, [stop(where=(late[0],))], "", None, kept=True)


def test_a_range_that_is_closer_than_its_stretch_is_told_instead() -> None:
    """A stop that is met once only, in the one sweep that went so far."""
    once = recording("a")
    once.theta = np.where(once.time < 25.0, once.theta, 0.5 * once.theta)
    done = finished(problem=SimpleNamespace(runs=[once], vehicle=VEHICLE))
    where = (Place("a", ((9.0, 16.0),), "|steering angle|", (0.5, 0.6), "rad"),)
    assert "mostly beyond 28.6 deg of steering angle" in headline.missing(done, [stop(where=where)], "", None, kept=True)


def test_what_is_met_to_one_side_here_and_to_either_there_is_told_by_its_size() -> None:
    sides = (("a", "|steering angle|", (0.5, 0.6)), ("b", "steering angle", (-0.6, -0.52)))
    where = tuple(Place(bag, ((1.0, 99.0),), name, ends, "rad") for bag, name, ends in sides)
    said = headline.missing(finished(), [stop(where=where)], "", None, kept=True)
    assert "mostly beyond 28.6 deg of steering angle to either side" in said
    apart = (where[0], Place("b", ((1.0, 99.0),), "steering rate", (0.1, 0.2), "rad/s"))
    assert "beyond" not in headline.missing(finished(), [stop(where=apart)], "", None, kept=True)


def test_nothing_is_told_to_begin_with_the_first_motion() -> None:
    parked = recording("a")
    parked.omega = np.where(parked.time < 60.0, 0.0, parked.omega)
    done = finished(problem=SimpleNamespace(runs=[parked], vehicle=VEHICLE))
    where = (Place("a", ((61.0, 99.0),), "direction", (-1.0, 1.0), "1"),)
    assert "(end_stop), 38 % of the time, up to" in headline.missing(done, [stop(where=where)], "", None, kept=True)


def test_other_verdicts_say_the_error_and_what_to_do() -> None:
    for instead, more in (((), ""), (("backlash",), "What is left is noise. ")):
        assert headline.consistent(finished(), 100.0, Unexplained(False, "what is left is noise", indistinguishable_from=instead)) == (
            "No missing physics is seen: recalibrated, the model explains the torque to 100 N m (0.2 % of the torque). "
            f"{more}Use augmented.yaml, the recalibrated vehicle file."
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
