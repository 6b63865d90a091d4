# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The shipped SROS 2 policy against the topics and services of the running node; and no node without the security asked for."""

from __future__ import annotations

import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from live_harness import NAME, PACKAGE_ROOT, START_TIMEOUT_S, VEHICLE, LiveNode, World, environment

POLICY = PACKAGE_ROOT / "config" / "sros2_policy.xml"


def allowed(tag: str, way: str) -> set[str]:
    """Full names that the policy allows the node."""
    profile = ET.parse(POLICY).getroot().find(".//profile")
    assert profile is not None
    found = [item.text or "" for group in profile.findall(tag) if group.get(way) == "ALLOW" for item in group]
    return {name.replace("~", NAME) for name in found}


def test_the_policy_allows_what_the_node_does_and_no_more() -> None:
    with LiveNode("-p", "publish_commands:=true", "-p", "use_sim_time:=true") as _, World() as world:
        node, own = world.node, (NAME[1:], "/")
        world.wait(lambda: bool(world.heard["diagnostics"]))

        def seen() -> list[set[str]]:  # the graph becomes known piece by piece
            asked = (
                node.get_publisher_names_and_types_by_node, node.get_subscriber_names_and_types_by_node,
                node.get_service_names_and_types_by_node,
            )  # fmt: skip
            return [{name for name, _ in ask(*own)} for ask in asked]

        wanted = [allowed("topics", "publish"), allowed("topics", "subscribe"), allowed("services", "reply")]
        world.wait(lambda: all(now >= all_of for now, all_of in zip(seen(), wanted, strict=True)))
        assert seen() == wanted


def test_a_node_that_is_told_to_be_secure_does_not_run_in_the_open(tmp_path: Path) -> None:
    """An enclave without keys, where the middleware has security plugins; any enclave where it has none, as that of the Python wheels."""
    (tmp_path / "enclaves" / NAME[1:]).mkdir(parents=True)
    secure = {"ROS_SECURITY_KEYSTORE": str(tmp_path), "ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": "Enforce"}
    arguments = ["-p", f"vehicle_file:={VEHICLE}", "--enclave", NAME]
    command = [sys.executable, "-m", "lugre_steering.node", "--ros-args", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=START_TIMEOUT_S, env=environment() | secure, check=False)
    assert done.returncode == 2
    assert "ready" not in done.stderr
    assert "ecurity" in done.stderr
