# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What is measured is what was put in: hand-made torques on the probe, and the estimator's chain with known effects."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

from lugre_steering.proof import probe
from lugre_steering.proof.measurable import Chain
from lugre_steering.proof.probe import MEASURES, Seen, Trip

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
TRIP = probe.motion(0.45)
SLIDING = 4e4


def dry(angle: Array) -> Array:
    """Friction of 40 kN m that follows the angle within some degrees (play operator, smoothed by nothing)."""
    out, at = np.zeros(angle.size), 0.0
    for k in range(1, angle.size):
        at = min(max(at + (angle[k] - angle[k - 1]) / 0.1, -1.0), 1.0)
        out[k] = SLIDING * at
    return out


BASE = dry(TRIP.angle)
DIRECTION = np.sign(TRIP.rate)


@pytest.mark.parametrize(
    ("name", "extra", "expected"),
    [
        ("end_stop", lambda m: np.sign(m.angle) * 2e4 * np.maximum(np.abs(m.angle) - 0.4, 0.0), 0.44),
        ("cylinder_friction", lambda m: 700.0 * np.sign(m.rate), 700.0),
        ("viscous_friction", lambda m: 9e3 * m.rate, 9e3 * np.deg2rad(7.0)),
        ("slope_bias", lambda m: np.full(m.time.size, 450.0), 450.0),
        ("pressure_drift", lambda m: 3.0 * m.time, 3.0),
        ("kingpin_jacking", lambda m: 2e3 * m.angle, 2e3),
        ("yaw_inertia", lambda m: 300.0 * m.acceleration, 300.0),
        ("direction_asymmetry", lambda m: np.where(m.rate > 0.0, 0.03, -0.03) * np.abs(BASE) * np.sign(m.rate), 0.03),
        ("wear_polishing", lambda _: -0.08 * BASE, -0.08),
        ("moment_arm_error", lambda _: 0.05 * BASE, 0.05),
        ("surface_patch", lambda m: np.where((m.angle > 0.1) & (m.angle < 0.2), -0.15, 0.0) * BASE, -0.15),
    ],
)
def test_measures_read_what_was_put_in(name: str, extra: Callable[[Trip], Array], expected: float) -> None:
    value = MEASURES[name][2](Seen(TRIP, BASE + extra(TRIP), BASE, SLIDING))
    assert value == pytest.approx(expected, rel=0.02)


def test_angle_lost_and_time_shift() -> None:
    moved = dry(TRIP.angle - 0.5 * 0.01 * np.sign(BASE) * np.minimum(np.abs(BASE) / 1e3, 1.0))
    lost = MEASURES["backlash"][2](Seen(TRIP, moved, BASE, SLIDING))
    assert lost == pytest.approx(0.01, rel=0.15)
    late = np.interp(TRIP.time - 0.02, TRIP.time, BASE)
    assert MEASURES["time_delay"][2](Seen(TRIP, late, BASE, SLIDING)) == pytest.approx(0.02, rel=0.03)


def test_held_loss_is_beyond_what_friction_loses() -> None:
    since = np.maximum(TRIP.time - TRIP.time[np.flatnonzero(TRIP.leg == 0)[-1]] + 20.0, 0.0)
    leaked = BASE * (1.0 - np.where(TRIP.leg == 0, 0.1 * since / 20.0, 0.0))
    assert MEASURES["trapped_pressure"][2](Seen(TRIP, leaked, BASE, SLIDING)) == pytest.approx(0.1, rel=0.02)


def test_a_stop_that_is_never_felt_is_none() -> None:
    assert MEASURES["end_stop"][2](Seen(TRIP, BASE, BASE, SLIDING)) is None


def test_chain_measures_its_own_effects(tmp_path: Path) -> None:
    """Of effects with a form that leaves no choice the value is the parameter, and the interval the parameter's."""
    data = yaml.safe_load((ROOT / "config" / "test_vehicle.yaml").read_text(encoding="utf-8"))
    data["rubber"]["dma_csv"] = str(ROOT / "config" / "rubber_dma_10hz.csv")
    data["effects"] = [{"id": "slope_bias", "parameters": {"torque": 500.0}}, {"id": "time_delay", "parameters": {"delay": 0.02}}]
    file = tmp_path / "augmented.yaml"
    file.write_text(yaml.safe_dump(data), encoding="utf-8")
    chain = Chain(file, TRIP, BASE)
    value, low, high = chain.measured("slope_bias", {"torque": {"value": 500.0, "ci95": [450.0, 560.0]}}, SLIDING)
    assert (value, low, high) == pytest.approx((500.0, 450.0, 560.0), rel=0.02)
    value, low, high = chain.measured("time_delay", {"delay": {"value": 0.02, "ci95": [0.019, 0.021]}}, SLIDING)
    assert (value, low, high) == pytest.approx((0.02, 0.019, 0.021), rel=0.03)
    # What acted in an earlier recording only is not in the file, and nothing can be said of it there.
    assert chain.measured("pressure_drift", {"aux_b": {"value": 1e3, "ci95": [900.0, 1100.0]}}, SLIDING) == (None, None, None)
