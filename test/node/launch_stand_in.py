# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Where ROS 2 launch is not installed: the few classes that the launch file uses, doing with them what launch does.

Arguments replace defaults, unknown ones are refused; the executable comes from ``lib/<package>`` of the ament prefix;
parameter dictionaries become a file. The command line is the one of launch_ros (``launch_ros/actions/node.py``).
Importing this module registers it under the names of the real ones.
"""

from __future__ import annotations

import runpy
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from ament_index_python.packages import get_package_prefix

Values = Mapping[str, str]


class LaunchConfiguration(NamedTuple):
    name: str


class ParameterValue(NamedTuple):
    value: Any
    value_type: type


class DeclareLaunchArgument(NamedTuple):
    name: str
    default_value: str
    description: str


class LaunchDescription(NamedTuple):
    entities: Sequence[Any]


class PythonLaunchDescriptionSource(NamedTuple):
    path: str


class IncludeLaunchDescription(NamedTuple):
    source: PythonLaunchDescriptionSource
    launch_arguments: Sequence[Sequence[str]]


def _text(values: Values, item: Any) -> str:
    return values[item.name] if isinstance(item, LaunchConfiguration) else str(item)


def _parameter(values: Values, item: Any) -> Any:
    text = _text(values, item.value)
    value = text if item.value_type is str else yaml.safe_load(text)
    assert isinstance(value, item.value_type), f"{text} is no {item.value_type.__name__}"
    return value


class Node:
    def __init__(
        self,
        *,
        package: str,
        executable: str,
        name: str,
        namespace: Any,
        output: str,
        parameters: Sequence[Any],
        remappings: Sequence[tuple[Any, Any]],
    ) -> None:
        assert output in ("screen", "log", "both", "own_log", "full")
        self._package, self._executable, self._name, self._namespace = package, executable, name, namespace
        self._parameters, self._remappings = parameters, remappings

    def command(self, values: Values) -> list[str]:
        """The command line under given launch arguments."""
        executable = Path(get_package_prefix(self._package)) / "lib" / self._package / self._executable
        namespace = "/" + _text(values, self._namespace).lstrip("/")
        command = [str(executable), "--ros-args", "-r", f"__node:={self._name}", "-r", f"__ns:={namespace}"]
        for item in self._parameters:
            if isinstance(item, dict):
                named = {name: _parameter(values, value) for name, value in item.items()}
                file = Path(tempfile.mkstemp(prefix="launch_params_")[1])
                file.write_text(yaml.safe_dump({f"{namespace.rstrip('/')}/{self._name}": {"ros__parameters": named}}))
                command += ["--params-file", str(file)]
            else:
                command += ["--params-file", _text(values, item)]
        for source, target in self._remappings:
            command += ["-r", f"{_text(values, source)}:={_text(values, target)}"]
        return command


class LaunchService:
    def __init__(self, *, noninteractive: bool) -> None:
        assert noninteractive  # signals come to this process only

    def include_launch_description(self, included: IncludeLaunchDescription) -> None:
        """Read the launch file and settle its arguments."""
        entities = runpy.run_path(included.source.path)["generate_launch_description"]().entities
        values = {item.name: item.default_value for item in entities if isinstance(item, DeclareLaunchArgument)}
        given = dict(included.launch_arguments)
        assert given.keys() <= values.keys(), f"undeclared: {given.keys() - values.keys()}"
        self._commands = [item.command({**values, **given}) for item in entities if isinstance(item, Node)]

    def run(self) -> int:
        """Run the only node until it ends; a signal is passed on."""
        (command,) = self._commands
        process = subprocess.Popen(command)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda number, _: process.send_signal(number))
        return process.wait()


for _name in (
    "launch",
    "launch.actions",
    "launch.launch_description_sources",
    "launch.substitutions",
    "launch_ros",
    "launch_ros.actions",
    "launch_ros.parameter_descriptions",
):
    sys.modules[_name] = sys.modules[__name__]
