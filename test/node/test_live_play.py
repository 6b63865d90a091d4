# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""A bag played to the live node, and the node watched: three processes as a user starts them."""

from __future__ import annotations

import importlib.util
import json
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import bag_making as make
import numpy as np
import pytest
from rich.console import Console
from rosbags.typesys import get_types_from_msg
from typer.testing import CliRunner

from lugre_steering.cli import app
from lugre_steering.errors import BagError
from lugre_steering.node import arguments_of
from lugre_steering.recording import NODE
from lugre_steering.watch.seen import Arrived
from lugre_steering.watch.view import BARS, spark, view

PACKAGE_ROOT = Path(__file__).resolve().parents[2]
VEHICLE = PACKAGE_ROOT / "config" / "test_vehicle.yaml"


def text_of(state: Arrived, now_s: float, width: int = 80) -> str:
    console = Console(width=width, no_color=True)
    with console.capture() as capture:
        console.print(view(state, now_s))
    return capture.get()


def test_the_view_shows_numbers_their_last_minute_and_health() -> None:
    state = Arrived("/a/steering_torque_estimator")
    assert "nothing has come yet" in text_of(state, 5.0)
    for k in range(100):
        state.add("torque", "N m", 0.5 * k, -48_200.0 + 900.0 * k)
    state.add("left_track_steer_joint", "deg", 49.6, 12.345)
    state.diagnosed(49.7, [("inputs", 2, "angle/left stale"), ("latency", 0, "fine")])
    shown = text_of(state, 50.0)
    for words in ("/a/steering_torque_estimator", "torque", "40\u202f900", "-48\u202f200", "N m", "12.3", "error", "angle/left stale"):
        assert words in shown, shown
    assert "…" not in shown
    (torque,) = (line.replace("\u202f", "").split() for line in shown.splitlines() if " torque" in line)
    assert torque[-3:-1] == ["-48200", "40900"]  # all of the minute, also what no column of the line shows
    assert "silent" not in shown
    assert "silent for 30 s" in text_of(state, 80.0)


def test_a_line_of_characters() -> None:
    assert spark([0.0, float("nan"), 7.0, 3.0]) == f"{BARS[0]} {BARS[7]}{BARS[3]}"
    assert spark([2.0, 2.0]) == BARS[3] * 2
    assert spark([]) == ""


def test_arguments_of_the_node() -> None:
    made = arguments_of(Path("v.yaml"), Path("p.yaml"), ["angle_timeout_s:=0.3"], ["a:=b"])
    assert made == [
        "estimator", "--ros-args", "--params-file", "p.yaml", "-p", "vehicle_file:=v.yaml", "-p", "angle_timeout_s:=0.3", "-r", "a:=b",
    ]  # fmt: skip


@pytest.mark.parametrize("command", [("play", "bag"), ("watch",), ("node", "--vehicle", "v.yaml")])
def test_without_ros_it_is_one_line(monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *rest: None if name == "rclpy" else find(name, *rest))
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 2
    assert len(done.stderr.splitlines()) == 1
    assert "lugre_steering[ros]" in done.stderr


def test_stamps_are_moved_and_nothing_else() -> None:
    pytest.importorskip("rclpy")
    from lugre_steering.bag import cdr
    from lugre_steering.live.play import moved

    stamp = np.array([1_700_000_000_900_000_000])
    raw, later = (cdr.encode_fluid_pressure(stamp + shift, "frame", np.array([1e6])).tobytes() for shift in (0, 200_000_000))
    assert moved(raw, 200_000_000) == later
    assert moved(later, -200_000_000) == raw
    unset = raw[:4] + bytes(8) + raw[12:]
    assert moved(unset, 200_000_000) == unset
    assert moved(raw[:8], 5) == raw[:8]
    assert moved(raw, 10**18 * 3) == raw  # no stamp can say that


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """ROS in this process, heard by nobody else."""
    pytest.importorskip("rclpy")
    from live_harness import OWN_DOMAIN

    monkeypatch.setenv("ROS_DOMAIN_ID", str(OWN_DOMAIN))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")


def pressures(*log_s: float, topic: str = "/steering/pressure/main_a") -> list[make.Message]:
    return [(topic, make.FLUID_PRESSURE, make.T0 + round(t * 1e9), make.pressure(make.T0 + round(t * 1e9), 1e6)) for t in log_s]


@pytest.mark.usefixtures("alone")
def test_what_is_not_played_is_told_with_the_reason(tmp_path: Path) -> None:
    from lugre_steering.live.play import play

    unknown = get_types_from_msg("int32 value", "made_up_msgs/msg/Thing")
    make.TYPES.register(unknown)
    others = [*pressures(0.0, topic=f"/{NODE}/residual"), ("/thing", "made_up_msgs/msg/Thing", make.T0, b"\0\1\0\0\0\0\0\0")]
    bag = make.write(tmp_path / "run", [*others, *pressures(0.1, 0.2)])
    played = play(bag, rate=10.0, wait_s=0.0)
    assert played.messages == {"/steering/pressure/main_a": 2}
    left_out = {f"/{NODE}/residual": "an output of the estimator", "/thing": "type made_up_msgs/msg/Thing is not installed"}
    assert (played.left_out, played.rounds) == (left_out, 1)
    with pytest.raises(BagError, match=r"no topic to publish .*an output of the estimator; /thing: type .* is not installed"):
        play(make.write(tmp_path / "others", others), wait_s=0.0)


@pytest.mark.usefixtures("alone")
def test_a_loop_and_a_long_pause_end_when_they_are_to(tmp_path: Path) -> None:
    import rclpy

    from lugre_steering.live.play import play

    rounds = iter(range(3))

    def interrupted(*_: object) -> None:
        if next(rounds) == 2:
            raise KeyboardInterrupt

    played = play(make.write(tmp_path / "run", pressures(0.0, 0.01)), loop=True, recorded_stamps=True, wait_s=0.0, progress=interrupted)
    assert (played.rounds, played.messages.total()) == (3, 6)
    timer, begin = threading.Timer(0.3, rclpy.try_shutdown), time.monotonic()
    timer.start()
    played = play(make.write(tmp_path / "pause", pressures(0.0, 100.0)), wait_s=0.0)
    assert time.monotonic() - begin < 60.0
    assert played.messages.total() == 1


def test_a_bag_is_played_to_the_node_and_watched(tmp_path: Path) -> None:
    pytest.importorskip("rclpy")
    from live_harness import NAME, PATIENCE_S, World, environment

    from lugre_steering.bench.replay import write_cycle

    write_cycle(tmp_path / "run", 6.0)
    command = [sys.executable, "-m", "lugre_steering.cli"]
    node = subprocess.Popen([*command, "node", "--vehicle", VEHICLE], env=environment(), stderr=subprocess.PIPE, text=True)
    processes = [node]
    try:
        assert node.stderr is not None
        while "ready, executor" not in node.stderr.readline():
            assert node.poll() is None
        seen = subprocess.Popen([*command, "watch", "--seconds", "300"], env=environment(), stdout=subprocess.PIPE, text=True)
        processes.append(seen)
        with World(outputs=["residual"]) as world:
            world.wait(lambda: world.node.count_subscribers(f"{NAME}/residual") >= 2)
            begun = time.monotonic()
            bag = [*command, "play", tmp_path / "run", "--json"]
            played = subprocess.run(bag, env=environment(), capture_output=True, text=True, check=True)
            assert time.monotonic() - begun > 5.9  # its own timing
            result = json.loads(played.stdout)
            assert set(result["messages"].values()) == {600}
            assert len(result["messages"]) == 6
            world.wait(lambda: len(world.heard["residual"]) > 100)
        seen.send_signal(signal.SIGINT)
        shown, _ = seen.communicate(timeout=PATIENCE_S)
    finally:  # whatever happened, none stays to be counted by the next test
        for process in processes:
            if process.poll() is None:
                process.terminate()
                process.communicate(timeout=PATIENCE_S)
    for words in ("torque", "residual", "rubber left", "left_track_steer_joint", "health", "inputs"):
        assert words in shown, shown
    assert "nothing has come" not in shown


def test_what_cannot_be_played_is_one_line(tmp_path: Path) -> None:
    pytest.importorskip("rclpy")
    done = CliRunner().invoke(app, ["play", str(tmp_path / "absent")])
    assert done.exit_code == 2
    assert "no such file" in done.stderr
