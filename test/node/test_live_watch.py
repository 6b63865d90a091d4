# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The window that the live node writes when asked for it, over DDS."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("rclpy")

from live_harness import NAME, VEHICLE, Driver, LiveNode, World, call
from std_srvs.srv import Trigger

from lugre_steering.watch.window import read_window


def test_a_marked_window_is_written(tmp_path: Path) -> None:
    with LiveNode("-p", f"watch_folder:={tmp_path}", "-p", "watch_before_s:=60.0") as _, World() as world:
        Driver(world).steer(2.0)
        world.wait(lambda: len(world.heard["torque"]) == 200)
        answer = call(world, Trigger, f"{NAME}/mark", Trigger.Request())
        assert answer.success, answer.message
        file, length = answer.message.splitlines()
        assert 1.5 < float(length.removesuffix(" s")) < 30.0  # not the 60 s wanted: there is no more
        file = Path(file)
        recording = read_window(file, world.vehicle.channels).recording
        assert recording.angle["left"].value.size == 200
        assert recording.angle["right"].value.size == 200
    made = json.loads(str(np.load(file)["about"]))["provenance"]
    assert (made["command"], made["options"]) == ("node", {"watch_before_s": 60.0})
    assert made["vehicle"]["sha256"] == {VEHICLE.name: hashlib.sha256(VEHICLE.read_bytes()).hexdigest()}


FORGETFUL_NODE = """
import sys
import time
from lugre_steering.live import run
from lugre_steering.watch import detector, window

window.CAPACITY = 200
began_ns = time.time_ns()
detector.Watch.since_ns = property(lambda self: began_ns)
sys.exit(run.run(sys.argv))
"""


def test_a_window_that_begins_after_the_mismatch_says_so(tmp_path: Path) -> None:
    """Of two angles at 100 Hz and the pressures with them 200 samples are no second."""
    script = tmp_path / "forgetful.py"
    script.write_text(FORGETFUL_NODE)
    with LiveNode("-p", f"watch_folder:={tmp_path}", script=script) as _, World() as world:
        Driver(world).steer(3.0)
        world.wait(lambda: len(world.heard["torque"]) == 300)
        answer = call(world, Trigger, f"{NAME}/mark", Trigger.Request())
        file, length, missing = answer.message.splitlines()
        assert float(length.removesuffix(" s")) < 2.0
        assert 1.9 < float(missing.removeprefix("its samples begin ").split()[0]) < 60.0
        said = world.status("residual", lambda s: "last window" in s.values).values["last window"]
        assert said == f"{file} ({missing})"
    reason = read_window(Path(file), world.vehicle.channels).reason
    assert reason.startswith("marked; no match since ")
    assert reason.endswith(missing)


def test_without_a_folder_a_mark_is_told_and_no_window_written() -> None:
    with LiveNode() as _, World() as world:
        Driver(world).steer(0.2)
        answer = call(world, Trigger, f"{NAME}/mark", Trigger.Request())
        assert answer.success
        assert "watch_folder" in answer.message
        mark = world.status("residual", lambda s: "last mark" in s.values).values["last mark"]
        assert mark.endswith(" s: marked")
        assert mark in answer.message
