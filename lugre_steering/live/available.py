# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Whether ROS is here, known without importing it."""

from __future__ import annotations

import importlib.util

from lugre_steering.errors import LugreSteeringError


def need_ros(command: str) -> None:
    """Say what to install where a command cannot do without ROS."""
    if importlib.util.find_spec("rclpy") is None:
        raise LugreSteeringError(
            f"{command}: needs ROS 2 (source its setup file, or without an installation: pip install 'lugre_steering[ros]')"
        )
