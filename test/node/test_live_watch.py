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


def test_without_a_folder_a_mark_is_told_and_no_window_written() -> None:
    with LiveNode() as _, World() as world:
        Driver(world).steer(0.2)
        answer = call(world, Trigger, f"{NAME}/mark", Trigger.Request())
        assert answer.success
        assert "watch_folder" in answer.message
        mark = world.status("residual", lambda s: "last mark" in s.values).values["last mark"]
        assert mark.endswith(" s: marked")
        assert mark in answer.message
