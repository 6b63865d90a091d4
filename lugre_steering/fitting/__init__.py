# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The model against the data: prediction, noise, least squares, candidates on trial, and back to the vehicle file."""
