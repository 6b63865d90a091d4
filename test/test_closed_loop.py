# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The hydraulic plant of the closed loop: its friction, its statics, its controller; without the node."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from lugre_steering.bench import closed_loop
from lugre_steering.bench.closed_loop import NONE, PERIOD_S, drive, reference
from lugre_steering.bench.hydraulic_loop import Side, hydraulics_of
from lugre_steering.proof.field.friction import Inside, standing, turn_step, turn_track
from lugre_steering.proof.field.hydraulics import gains
from lugre_steering.proof.field.simulator import Setting, draw_setting
from lugre_steering.vehicle.actuation import total_gains


@pytest.fixture(scope="module")
def setting() -> Setting:
    return draw_setting(11, "clean", "white")


def side_of(setting: Setting) -> Side:
    par = hydraulics_of(setting.machine, gains(setting.machine, np.zeros((2, 1)))[:, 0])
    return Side(par, setting.ground, setting.ratios, setting.cells[0])


def test_step_by_step_the_track_turns_as_it_does_at_once(setting: Setting) -> None:
    step = 2e-3
    angle = 0.2 * np.sin(0.8 * step * np.arange(4000))
    ones = np.ones(angle.size)
    whole = turn_track(angle, step, setting.ground, setting.ratios, setting.cells[0], Inside(), ones, ones)
    track = standing(setting.cells[0], setting.ground)
    single = [
        turn_step(after, (after - before) / step, step, track, setting.ground, setting.ratios, setting.cells[0], Inside())
        for before, after in itertools.pairwise(angle)
    ]
    # The kingpin's torque follows the sum of the rates there, the angle itself here.
    assert np.abs(np.array(single) - (whole.friction + whole.aligning)[1:]).max() < 1e-6 * setting.torque_scale


def test_a_closed_valve_holds_and_an_open_one_turns_the_track(setting: Setting) -> None:
    still, moving = side_of(setting), side_of(setting)
    for _ in range(400):
        still.advance(0.0, PERIOD_S)
        moving.advance(0.3, PERIOD_S)
    assert abs(still.angle) < 1e-6
    assert moving.angle > 0.1
    par = moving.par
    load_torque = par.displacement * moving.state[2]
    assert 0.7 * setting.ground.sliding_Nm < load_torque < 1.6 * setting.ground.sliding_Nm  # what friction needs while it slides


def test_seals_that_rub_are_carried_by_the_cylinders(setting: Setting) -> None:
    """Turning steadily they take their friction beyond what the track needs: ``seal`` and its share of the load."""
    free, rubbing = side_of(setting), side_of(setting)
    seal = 0.05 * setting.ground.sliding_Nm
    rubbing.par = rubbing.par._replace(seal=seal, seal_share=0.1)
    for side in (free, rubbing):
        while side.angle < 0.1:
            side.advance(0.25, PERIOD_S)
    assert rubbing.load == pytest.approx((free.load + seal) / 0.9, rel=0.05)  # the law falls by a twentieth from rest to sliding


def test_without_feed_forward_the_loop_is_stable_but_off(setting: Setting) -> None:
    run = drive(NONE, setting, 8.0)
    time_s, wanted, _ = reference(setting.machine, 8.0)
    assert run.time.size == time_s.size
    assert 0.05 < run.rms_deg < 2.0
    assert np.degrees(np.ptp(wanted)) > 10.0
    assert np.abs(wanted[0] - wanted[1]).max() > np.radians(0.5)  # as the steering geometry makes the tracks differ
    assert run.energy_kJ > 0.0


def test_the_plant_is_recorded_as_its_sensors_show_it(setting: Setting, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pressures times the gains of the sheet are what both sides' cylinders carried, but for the noise of the sensors."""
    monkeypatch.setattr(closed_loop, "RECORD_S", 6.0)
    sheet = closed_loop.sheet_of(setting, tmp_path)
    recording, run = closed_loop.recorded(setting, sheet, -1.0), drive(NONE, setting, 6.0, way=-1.0)
    assert sheet.hydraulics is not None
    shown = total_gains(sheet, run.angles) * np.array([recording.pressure[line].value for line in sheet.hydraulics.lines])
    noise = sheet.sensors.pressure_noise_Pa * np.sqrt((total_gains(sheet, run.angles) ** 2).sum(axis=0))
    assert np.std((shown.sum(axis=0) - run.loads.sum(axis=0)) / noise) == pytest.approx(1.0, abs=0.1)
    assert not np.any([effect.id == "end_stop" for effect in sheet.effects])
