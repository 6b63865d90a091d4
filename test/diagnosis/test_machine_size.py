# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A machine of another size has the same physics: torques and lengths in other units give the same names and the same shares."""

from __future__ import annotations

import contextlib
import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lugre_steering import vehicle as vehicle_file
from lugre_steering.diagnosis.engine import diagnose_recordings
from lugre_steering.effects.registry import CATALOGUE
from lugre_steering.errors import VehicleFileError
from lugre_steering.fitting.problem import resized, size_of
from lugre_steering.recording import Recording, Signal
from lugre_steering.simulate.manoeuvres import Hold, Manoeuvre, Sweep, motion_of
from lugre_steering.simulate.run import sensing_of, simulate
from lugre_steering.vehicle import EffectEntry, Vehicle
from lugre_steering.vehicle.size import Size

AXIS = vehicle_file.load(Path(__file__).parents[2] / "config" / "linear_axis_example.yaml")
POWERS = {"N m": (1, 0), "N m s/rad": (1, -1), "kg m2": (1, -1), "rad": (0, 1)}
"""Powers of torque and length in the units of what is hidden."""


def axis(torque: float, length: float) -> Vehicle:
    """The example with every torque and every length multiplied."""
    contact, sensor = AXIS.contact, AXIS.torque_sensor
    assert contact is not None
    assert sensor is not None
    return AXIS.replace(
        contact=dataclasses.replace(
            contact,
            static_torque_Nm=contact.static_torque_Nm * torque,
            coulomb_torque_Nm=contact.coulomb_torque_Nm * torque,
            stiffness_Nm_per_deg=contact.stiffness_Nm_per_deg * torque / length,
            stribeck_speed_deg_s=contact.stribeck_speed_deg_s * length,
        ),
        torque_sensor=dataclasses.replace(sensor, noise_Nm=sensor.noise_Nm * torque),
        sensors=dataclasses.replace(AXIS.sensors, angle_noise_deg=AXIS.sensors.angle_noise_deg * length),
    )


@pytest.fixture(scope="module")
def measured() -> dict[str, Signal]:
    """An axis with viscous friction and free play that its sheet does not know."""
    hidden = (EffectEntry("viscous_friction", {"sigma_2": 250.0}), EffectEntry("backlash", {"width": 0.004}))
    true = AXIS.replace(effects=hidden)
    ends = np.degrees([0.15, -0.15])
    sweeps = tuple(Sweep(ends[i % 2], rate, 1.0) for i, rate in enumerate((2.0, 3.0, 5.0, 1.5, 4.0, 2.5, 3.5, 2.0)))
    slower = dataclasses.replace(sensing_of(true), angle_rate_Hz=40.0, pressure_rate_Hz=40.0)  # quicker to diagnose
    run = simulate(true, motion_of(Manoeuvre("axis", "", (Hold(4.0), *sweeps, Hold(4.0))), true), slower)
    return {channel.name: signal for channel, signal in run.signals.items()}


def answer(measured: dict[str, Signal], torque: float, length: float) -> dict[str, Any]:
    position = Signal(measured["left"].time_s, measured["left"].value * length)
    force = Signal(measured["torque"].time_s, measured["torque"].value * torque)
    diagnosis = diagnose_recordings([Recording("axis", 0, {"left": position}, {}, measured_torque=force)], axis(torque, length))
    reread = vehicle_file.from_mapping(vehicle_file.to_mapping(diagnosis.augmented.vehicle), Path("augmented.yaml"))
    assert reread.effects == diagnosis.augmented.vehicle.effects
    done = diagnosis.json
    relative = {
        f"{effect['id']}.{name}": number["value"] / (torque ** POWERS[p.unit][0] * length ** POWERS[p.unit][1])
        for effect in done["effects"]
        for name, number in effect["parameters"].items()
        for p in CATALOGUE[effect["id"]].parameters
        if p.name == name
    }
    errors = {f"augmented.{key}": done["augmented"][key] / torque for key in ("heldout_rmse_Nm", "causal_rmse_Nm")}
    return {"verdict": done["verdict"], **errors, **relative}


@pytest.fixture(scope="module")
def ordinary(measured: dict[str, Signal]) -> dict[str, Any]:
    found = answer(measured, 1.0, 1.0)
    assert found["verdict"] == "missing_physics"
    return found


@pytest.mark.parametrize(("torque", "length"), [(1e-4, 1e3), (1e4, 1e-3)])
def test_the_answer_does_not_depend_on_the_size_of_the_machine(
    measured: dict[str, Signal], ordinary: dict[str, Any], torque: float, length: float
) -> None:
    found = answer(measured, torque, length)
    assert found.pop("verdict") == ordinary["verdict"]
    assert found == pytest.approx({key: value for key, value in ordinary.items() if key != "verdict"}, rel=0.01)


@pytest.mark.parametrize(
    ("unit", "torque", "angle"),
    [("N m", 1, 0), ("N m s2/rad2", 1, -2), ("rad/(N m)", -1, 1), ("1/(N m)", -1, 0), ("1/rad^2", 0, -2), ("N m/rad^3", 1, -3),
     ("kg m2", 1, -1), ("W/K", 1, 1), ("K/W", -1, -1), ("J/K", 1, 1), ("rad/s", 0, 1), ("s/rad", 0, -1), ("1", 0, 0), ("Pa/s", 0, 0),
     ("s", 0, 0), ("K/s", 0, 0)],
)  # fmt: skip
def test_units_tell_how_a_number_grows_with_the_machine(unit: str, torque: int, angle: int) -> None:
    """Exponents by hand."""
    assert Size(1e4, 1e-3).of(unit) == pytest.approx(1e4**torque * 1e-3**angle, rel=1e-12)


@pytest.mark.parametrize(
    ("share", "typical", "most", "held"),
    [(0.1, 3e-6, 5e-5, 5e-5), (0.33, 3e-7, 5e-6, 5e-5), (1.0, 3e-7, 5e-6, 5e-6), (10.0, 3e-8, 5e-6, 5e-6)],
)
@pytest.mark.filterwarnings("ignore::lugre_steering.errors.ImplausibleWarning")
def test_ranges_of_a_vehicle_follow_its_size_and_become_no_narrower(
    share: float, typical: float, most: float, held: float, tmp_path: Path
) -> None:
    """A linkage gives ten times as much per torque where all torques are a tenth; a file may say so, and that of one whose friction may
    have been that little before it was recalibrated."""
    vehicle = vehicle_file.load(Path(__file__).parents[2] / "config" / "test_vehicle.yaml")
    axle, track = vehicle.axle, vehicle.track
    assert axle is not None
    assert track is not None
    axle, track = dataclasses.replace(axle, load_N=share * axle.load_N), dataclasses.replace(track, weight_N=share * track.weight_N)
    sized = vehicle.replace(axle=axle, track=track)
    gives = next(p for p in resized(CATALOGUE["linkage_compliance"], size_of(sized, [])).parameters if p.name == "compliance")
    assert (gives.scale, gives.high) == pytest.approx((typical, most))
    for compliance, allowed in ((0.9 * held, True), (1.1 * held, False)):
        file = tmp_path / "vehicle.yaml"
        vehicle_file.save(sized.replace(effects=(EffectEntry("linkage_compliance", {"compliance": compliance}),)), file)
        with contextlib.nullcontext() if allowed else pytest.raises(VehicleFileError, match=f"a number from 0 to {held:g}"):
            vehicle_file.load(file)


def test_every_unit_of_the_catalogue_is_known() -> None:
    known = {"N m", "N m s/rad", "N m s2/rad2", "rad/(N m)", "1/(N m)", "1/rad", "1/rad^2", "N m/rad", "N m/rad^3", "kg m2", "W/K",
             "K/W", "J/K", "W", "rad", "rad/s", "s/rad", "1", "s", "K/s", "Pa", "Pa/s", "K"}  # fmt: skip
    assert {p.unit for effect in CATALOGUE.values() for p in effect.parameters} <= known


def test_grids_that_follow_the_recording_do_not_follow_the_unit() -> None:
    stop = resized(CATALOGUE["end_stop"], Size(1.0, 1e3))
    (knee,) = (p for p in stop.parameters if p.name == "engage_angle")
    assert knee.grid == (0.55, 0.65, 0.75, 0.82, 0.88, 0.94)  # shares of the largest angle
    assert (knee.low, knee.high) == pytest.approx((20.0, 1500.0))
