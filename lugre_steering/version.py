# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The version, one place for package, command line and results."""

__version__ = "0.1.0"
