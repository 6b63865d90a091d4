# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a callback must not do: compile, or take memory. Watched inside the node's own process, over real DDS."""

from __future__ import annotations

import json
import math
import signal
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy")

from builtin_interfaces.msg import Duration
from live_harness import T0, VEHICLE, LiveNode, Sample, World, motion
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from lugre_steering.vehicle import load

WATCHED_NODE = """
import json
import sys
import tracemalloc
from pathlib import Path

from numba.core import event
from numba.core.dispatcher import Dispatcher

from lugre_steering.estimator import Estimator
from lugre_steering.live import run, session

SETTLED = 1000  # messages until the middleware and its buffers have settled
WARM_UP = True


class Compiled(list, event.Listener):
    def on_start(self, started):
        self.append(str(started.data["dispatcher"]))

    def on_end(self, ended):
        pass


def signatures():
    modules = [module for name, module in sys.modules.items() if name.startswith("lugre_steering")]
    kernels = {value for module in modules for value in vars(module).values() if isinstance(value, Dispatcher)}
    return sum(len(kernel.signatures) for kernel in kernels)  # compiled, or loaded from the cache


def resident_kB(field):
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(field))


compiled, memory = Compiled(), {}
push, spin, warm_up = Estimator.push, run.spin, session.warm_up
pushes = 0


def watched_push(self, *sample):
    global pushes
    pushes += 1
    if pushes == SETTLED:
        memory["python_kB"] = tracemalloc.get_traced_memory()[0] / 1024
        tracemalloc.reset_peak()
        Path("/proc/self/clear_refs").write_text("5")  # the peak starts anew
        memory["resident_kB"] = resident_kB("VmRSS")
    return push(self, *sample)


def watched_spin(*arguments):
    Estimator.push = watched_push
    tracemalloc.start()
    before = signatures()
    event.register("numba:compile", compiled)
    sound = spin(*arguments)
    result = {
        "pushes": pushes,
        "compiled": compiled,
        "signatures": signatures() - before,
        "python_growth_kB": tracemalloc.get_traced_memory()[1] / 1024 - memory.get("python_kB", 0),
        "resident_growth_kB": resident_kB("VmHWM") - memory.get("resident_kB", 0),
    }
    print("watched:", json.dumps(result))
    return sound


if not WARM_UP:
    session.warm_up = lambda *_: None
run.spin = watched_spin
sys.exit(run.run(sys.argv))
"""


def watch(script: Path, source: str, samples: list[Sample], *ros_args: str) -> dict[str, Any]:
    """Play the samples and a plan to a node that watches itself -> what it saw."""
    script.write_text(source)
    vehicle = load(VEHICLE)
    joints = [vehicle.topics.left_joint, vehicle.topics.right_joint]
    with LiveNode(*ros_args, command=[str(script)]) as node, World(vehicle) as world:
        plan = JointTrajectory(joint_names=joints)
        plan.points = [JointTrajectoryPoint(positions=[0.0, 0.0], time_from_start=Duration(sec=i)) for i in (1, 9)]
        half = len(samples) // 2
        for part in (samples[:half], samples[half:]):
            world.play(part)
            world.command.publish(plan)
        world.status("inputs")
        code, _ = node.stop(signal.SIGTERM)
        assert code == 0, node.output
        line = next(line for line in node.output.splitlines() if line.startswith("watched:"))
    result: dict[str, Any] = json.loads(line.removeprefix("watched:"))
    return result


def everything() -> list[Sample]:
    """Every kind of input, with and without rates, samples that are refused, and a restart of time."""
    samples = motion(load(VEHICLE), 8.0)
    refused = [
        Sample(0, T0 + 1, math.nan),
        Sample(2, T0 + 1, 1e15),
        *(Sample(0, T0 - 10_000_000_000 + i * 10_000_000, 0.0) for i in range(3)),
    ]
    return [*samples, *refused, *motion(load(VEHICLE), 3.0, start_ns=T0 - 9_000_000_000)]


def test_callbacks_neither_compile_nor_take_memory(tmp_path: Path) -> None:
    seen = watch(tmp_path / "node.py", WATCHED_NODE, everything(), "-p", "feed_forward_horizon_s:=0.3")
    assert seen["pushes"] > 2000  # of 6630: best effort may lose some on a busy machine
    assert seen["compiled"] == []
    assert seen["signatures"] == 0
    # Peaks above the level after the first 1000 messages, garbage included; the estimator's buffers made anew would be 256 kB and more.
    assert seen["python_growth_kB"] < 200
    assert seen["resident_growth_kB"] < 4096


def test_the_watch_notices_a_missing_warm_up(tmp_path: Path) -> None:
    seen = watch(
        tmp_path / "node.py", WATCHED_NODE.replace("WARM_UP = True", "WARM_UP = False"), motion(load(VEHICLE), 0.2)
    )
    assert seen["signatures"] > 0
