# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Start, refusal and stop of the node's process."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

pytest.importorskip("rclpy")

from live_harness import (
    FRESH,
    PACKAGE_ROOT,
    PATIENCE_S,
    START_TIMEOUT_S,
    STOP_S,
    VEHICLE,
    Forked,
    LiveNode,
    World,
    environment,
)
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, GetParameters, SetParameters

from lugre_steering.estimator.node_parameters import NODE_TABLE, OPTION_TABLE

FIXED = {"autostart", "effects_files", "executor", "frame_id", "input_depth", "publish_commands", "watch_folder"}
CONFIG = PACKAGE_ROOT / "config" / "estimator_parameters.yaml"


def start_refused(folder: Path, *ros_args: str, fresh: bool = False) -> str:
    """What a node says that does not start; ``fresh``: in an interpreter of its own."""
    if fresh:
        command = [sys.executable, *FRESH, "--ros-args", *ros_args]
        done = subprocess.run(command, capture_output=True, text=True, timeout=START_TIMEOUT_S, env=environment(), check=False)
        code, said = done.returncode, done.stderr
    else:
        (log := folder / "node.log").write_text("")
        code = Forked(["estimator", "--ros-args", *ros_args], log, environment()).wait(START_TIMEOUT_S)
        said = log.read_text()
    assert code == 2, said
    lines = [line for line in said.splitlines() if not line.startswith(("[ERROR]", "[INFO]"))]  # of the log
    assert len(lines) == 1, said
    assert lines[0].startswith("estimator: ")
    return lines[0]


@pytest.mark.parametrize(
    ("argument", "said"),
    [
        ("max_gap_s:=.nan", ("max_gap_s", "nan", "0.001 to 60")),
        ("max_gap_s:=1", ("max_gap_s", "1", "decimal point")),
        ("executor:=multi", ("executor", "multi", "events, single")),
        ("use_sim_time:=3", ("use_sim_time", "3", "BOOL")),
        ("watch_folder:=/nowhere", ("watch_folder", "/nowhere", "a folder that is there")),
    ],
)
def test_bad_parameters_are_refused(tmp_path: Path, argument: str, said: tuple[str, ...]) -> None:
    message = start_refused(tmp_path, "-p", f"vehicle_file:={VEHICLE}", "-p", argument)
    assert all(text in message for text in said), message


BROKEN_EXECUTOR = """
import sys
from lugre_steering.live import run

class Broken:
    add_node = lambda self, node: None
    shutdown = lambda self: None
    def spin_until_future_complete(self, *_, **__):
        raise RuntimeError("the middleware is gone")

run._BREATH_S = 0.001
run.make_executor = lambda kind: Broken()
sys.exit(run.run(sys.argv))
"""


def test_a_middleware_that_only_fails_ends_the_node(tmp_path: Path) -> None:
    """A supervisor must learn of it; the executor is the one thing that is not real here."""
    (tmp_path / "broken.py").write_text(BROKEN_EXECUTOR)
    command = [sys.executable, str(tmp_path / "broken.py"), "--ros-args", "-p", f"vehicle_file:={VEHICLE}"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=START_TIMEOUT_S, env=environment(), check=False)
    assert done.returncode == 2
    assert "estimator: no callback runs any more" in done.stderr
    assert "the middleware is gone" in done.stderr


def test_bad_vehicle_files_are_refused(tmp_path: Path) -> None:
    assert "vehicle_file" in start_refused(tmp_path, fresh=True)
    missing = tmp_path / "none.yaml"
    assert str(missing) in start_refused(tmp_path, "-p", f"vehicle_file:={missing}")
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text(VEHICLE.read_text().replace("width_m: 0.45", "width_m: -0.45"))
    wrong.with_name("rubber_dma_10hz.csv").write_text(VEHICLE.with_name("rubber_dma_10hz.csv").read_text())
    message = start_refused(tmp_path, "-p", f"vehicle_file:={wrong}")
    assert all(text in message for text in (str(wrong), "track.width_m", "-0.45"))
    wrong.write_text(VEHICLE.read_text() + 'topics: {left: "steering/left angle"}\n')
    assert "topic" in start_refused(tmp_path, "-p", f"vehicle_file:={wrong}")


@pytest.mark.parametrize(
    ("executor", "number"), [("events", signal.SIGINT), ("events", signal.SIGTERM), ("single", signal.SIGTERM)]
)
def test_stops_cleanly(executor: str, number: int) -> None:
    with LiveNode("-p", f"executor:={executor}", command=FRESH) as node:
        code, seconds = node.stop(number)
        assert code == 0, node.output
        assert seconds < STOP_S
        assert "Traceback" not in node.output


def test_parameters_are_described_and_ranged() -> None:
    shipped = yaml.safe_load(CONFIG.read_text())["/**"]["ros__parameters"]
    with LiveNode("--params-file", str(CONFIG), "-p", "no_such:=1") as node, World() as world:
        assert "no_such" in node.output

        def call(service: type, name: str, request: object) -> object:
            client = world.node.create_client(service, f"/steering_torque_estimator/{name}")
            assert client.wait_for_service(PATIENCE_S)
            future = client.call_async(request)
            world.wait(future.done)
            return future.result()

        names = [*shipped, "vehicle_file"]
        described = call(DescribeParameters, "describe_parameters", DescribeParameters.Request(names=names))
        for name, item in zip(names, described.descriptors, strict=True):
            assert item.description
            assert item.read_only == (name in FIXED)
            if item.type == ParameterType.PARAMETER_DOUBLE:
                bounds = item.floating_point_range[0]
                assert bounds.from_value <= shipped[name] <= bounds.to_value
            if item.type == ParameterType.PARAMETER_INTEGER:
                assert item.integer_range[0].from_value <= shipped[name] <= item.integer_range[0].to_value
        got = call(GetParameters, "get_parameters", GetParameters.Request(names=["max_gap_s"]))
        assert got.values[0].double_value == shipped["max_gap_s"]
        for wanted, accepted in ((0.5, True), (500.0, False)):
            value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=wanted)
            request = SetParameters.Request(parameters=[Parameter(name="max_gap_s", value=value)])
            assert call(SetParameters, "set_parameters", request).results[0].successful == accepted


def test_the_shipped_parameters_are_the_defaults() -> None:
    shipped = yaml.safe_load(CONFIG.read_text())["/**"]["ros__parameters"]
    declared = {p.name: p.default for p in (*NODE_TABLE, *OPTION_TABLE) if p.name != "vehicle_file"}
    assert shipped == declared


def test_the_node_imports_no_plotting_bags_or_command_line() -> None:
    code = (
        "import sys, lugre_steering.node, lugre_steering.live.run\n"
        "heavy = {'matplotlib', 'plotly', 'rosbags', 'pandas', 'typer', 'rich', 'scipy.stats', 'scipy.interpolate', 'scipy.optimize'}\n"
        "print(','.join(sorted(heavy & set(sys.modules))))"
    )
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, timeout=START_TIMEOUT_S, env=environment(), check=True)
    assert done.stdout.strip() == ""
