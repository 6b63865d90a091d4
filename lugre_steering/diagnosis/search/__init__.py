# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a misfit could be: proposals from the catalogue, their comparison, and the build-up of names."""
