# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The node runs physics from a user's file, and says what is missing without it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy")

from live_harness import VEHICLE, LiveNode, World, motion

from lugre_steering.effects import registry
from lugre_steering.recording import Kind
from lugre_steering.resources import config_folder
from lugre_steering.vehicle import load, save
from lugre_steering.vehicle.effects import add_effect
from lugre_steering.vehicle.sections import EffectEntry

RIPPLE = config_folder() / "own_physics" / "chain_ripple.yaml"
SIZE, PITCH = 4000.0, 0.11


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """A vehicle file with a foreign effect; the catalogue of this process is put back."""
    known, origins = dict(registry.CATALOGUE), dict(registry.ORIGINS)
    registry.add_files([RIPPLE])
    rippled = add_effect(load(VEHICLE), EffectEntry("chain_ripple", {"torque": SIZE, "pitch": PITCH}), lambda *_: AssertionError())  # type: ignore[arg-type,return-value]
    save(rippled, tmp_path / "rippled.yaml")
    for table, before in ((registry.CATALOGUE, known), (registry.ORIGINS, origins)):
        table.clear()
        table.update(before)  # type: ignore[arg-type]
    return tmp_path / "rippled.yaml"


def test_foreign_physics_acts_in_the_node(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(registry.VARIABLE, raising=False)
    vehicle = load(VEHICLE)
    # Pressures would tell each of another start.
    samples = [sample for sample in motion(vehicle, 3.0) if vehicle.channels[sample.channel].kind is Kind.ANGLE]
    torque, angles = [], []
    for arguments in ({"vehicle": VEHICLE}, {"vehicle": own}):
        with LiveNode("-p", f"effects_files:={RIPPLE}", **arguments) as _, World() as world:  # type: ignore[arg-type]
            world.play(samples, speed=2.0)
            world.wait(lambda world=world: len(world.heard["estimate"]) >= 300)
            torque.append([sum(message.effort) for message in world.heard["estimate"]])
            angles.append([list(message.position) for message in world.heard["estimate"]])
    expected = SIZE * np.sin(2.0 * np.pi * np.array(angles[1]) / PITCH).sum(axis=1)
    np.testing.assert_allclose(np.array(torque[1]) - np.array(torque[0]), expected, atol=1e-3 * SIZE)


def test_without_the_file_the_node_says_what_is_missing(own: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(registry.VARIABLE, raising=False)
    with pytest.raises(AssertionError, match=r"chain_ripple\.yaml, which is not here"):
        LiveNode(vehicle=own)
