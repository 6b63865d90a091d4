# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a vehicle has been through survives a restart and a change of the vehicle file. All data are synthetic."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from lugre_steering import replay
from lugre_steering.chain.step import torque_side
from lugre_steering.data.dataset import prepare
from lugre_steering.errors import DataError
from lugre_steering.estimator import Estimator, Options, doubts
from lugre_steering.estimator.state_file import Ownership, read_learned, read_state, write_state
from lugre_steering.fitting.causal import causal_rmse
from lugre_steering.recording import Array, Recording
from lugre_steering.vehicle import EffectEntry, Vehicle, load
from lugre_steering.vehicle.model import build_model
from lugre_steering.watch.window import read_window

VEHICLE = load(Path(__file__).resolve().parents[1] / "config" / "test_vehicle.yaml")
JOINT = load(Path(__file__).resolve().parents[1] / "config" / "single_joint_example.yaml").replace(gravity=None)
T0 = 1_790_000_000_000_000_000
SECOND = 1_000_000_000


def steer(estimator: Estimator, begin: int, end: int, late_ns: int = 0) -> list[np.void]:
    """The drive from one sample to another, 100 Hz."""
    rows = []
    for i in range(begin, end):
        for side in (0, 1):
            rows += [row.copy() for row in estimator.push(side, T0 + i * 10_000_000 + late_ns, 0.3 * math.sin(0.02 * i))[0]]
    return rows


def test_a_restart_of_a_second_is_as_if_a_second_of_samples_were_lost(tmp_path: Path) -> None:
    with_gap = Estimator(VEHICLE)
    steer(with_gap, 0, 1000)
    expected = steer(with_gap, 1100, 1200)
    first = Estimator(VEHICLE)
    steer(first, 0, 1000)
    write_state(tmp_path / "state.json", VEHICLE, first.memory)
    second = Estimator(VEHICLE)
    second.resume(read_state(tmp_path / "state.json", VEHICLE, T0 + 11 * SECOND, 3600.0))
    rows = steer(second, 1101, 1200)  # after the silence, a stamp so far ahead had to be confirmed
    np.testing.assert_allclose([row["total"] for row in rows], [row["total"] for row in expected], rtol=1e-12)
    assert list(tmp_path.iterdir()) == [tmp_path / "state.json"]
    assert not (tmp_path / "state.json").stat().st_mode & 0o077  # for its user alone


def test_heat_is_aged_by_the_cooling_law() -> None:
    """lambda A / (rho c A h) of the sheet: the rubber's excess over the air falls with that rate, the bristle stays."""
    estimator = Estimator(VEHICLE)
    steer(estimator, 0, 3000)
    last = steer(estimator, 3000, 3001)[0]
    resumed = Estimator(VEHICLE)
    resumed.resume(estimator.memory)
    hour = []
    for i in range(3):  # the first stamp so far ahead is to be confirmed
        for side in (0, 1):
            hour += [r.copy() for r in resumed.push(side, T0 + 3600 * SECOND + i * 10_000_000, 0.3 * math.sin(0.02 * 3000))[0]]
    assert VEHICLE.rubber is not None
    rubber = VEHICLE.rubber
    rate = rubber.heat_transfer_W_m2K / (rubber.density_kg_m3 * rubber.specific_heat_J_kgK * rubber.tread_thickness_m)
    excess = float(last["temperature"][0]) - 15.0
    assert excess > 5.0
    assert float(hour[0]["temperature"][0]) - 15.0 == pytest.approx(excess * math.exp(-rate * (3600.0 - 30.0)), rel=1e-3)
    assert float(hour[0]["total"]) == pytest.approx(float(last["total"]), rel=0.15)  # stiffer, as it is colder


def test_the_first_feed_forward_of_a_kept_bristle_keeps_to_the_limit_of_rate() -> None:
    """Nobody was told of a torque before: it begins at zero, and is the whole of it as soon as the limit allows."""
    estimator, options = Estimator(VEHICLE), Options(feed_forward_rate_limit_Nm_s=1e5)
    steer(estimator, 0, 1000)
    resumed = Estimator(VEHICLE, options)
    resumed.resume(estimator.memory)
    rows = steer(resumed, 1010, 1100)
    fed, torque = (np.array([row[name] for row in rows]) for name in ("feed_forward", "torque"))
    assert np.abs(torque[0]).min() > 5e3
    assert not fed[0].any()
    steps, seconds = np.abs(np.diff(fed, axis=0)), np.diff([int(row["stamp_ns"]) for row in rows])[:, None] * 1e-9
    assert np.all(steps <= 1e5 * seconds + 1e-6)
    np.testing.assert_array_equal(fed[-1], torque[-1])


def test_a_pipe_in_place_of_the_file_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "state.json")
    with pytest.raises(DataError, match="is no regular file"):
        read_state(tmp_path / "state.json", VEHICLE, T0, 3600.0)
    with pytest.raises(DataError, match="is no regular file"):
        read_window(tmp_path / "state.json", VEHICLE.channels)


@pytest.mark.parametrize("spoil", ["cut", "flip", "other vehicle", "old", "ahead", "not JSON", "missing", "no stamp"])
def test_a_state_that_is_of_no_use_is_refused(tmp_path: Path, spoil: str) -> None:
    file, vehicle, now_ns = tmp_path / "state.json", VEHICLE, T0 + 2 * SECOND
    estimator = Estimator(VEHICLE)
    steer(estimator, 0, 100)
    write_state(file, VEHICLE, estimator.memory)
    text = file.read_text()
    if spoil == "cut":
        file.write_text(text[: len(text) // 2])
    elif spoil == "flip":
        file.write_text(text.replace('"z": ', '"z": 1'))
    elif spoil == "other vehicle":
        vehicle = VEHICLE.replace(name="another")
    elif spoil == "old":
        now_ns += 3601 * SECOND
    elif spoil == "ahead":
        now_ns = T0 - SECOND
    elif spoil == "not JSON":
        file.write_bytes(b"\xff\x00[[[")
    elif spoil == "missing":
        file.unlink()
    elif spoil == "no stamp":
        memory = estimator.memory
        memory["sides"]["left"]["stamp_ns"] = 10**400
        write_state(file, VEHICLE, memory)
    with pytest.raises(DataError):
        read_state(file, vehicle, now_ns, 3600.0)


def test_of_state_and_what_was_learned_damage_costs_one_and_age_only_the_state(tmp_path: Path) -> None:
    file, estimator, learned = tmp_path / "state.json", Estimator(VEHICLE), {"record": "AAAA"}
    steer(estimator, 0, 100)
    write_state(file, VEHICLE, estimator.memory)
    assert read_learned(file, VEHICLE) is None  # as earlier versions wrote it
    write_state(file, VEHICLE, estimator.memory, learned)
    text, now_ns = file.read_text(), T0 + 2 * SECOND
    assert read_learned(file, VEHICLE) == learned
    assert read_state(file, VEHICLE, now_ns, 3600.0) == estimator.memory
    with pytest.raises(DataError, match="old"):
        read_state(file, VEHICLE, now_ns + 10_000 * SECOND, 3600.0)
    with pytest.raises(DataError, match="of another vehicle file"):
        read_learned(file, VEHICLE.replace(name="another"))
    for damaged in ("BAAA", None):
        file.write_text(text.replace('{"record": "AAAA"', f'{{"record": {json.dumps(damaged)}'))
        with pytest.raises(DataError, match="damaged"):
            read_learned(file, VEHICLE)
        assert read_state(file, VEHICLE, now_ns, 3600.0) == estimator.memory
    file.write_text(text.replace('"z": ', '"z": 1'))
    with pytest.raises(DataError, match="damaged"):
        read_state(file, VEHICLE, now_ns, 3600.0)
    assert read_learned(file, VEHICLE) == learned


def test_a_state_of_another_model_is_refused_and_nothing_changed() -> None:
    estimator, fresh = Estimator(VEHICLE), Estimator(VEHICLE)
    steer(estimator, 0, 100)
    memory = json.loads(json.dumps(estimator.memory))
    memory["sides"]["right"]["state"]["z"] = math.nan
    with pytest.raises(DataError, match="z is not a finite number"):
        fresh.resume(memory)
    memory["sides"]["right"]["state"].pop("z")
    with pytest.raises(DataError, match="other quantities: z"):
        fresh.resume(memory)
    assert not fresh.memory["sides"]


def test_another_file_of_the_same_vehicle_takes_over_without_a_gap() -> None:
    stiffer = with_stiffness(VEHICLE, 1.1)
    one, other = Estimator(VEHICLE), Estimator(stiffer)
    steer(one, 0, 500)
    steer(other, 0, 500)
    one.push(0, T0 + 5 * SECOND, 0.3 * math.sin(10.0))  # its partner comes after the change
    other.push(0, T0 + 5 * SECOND, 0.3 * math.sin(10.0))
    new = one.continued(stiffer)
    rows = [row.copy() for row in new.push(1, T0 + 5 * SECOND, 0.3 * math.sin(10.0))[0]]
    expected = [row.copy() for row in other.push(1, T0 + 5 * SECOND, 0.3 * math.sin(10.0))[0]]
    assert [row["stamp_ns"] for row in rows] == [T0 + 5 * SECOND]
    rows += steer(new, 501, 1500)
    expected += steer(other, 501, 1500)
    # After a long way the past of the bristle is forgotten.
    assert float(rows[-1]["total"]) == pytest.approx(float(expected[-1]["total"]), rel=1e-2)
    assert new.counters["angle/left"]["accepted"] == 1500


def test_physics_that_another_file_adds_begins_as_at_the_start_of_a_recording() -> None:
    """Its memory is not zero then: a stop is loading, a carcass as warm as the rubber was."""
    estimator = Estimator(VEHICLE)
    steer(estimator, 0, 500)
    stop = EffectEntry("end_stop", {"engage_angle": 0.6, "stiffness": 1e5})
    carcass = EffectEntry("carcass_heat_sink", {"conductance": 50.0, "capacity": 5e4})
    state = estimator.continued(VEHICLE.replace(effects=(stop, carcass))).memory["sides"]["left"]["state"]
    assert VEHICLE.initial is not None
    assert state["end_stop_loading"] == 1.0
    assert state["carcass_heat_sink_carcass_temperature"] == VEHICLE.initial.rubber_temperature_degC
    assert state["temperature"] == estimator.memory["sides"]["left"]["state"]["temperature"] > VEHICLE.initial.rubber_temperature_degC


def with_stiffness(vehicle: Vehicle, factor: float) -> Vehicle:
    assert vehicle.friction is not None
    stiffness = factor * vehicle.friction.stiffness_Nm_per_deg
    return vehicle.replace(friction=dataclasses.replace(vehicle.friction, stiffness_Nm_per_deg=stiffness))


def test_a_file_of_another_machine_does_not_take_over() -> None:
    with pytest.raises(DataError, match="other sides, topics or joints"):
        Estimator(VEHICLE).continued(VEHICLE.replace(sides=("left",)))


def test_options_change_while_it_runs() -> None:
    estimator = Estimator(VEHICLE)
    steer(estimator, 0, 300)
    estimator.set_options(Options(feed_forward_limit_Nm=1e3, feed_forward_rate_limit_Nm_s=1e9))
    rows = steer(estimator, 300, 400)
    assert max(abs(float(row["feed_forward"][0])) for row in rows) == 1e3


def test_what_was_not_known_of_the_bristle_is_not_known_after_a_restart() -> None:
    """A silence in mid-stroke, then parked: the same place after the restart says nothing of what went unseen before it."""
    estimator = Estimator(VEHICLE)
    steer(estimator, 0, 400)

    def park(parked: Estimator, begin: int, end: int) -> list[np.void]:
        return [
            row.copy() for i in range(begin, end) for side in (0, 1) for row in parked.push(side, T0 + i * 10_000_000, 0.2)[0]
        ]

    assert doubts(park(estimator, 700, 900)[-1]) == ["unseen motion"]
    resumed = Estimator(VEHICLE)
    resumed.resume(json.loads(json.dumps(estimator.memory)))
    assert all(doubts(row) == ["unseen motion"] for row in park(resumed, 1000, 1100))
    moved = [
        row.copy() for i in range(300) for side in (0, 1) for row in resumed.push(side, T0 + (1100 + i) * 10_000_000, 0.2 - 0.002 * i)[0]
    ]
    assert doubts(moved[0]) == ["unseen motion"]
    assert doubts(moved[-1]) == []


def test_the_memory_is_plain_data() -> None:
    estimator = Estimator(VEHICLE)
    steer(estimator, 0, 100)
    assert json.loads(json.dumps(estimator.memory)) == estimator.memory


def test_a_state_file_is_of_one_node_at_a_time(tmp_path: Path) -> None:
    file, first, second = tmp_path / "state.json", Ownership(), Ownership()
    assert first.take(file) == first.take(file) == ""
    assert f"{file}: process {os.getpid()} keeps its state there" in second.take(file)
    assert second.take(tmp_path / "other.json") == ""
    assert first.take(tmp_path / "third.json") == ""  # which lets go of the one before
    assert second.take(file) == ""
    second.release()
    first.release()
    assert list(tmp_path.iterdir()) == []
    assert "cannot be written" in first.take(tmp_path / "missing" / "state.json", 60.0)  # at once
    os.mkfifo(tmp_path / ".laid_out.json.lock")
    assert "is not a lock file of ours" in first.take(tmp_path / "laid_out.json", 60.0)  # as well


def test_a_state_that_cannot_take_its_place_leaves_nothing_behind(tmp_path: Path) -> None:
    estimator = Estimator(VEHICLE)
    steer(estimator, 0, 10)
    (tmp_path / "state.json").mkdir()
    with pytest.raises(IsADirectoryError):
        write_state(tmp_path / "state.json", VEHICLE, estimator.memory)
    assert list(tmp_path.iterdir()) == [tmp_path / "state.json"]


def test_a_killed_node_lets_go_of_its_state_file_and_one_that_leaves_is_waited_for(tmp_path: Path) -> None:
    file, own = tmp_path / "state.json", Ownership()
    script = "import sys, time; from pathlib import Path; from lugre_steering.estimator.state_file import Ownership; "
    script += "assert Ownership().take(Path(sys.argv[1])) == ''; print('has it', flush=True); time.sleep(60)"
    with subprocess.Popen([sys.executable, "-c", script, str(file)], stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "has it\n"
        assert f"process {other.pid} keeps" in own.take(file)
        killer = threading.Timer(0.5, other.kill)
        killer.start()
        assert own.take(file, 30.0) == ""
        killer.join()
    own.release()


def held_at_the_start(share: float) -> tuple[Array, Array, Recording]:
    """Time, true torque and recording of a joint that stands for a second with a part of what its bristle can hold, then swings."""
    model, time = build_model(JOINT), np.arange(0.0, 12.0, 0.01)
    parameters = model.parameters[0].copy()
    parameters["initial_bristle"] = share * parameters["static_torque"] / parameters["sigma_0"]
    angle = np.where(time < 1.0, 0.4, 0.4 * np.cos(time - 1.0))
    rate = np.where(time < 1.0, 0.0, -0.4 * np.sin(time - 1.0))
    torque = torque_side(parameters, model.rubber, time, angle, rate, 0.0 * time)
    return time, torque, Recording.from_arrays(time, angle=angle, torque=torque)


@pytest.mark.parametrize("share", [-0.9, 0.4, 0.9])
def test_what_the_bristle_holds_at_the_start_is_what_the_first_torque_says(share: float) -> None:
    assert JOINT.contact is not None
    _, torque, recording = held_at_the_start(share)
    (bag,) = replay([recording], JOINT).bags
    series = bag.kept()
    assert series.torque[25:100] == pytest.approx(torque[25:100], abs=0.02 * JOINT.contact.static_torque_Nm)
    assert np.abs(series.torque[0] - torque[0]) > 0.3 * JOINT.contact.static_torque_Nm  # nothing had told of it yet
    assert bag.fit is not None
    assert bag.fit.rmse_Nm < 0.1 * JOINT.contact.static_torque_Nm  # nor counts what was estimated before
    assert causal_rmse(JOINT, [recording], [prepare(recording, JOINT)]) < 0.1 * JOINT.contact.static_torque_Nm


def test_a_bristle_that_is_relaxed_but_for_noise_stays_so_and_one_that_is_remembered_too() -> None:
    """A first torque within a twentieth of the friction agrees; after a restart the memory counts, whatever that torque is."""
    time, _, recording = held_at_the_start(0.9)
    angle, torque = recording.angle["left"], recording.measured_torque
    assert torque is not None
    agrees = Recording.from_arrays(time, angle=angle.value, torque=np.where(time < 1.0, 0.5, torque.value))
    assert replay([agrees], JOINT).bags[0].kept().torque[50] == replay([recording], JOINT).bags[0].kept().torque[0]
    first, again = Estimator(JOINT), Estimator(JOINT)
    for i in range(20):
        first.push(0, T0 + i * 10_000_000, 0.4)
    again.resume(first.memory)
    for i in range(20, 80):
        (row,) = again.push(0, T0 + i * 10_000_000, 0.4)[0]
        again.push(1, T0 + i * 10_000_000, 40.0)
    first.push(0, T0 + 79 * 10_000_000, 0.4)  # a stamp so far ahead has to be confirmed
    assert row["total"] == pytest.approx(first.push(0, T0 + 80 * 10_000_000, 0.4)[0]["total"][0], abs=1e-9)


def test_one_stray_torque_at_the_start_tells_nothing_of_the_bristle() -> None:
    """Of a pressure, which has no other before it: what comes next shows that it was none."""
    parked = [pressure for line in range(4) for pressure in ((line, 1e6 if line % 2 else 2e6),)]
    totals = []
    for stray in (1.0, 8.0):
        estimator = Estimator(VEHICLE)
        for i in range(100):
            stamp_ns = T0 + i * 10_000_000
            for line, pressure in parked:
                estimator.push(2 + line, stamp_ns - 1_000_000, pressure * (stray if line == 0 and i == 0 else 1.0))
            for side in (0, 1):
                rows, _ = estimator.push(side, stamp_ns, 0.1)
        totals.append(rows["total"][0])
    assert totals[0] != 0.0
    assert totals[1] == pytest.approx(totals[0], rel=0.05)
