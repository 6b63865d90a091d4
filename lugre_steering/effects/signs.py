# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""How laws that oppose motion change sign."""

SIGN_RATE_RAD_S = 2e-3
"""Rate at which losses that oppose motion are at 76 % of their level: an odd, smooth sign function."""
