# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Calibration: baseline parameters of a vehicle fitted to recordings, with intervals and what the data cannot tell."""

from lugre_steering.calibration.calibrate import calibrate_recordings
from lugre_steering.calibration.command import calibrate

__all__ = ["calibrate", "calibrate_recordings"]
