# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Whether pictures can be drawn here, known without importing what draws them."""

from __future__ import annotations

import importlib.util


def no_pictures() -> str | None:
    """Why a command writes no picture, as one line for the user; None where it can."""
    if importlib.util.find_spec("matplotlib") is not None:
        return None
    return "no picture: matplotlib is not installed (pip install 'lugre_steering[report]')"
