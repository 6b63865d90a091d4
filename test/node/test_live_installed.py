# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The package as colcon installs it, brought up by its launch file and by its executable, over real DDS."""

from __future__ import annotations

import importlib.util
import math
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

pytest.importorskip("rclpy")
pytest.importorskip("colcon_core")
pytest.importorskip("colcon_ros")

from live_harness import PACKAGE_ROOT, T0, VEHICLE, Live, Sample, World, environment

from lugre_steering.vehicle import load

PACKAGE = "lugre_steering"
# What `ros2 launch` does with a Python launch file and its arguments.
LAUNCH = """
import sys
from launch import LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

file, *arguments = sys.argv[1:]
pairs = [argument.split(":=", 1) for argument in arguments]
service = LaunchService(noninteractive=True)  # passes SIGINT on: no terminal does it
service.include_launch_description(IncludeLaunchDescription(PythonLaunchDescriptionSource(file), launch_arguments=pairs))
sys.exit(service.run())
"""
HAS_LAUNCH = bool(importlib.util.find_spec("launch") and importlib.util.find_spec("launch_ros"))


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, str]:
    """Environment of a shell that has sourced the workspace."""
    workspace = tmp_path_factory.mktemp("workspace")
    ignored = shutil.ignore_patterns(".*", "*.egg-info", "__pycache__", "build", "bags", "test", "install", "log")
    shutil.copytree(PACKAGE_ROOT, workspace / "src" / PACKAGE, ignore=ignored)
    env = {**environment(), "COLCON_HOME": str(workspace)}
    del env["PYTHONPATH"]  # only what the workspace adds: the installed package, not this source tree
    env["PATH"] = f"{Path(sys.executable).parent}:{env['PATH']}"
    build = [sys.executable, "-m", "colcon", "build", "--packages-select", PACKAGE]
    done = subprocess.run(build, cwd=workspace, env=env, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr
    shell = ["bash", "-c", ". install/local_setup.bash && env -0"]
    sourced = subprocess.run(shell, cwd=workspace, env=env, capture_output=True, text=True, check=True).stdout
    return dict(item.split("=", 1) for item in sourced.split("\0") if item)


def prefix(env: Mapping[str, str]) -> Path:
    """Where ament finds the package."""
    index = Path("share/ament_index/resource_index/packages") / PACKAGE
    prefixes = [Path(path) for path in env["AMENT_PREFIX_PATH"].split(os.pathsep)]
    return next(path for path in prefixes if (path / index).is_file())


def steer_and_stop(node: Live, world: World) -> None:
    """Twenty pairs of angles give twenty torques; SIGINT ends the node with exit code 0."""
    for i in range(20):
        for channel in (0, 1):
            world.send(Sample(channel, T0 + i * 10_000_000, 0.1 * math.sin(0.1 * i)))
    world.wait(lambda: len(world.heard["torque"]) == 20)
    code, _ = node.stop(signal.SIGINT)
    assert code == 0, node.output
    assert "Traceback" not in node.output


@pytest.mark.parametrize(
    "stand_in",
    [
        pytest.param(False, id="launch", marks=pytest.mark.skipif(not HAS_LAUNCH, reason="launch is not installed")),
        pytest.param(True, id="stand-in"),
    ],
)
def test_the_launch_file_brings_the_node_up(stand_in: bool, installed: Mapping[str, str], tmp_path: Path) -> None:
    script = tmp_path / "launcher.py"
    script.write_text("import launch_stand_in\n" * stand_in + LAUNCH)
    env = dict(installed)
    env["PYTHONPATH"] += f"{os.pathsep}{Path(__file__).parent}"  # of the stand-in
    vehicle_file = shutil.copytree(VEHICLE.parent, tmp_path / "my config") / "test_vehicle.yaml"
    file = prefix(installed) / "share" / PACKAGE / "launch" / "estimator.launch.py"
    arguments = (
        f"vehicle_file:={vehicle_file}",
        "namespace:=truck",
        "left_joint_states:=/joints/left",
        "right_joint_states:=/joints/right",
    )
    remaps = {f"steering/{side}/joint_state": f"/joints/{side}" for side in ("left", "right")}
    command = [sys.executable, str(script), str(file), *arguments]
    with Live(command, env) as node, World(load(VEHICLE), namespace="truck", remaps=remaps) as world:
        steer_and_stop(node, world)


@pytest.mark.parametrize(
    "command",
    [
        pytest.param(
            ("ros2", "run", PACKAGE, "estimator"),
            id="ros2 run",
            marks=pytest.mark.skipif(not shutil.which("ros2"), reason="ros2 is not installed"),
        ),
        pytest.param((f"lib/{PACKAGE}/estimator",), id="executable"),  # what ros2 run looks up and executes
    ],
)
def test_the_installed_executable_runs(command: tuple[str, ...], installed: Mapping[str, str]) -> None:
    first, *rest = command
    program = [first if rest else str(prefix(installed) / first), *rest]
    shipped = prefix(installed) / "share" / PACKAGE / "config" / "test_vehicle.yaml"
    arguments = ["--ros-args", "-p", f"vehicle_file:={shipped}"]
    with Live([*program, *arguments], installed) as node, World(load(VEHICLE)) as world:
        steer_and_stop(node, world)
