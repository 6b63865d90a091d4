# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The `vehicle` command: what a vehicle file amounts to."""
