# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of the node: declared with ranges and descriptions, read once at start, refused with a clear message."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import ParameterException
from rclpy.node import Node

from lugre_steering.estimator import Options
from lugre_steering.live.table import BY_ROS, OPTION_TABLE, TABLE, Parameter, ParameterError


@dataclass(frozen=True)
class Settings:
    """The node's parameters, checked."""

    vehicle_file: Path
    executor: str
    frame_id: str
    input_depth: int
    angle_timeout_s: float
    pressure_timeout_s: float
    recovery_ramp_s: float
    publish_commands: bool
    options: Options


def _descriptor(parameter: Parameter) -> ParameterDescriptor:
    text = f"{parameter.description} ({parameter.expected})"
    descriptor = ParameterDescriptor(description=text, read_only=True)
    if isinstance(parameter.default, float):
        # A declared range is also what makes rclpy refuse .nan and .inf.
        descriptor.floating_point_range = [FloatingPointRange(from_value=parameter.low, to_value=parameter.high)]
    elif isinstance(parameter.default, int) and not isinstance(parameter.default, bool):
        descriptor.integer_range = [IntegerRange(from_value=int(parameter.low), to_value=int(parameter.high), step=1)]
    return descriptor


def _value(node: Node, parameter: Parameter) -> Any:
    try:
        value = node.declare_parameter(parameter.name, parameter.default, _descriptor(parameter)).value
    except ParameterException as error:
        raise ParameterError(f"parameter '{parameter.name}': {error}; expected {parameter.expected}") from error
    if parameter.choices and value not in parameter.choices:
        raise ParameterError(f"parameter '{parameter.name}': got '{value}', expected {parameter.expected}")
    return value


def declare(node: Node) -> Settings:
    """Declare every parameter on the node and read it."""
    values = {parameter.name: _value(node, parameter) for parameter in TABLE}
    options = {parameter.name: _value(node, parameter) for parameter in OPTION_TABLE}
    unknown = sorted(set(node._parameter_overrides) - {*values, *options, *BY_ROS})
    if unknown:  # not refused: a file may set parameters of several nodes at once
        node.get_logger().warning(f"no such parameter, not used: {', '.join(unknown)}")
    if not values["vehicle_file"]:
        raise ParameterError("parameter 'vehicle_file': got nothing, expected a vehicle file (--ros-args -p vehicle_file:=PATH)")
    values["vehicle_file"] = Path(values["vehicle_file"])
    return Settings(**values, options=Options(**options))
