# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""From a finished search to the result: what stands, where it acts, what is left, limits, advice."""
