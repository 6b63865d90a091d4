# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Physics that the baseline leaves out, one file each; ``registry`` finds them, ``own`` reads those of users."""

from lugre_steering.chain.compiled import law
from lugre_steering.effects.entry import Effect, Parameter

__all__ = ["Effect", "Parameter", "law"]
