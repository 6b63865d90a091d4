# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Starts the estimator: ``ros2 launch lugre_steering estimator.launch.py vehicle_file:=/path/to/vehicle.yaml``."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """The node with its parameter file; topics are relative, so ``namespace`` moves them all."""
    config = Path(get_package_share_directory("lugre_steering")) / "config"
    arguments = {
        "vehicle_file": (None, "vehicle file (YAML); required, for the torques of another vehicle look as good"),
        "params_file": (str(config / "estimator_parameters.yaml"), "parameters of the node (YAML)"),
        "namespace": ("", "namespace of the node and its topics"),
        "left_joint_states": ("steering/left/joint_state", "JointState topic of the left angle, where the vehicle file names none"),
        "right_joint_states": ("steering/right/joint_state", "the same of the right angle; may be the same topic"),
        "use_sim_time": ("false", "take the time from /clock; stands above the parameter file"),
    }
    node = Node(
        package="lugre_steering",
        executable="estimator",
        name="steering_torque_estimator",
        namespace=LaunchConfiguration("namespace"),
        output="screen",
        parameters=[
            LaunchConfiguration("params_file"),
            {
                "vehicle_file": ParameterValue(LaunchConfiguration("vehicle_file"), value_type=str),
                "use_sim_time": ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool),
            },
        ],
        remappings=[
            ("steering/left/joint_state", LaunchConfiguration("left_joint_states")),
            ("steering/right/joint_state", LaunchConfiguration("right_joint_states")),
        ],
    )
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in arguments.items()
    ]
    return LaunchDescription([*declared, node])
