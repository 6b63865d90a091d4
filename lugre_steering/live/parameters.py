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

from lugre_steering.errors import LugreSteeringError
from lugre_steering.estimator import Options

EXECUTORS = ("events", "single")
_OPTIONS = Options()


class ParameterError(LugreSteeringError):
    """A node parameter has a value that it cannot have."""


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


@dataclass(frozen=True)
class _Parameter:
    name: str
    default: bool | int | float | str
    description: str
    low: float = 0.0
    high: float = 0.0
    choices: tuple[str, ...] = ()

    @property
    def expected(self) -> str:
        if self.choices:
            return f"one of {', '.join(self.choices)}"
        if isinstance(self.default, (bool, str)):
            return "true or false" if isinstance(self.default, bool) else "a text"
        if isinstance(self.default, int):
            return f"a whole number from {self.low:g} to {self.high:g}"
        return f"a number with a decimal point from {self.low:g} to {self.high:g}"

    def descriptor(self) -> ParameterDescriptor:
        text = f"{self.description} ({self.expected})"
        descriptor = ParameterDescriptor(description=text, read_only=True)
        if isinstance(self.default, float):
            # A declared range is also what makes rclpy refuse .nan and .inf.
            descriptor.floating_point_range = [FloatingPointRange(from_value=self.low, to_value=self.high)]
        elif isinstance(self.default, int) and not isinstance(self.default, bool):
            descriptor.integer_range = [IntegerRange(from_value=int(self.low), to_value=int(self.high), step=1)]
        return descriptor

    def declare(self, node: Node) -> Any:
        try:
            value = node.declare_parameter(self.name, self.default, self.descriptor()).value
        except ParameterException as error:
            raise ParameterError(f"parameter '{self.name}': {error}; expected {self.expected}") from error
        if self.choices and value not in self.choices:
            raise ParameterError(f"parameter '{self.name}': got '{value}', expected {self.expected}")
        return value


_TABLE = (
    _Parameter("vehicle_file", "", "vehicle file (YAML); required"),
    _Parameter(
        "executor",
        "events",
        "rclpy executor; only events keeps the order of arrival across topics under load",
        choices=EXECUTORS,
    ),
    _Parameter("frame_id", "base_link", "frame of the published torques (z up)"),
    _Parameter("input_depth", 200, "queue depth of each input subscription", 1, 10_000),
    _Parameter("angle_timeout_s", 0.2, "an angle this old is stale: ERROR, no feed-forward commands [s]", 0.005, 60.0),
    _Parameter("pressure_timeout_s", 0.5, "a pressure or torque sensor silent for this long is stale [s]", 0.005, 60.0),
    _Parameter("recovery_ramp_s", 1.0, "feed-forward commands are ramped over this time after an interruption [s]", 0.0, 60.0),
    _Parameter("publish_commands", False, "publish ~/feed_forward/commands (Float64MultiArray)"),
)
_OPTION_TABLE = (
    _Parameter(
        "pair_tolerance_s", _OPTIONS.pair_tolerance_s, "left and right stamps this close are one instant [s]", 0.0, 1.0
    ),
    _Parameter("max_gap_s", _OPTIONS.max_gap_s, "pressures are not interpolated across a longer gap [s]", 0.001, 60.0),
    _Parameter(
        "backward_jump_s",
        _OPTIONS.backward_jump_s,
        "a confirmed jump of all angles back in time this long is a restart [s]",
        0.1,
        1e6,
    ),
    _Parameter("forward_jump_s", _OPTIONS.forward_jump_s, "a jump ahead this long must be confirmed [s]", 0.1, 1e6),
    _Parameter("max_rate_rad_s", _OPTIONS.max_rate_rad_s, "a faster change of an angle is a spike [rad/s]", 0.01, 1e3),
    _Parameter(
        "feed_forward_horizon_s",
        _OPTIONS.feed_forward_horizon_s,
        "the feed-forward is the torque needed this far ahead, along steering/command if it comes [s]",
        0.0,
        5.0,
    ),
)


def declare(node: Node) -> Settings:
    """Declare every parameter on the node and read it."""
    values = {parameter.name: parameter.declare(node) for parameter in _TABLE}
    options = {parameter.name: parameter.declare(node) for parameter in _OPTION_TABLE}
    unknown = sorted(
        set(node._parameter_overrides) - {*values, *options, "use_sim_time", "start_type_description_service"}
    )
    if unknown:  # not refused: a file may set parameters of several nodes at once
        node.get_logger().warning(f"no such parameter, not used: {', '.join(unknown)}")
    if not values["vehicle_file"]:
        raise ParameterError("parameter 'vehicle_file': got nothing, expected a vehicle file (-p vehicle_file:=PATH)")
    values["vehicle_file"] = Path(values["vehicle_file"])
    return Settings(**values, options=Options(**options))
