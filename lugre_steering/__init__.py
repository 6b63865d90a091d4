# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Static steering torque of rubber-tracked vehicles: estimate it, and find the physics that the model leaves out."""

__version__ = "0.1.0"
