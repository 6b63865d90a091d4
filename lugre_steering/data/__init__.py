# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""From recordings to prepared runs: faults, wiring, motion, disturbances."""
