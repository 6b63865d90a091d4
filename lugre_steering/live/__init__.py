# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The live ROS 2 node: messages in, messages out; the physics is in ``lugre_steering.estimator``."""
