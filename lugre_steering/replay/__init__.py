# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The `replay` command: recorded bags through the estimator, results beside the inputs."""

from lugre_steering.replay.run import describe, replay

__all__ = ["describe", "replay"]
