# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the node: declared with ranges and descriptions, checked at start and at each change, refused with a clear
message."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.parameter import Parameter as Change

from lugre_steering.estimator import Options
from lugre_steering.estimator.node_parameters import (
    BY_ROS,
    NODE_TABLE,
    OPTION_TABLE,
    QOS,
    NodeParameter,
    ParameterError,
)


@dataclass(frozen=True)
class Settings:
    """The node's parameters, checked."""

    vehicle_file: Path
    effects_files: tuple[Path, ...]
    executor: str
    frame_id: str
    input_depth: int
    angle_timeout_s: float
    pressure_timeout_s: float
    publish_commands: bool
    autostart: bool
    when_stale: str
    watch_folder: Path | None
    watch_before_s: float
    state_file: Path | None
    state_period_s: float
    state_max_age_s: float
    options: Options


def _descriptor(parameter: NodeParameter) -> ParameterDescriptor:
    text = f"{parameter.description} ({parameter.expected})"
    descriptor = ParameterDescriptor(description=text, read_only=parameter.fixed)
    if isinstance(parameter.default, float):
        # A declared range is also what makes rclpy refuse .nan and .inf.
        descriptor.floating_point_range = [FloatingPointRange(from_value=parameter.low, to_value=parameter.high)]
    elif isinstance(parameter.default, int) and not isinstance(parameter.default, bool):
        descriptor.integer_range = [IntegerRange(from_value=int(parameter.low), to_value=int(parameter.high), step=1)]
    return descriptor


def _value(node: Node, parameter: NodeParameter) -> Any:
    try:
        return node.declare_parameter(parameter.name, parameter.default, _descriptor(parameter)).value
    except ParameterException as error:
        raise ParameterError(f"parameter '{parameter.name}': {error}; expected {parameter.expected}") from error


def declare(node: Node) -> Settings:
    """Declare every parameter on the node and read it."""
    values = {parameter.name: _value(node, parameter) for parameter in (*NODE_TABLE, *OPTION_TABLE)}
    unknown = sorted(name for name in set(node._parameter_overrides) - {*values, *BY_ROS} if not name.startswith(QOS))
    if unknown:  # not refused: a file may set parameters of several nodes at once
        node.get_logger().warning(f"no such parameter, not used: {', '.join(unknown)}")
    return settings_of(values)


def settings_of(values: Mapping[str, Any]) -> Settings:
    """Settings from the values of all parameters; ``ParameterError`` says which of them cannot be."""
    for parameter in NODE_TABLE:
        if parameter.choices and values[parameter.name] not in parameter.choices:
            raise ParameterError(f"parameter '{parameter.name}': got '{values[parameter.name]}', expected {parameter.expected}")
    given = {parameter.name: values[parameter.name] for parameter in NODE_TABLE}
    if not given["vehicle_file"]:
        raise ParameterError("parameter 'vehicle_file': got nothing, expected a vehicle file (--ros-args -p vehicle_file:=PATH)")
    given["vehicle_file"] = Path(given["vehicle_file"])
    given["effects_files"] = tuple(Path(name) for name in given["effects_files"].split(os.pathsep) if name)
    given["watch_folder"] = Path(given["watch_folder"]) if given["watch_folder"] else None
    if given["watch_folder"] is not None and not _there(given["watch_folder"].is_dir):
        raise ParameterError(f"parameter 'watch_folder': got '{given['watch_folder']}', expected a folder that is there, or nothing")
    given["state_file"] = Path(given["state_file"]) if given["state_file"] else None
    return Settings(**given, options=Options(**{parameter.name: values[parameter.name] for parameter in OPTION_TABLE}))


def undeclared(node: Node) -> list[str]:
    """Names of overrides of quality of service that no topic of the configured node has taken: misspelt ones."""
    return sorted(name for name in node._parameter_overrides if name.startswith(QOS) and not node.has_parameter(name))


def _there(check: Callable[[], bool]) -> bool:
    """What a check of a path says; no for one that cannot be, or that may not be looked at."""
    try:
        return check()
    except OSError:
        return False


def check_files(settings: Settings, names: Collection[str]) -> None:
    """``ParameterError`` if one of the newly named files cannot be what it is to be."""
    if "vehicle_file" in names and not _there(settings.vehicle_file.is_file):
        raise ParameterError(f"parameter 'vehicle_file': got '{settings.vehicle_file}', expected a vehicle file that is there")
    file = settings.state_file
    if "state_file" in names and file is not None:
        irregular = _there(file.exists) and not _there(file.is_file)
        if irregular or not _there(file.parent.is_dir) or not os.access(file.parent, os.W_OK | os.X_OK):
            raise ParameterError(f"parameter 'state_file': got '{file}', expected a file in a folder that can be written, or nothing")


def changed(node: Node, changes: Sequence[Change]) -> Settings:
    """The settings as they would be after some changes; ``ParameterError`` if they cannot be."""
    values = {parameter.name: node.get_parameter(parameter.name).value for parameter in (*NODE_TABLE, *OPTION_TABLE)}
    return settings_of(values | {change.name: change.value for change in changes if change.name in values})
