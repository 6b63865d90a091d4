# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What the node's parameters are: names, defaults, ranges and meanings; and a parameter file's options, read without ROS."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from pathlib import Path

from lugre_steering.errors import LugreSteeringError
from lugre_steering.estimator import Options
from lugre_steering.recording import NODE
from lugre_steering.schema import Reader

EXECUTORS = ("events", "single")
WHEN_STALE = ("silent", "zero")
BY_ROS = ("use_sim_time", "start_type_description_service")
"""Parameters that rclpy declares on every node."""
QOS = "qos_overrides."
"""Begin of the names of those that it declares for each topic."""


class ParameterError(LugreSteeringError):
    """A node parameter, or a file of them, has a value that it cannot have."""


@dataclass(frozen=True)
class NodeParameter:
    """One parameter of the node."""

    name: str
    default: bool | int | float | str
    description: str
    low: float = 0.0
    high: float = 0.0
    choices: tuple[str, ...] = ()
    fixed: bool = False
    """Read at start only."""

    @property
    def expected(self) -> str:
        if self.choices:
            return f"one of {', '.join(self.choices)}"
        if isinstance(self.default, (bool, str)):
            return "true or false" if isinstance(self.default, bool) else "a text"
        if isinstance(self.default, int):
            return f"a whole number from {self.low:g} to {self.high:g}"
        return f"a number with a decimal point from {self.low:g} to {self.high:g}"


NODE_TABLE = (
    NodeParameter("vehicle_file", "", "vehicle file (YAML); required. A change is taken over by the service ~/reload"),
    NodeParameter("effects_files", "", "files with physics of your own (.yaml or .py), separated by ':'", fixed=True),
    NodeParameter("autostart", True, "configure and activate the node at start; false leaves that to a lifecycle manager", fixed=True),
    NodeParameter(
        "executor",
        "events",
        "rclpy executor; only events keeps the order of arrival across topics under load",
        choices=EXECUTORS,
        fixed=True,
    ),
    NodeParameter("frame_id", "base_link", "frame of the published torques (z up)", fixed=True),
    NodeParameter("input_depth", 200, "queue depth of each input subscription", 1, 10_000, fixed=True),
    NodeParameter("angle_timeout_s", 0.15, "an angle this old is stale: ERROR, no feed-forward commands [s]", 0.005, 60.0),
    NodeParameter("pressure_timeout_s", 0.15, "a pressure or torque sensor silent for this long is stale [s]", 0.005, 60.0),
    NodeParameter("publish_commands", False, "publish ~/feed_forward/commands (Float64MultiArray)", fixed=True),
    NodeParameter(
        "when_stale",
        "silent",
        "the feed-forward when inputs are stale: silent at once, or led to zero over withdrawal_ramp_s and then silent",
        choices=WHEN_STALE,
    ),
    NodeParameter("watch_folder", "", "folder for windows in which the model did not match (and ~/mark); empty: none", fixed=True),
    NodeParameter("watch_before_s", 120.0, "such a window begins so long before [s]", 1.0, 3600.0),
    NodeParameter("state_file", "", "file in which temperatures and bristles survive a restart; empty: they do not"),
    NodeParameter("state_period_s", 10.0, "time between two writings of state_file [s]", 0.1, 3600.0),
    NodeParameter("state_max_age_s", 86400.0, "an older state_file is not used [s]", 0.0, 1e8),
)
_MEANINGS = {
    "pair_tolerance_s": "left and right stamps this close, or by half a sampling period up to 50 ms, are one instant [s]",
    "max_gap_s": "pressures are not interpolated across a longer gap [s]",
    "backward_jump_s": "a confirmed jump of all angles back in time this long is a new beginning, with the heat and memories so far [s]",
    "forward_jump_s": "a jump ahead this long must be confirmed [s]",
    "max_rate_rad_s": "a faster change of an angle is a spike [rad/s]; 0: 10 of tracks and axes, 100 of a joint",
    "feed_forward_limit_Nm": "largest feed-forward of each side [N m]; 0: three times the friction of its file",
    "feed_forward_rate_limit_Nm_s": "fastest change of the feed-forward [N m/s]; 0: what its presliding stiffness makes of 1 rad/s",
    "withdrawal_ramp_s": "the feed-forward goes to zero over this time when anything speaks against it [s]",
    "recovery_ramp_s": "and comes back over this time, as commands do after silence [s]",
    "plan_tolerance_rad": "a steering/command farther than this from the present angle is refused [rad]",
    "side_tolerance_rad": "left and right angle contradict if they are farther than this from parallel and from the axle's geometry [rad]",
    "feed_forward_horizon_s": "the feed-forward is the torque needed this far ahead, along steering/command if it comes [s]",
}
OPTION_TABLE = tuple(
    NodeParameter(item.name, getattr(Options(), item.name), _MEANINGS[item.name], item.metadata["low"], item.metadata["high"])
    for item in fields(Options)
)


def read_options(file: Path) -> Options:
    """The estimator's options in a parameter file of the node, as ``ros2 run ... --params-file`` would set them.

    Sections of other nodes, and what concerns the node alone, are left aside. ``ParameterError`` if no section is the
    node's, or several are: which of them was in force, the namespace of the node decided.
    """
    reader = Reader(file, ParameterError)
    content = reader.load()
    sections = dict(_sections("", content)) if isinstance(content, Mapping) else {}
    named = [key for key in sections if key.split("/")[-1] == NODE]
    own = [key for key in sections if key in named or key == "/**"]
    if not own:
        raise reader.fail("(top level)", ", ".join(sections) or content, f"a section '/**' or '{NODE}'")
    if len(named) > 1:
        raise reader.fail("(top level)", len(named), f"one section of the node '{NODE}', not {' and '.join(named)}")
    names = {parameter.name for parameter in OPTION_TABLE}
    others = {parameter.name for parameter in NODE_TABLE} | set(BY_ROS)
    values: dict[str, object] = {}
    for key in own:
        section = sections[key]
        given = section.get("ros__parameters") if isinstance(section, Mapping) else None
        if not isinstance(given, Mapping):
            raise reader.fail(key, section, "a mapping 'ros__parameters' in it")
        # Under /** a file may set parameters of several nodes at once.
        kept = {k: v for k, v in given.items() if k in names or (key != "/**" and k not in others)}
        reader.build(Options, kept, f"{key}.ros__parameters")
        values |= kept
    return reader.build(Options, values, "ros__parameters")


def _sections(prefix: str, content: Mapping[object, object]) -> Iterator[tuple[str, object]]:
    """Name and content of the sections; a namespace may be a key of its own, with the sections of its nodes in it."""
    for key, section in content.items():
        name = prefix + str(key)
        inside = section if isinstance(section, Mapping) and "ros__parameters" not in section else {}
        if inside and (str(key).split("/")[-1] != NODE or NODE in inside) and all(isinstance(inner, Mapping) for inner in inside.values()):
            yield from _sections(f"{name}/", inside)
        else:
            yield name, section
