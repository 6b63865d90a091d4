# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The core and the place of one message as a single object of compiled code.

Handing the arrays of the core to compiled code one by one takes longer than the message that is pushed into them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import types
from numba.experimental import structref

from lugre_steering.chain.compiled import njit
from lugre_steering.chain.step import Records
from lugre_steering.estimator.layout import Core
from lugre_steering.recording import Array, IntArray


class Single(NamedTuple):
    """One message, and room for what comes of it."""

    channel: IntArray
    stamp_ns: IntArray
    value: Array
    rate: Array
    estimates: Records
    residuals: Records


@structref.register
class HeldType(types.StructRef):
    """Type of ``Held`` in compiled code."""


class Held(structref.StructRefProxy):
    """``core`` and ``single``, to be read by compiled code alone; it shares their memory."""


structref.define_proxy(Held, HeldType, ["core", "single"])


@njit(cache=True)
def _hold(core, single):
    return Held(core, single)


def hold(core: Core, estimates: Records, residuals: Records) -> Held:
    """``core`` with the place of one message, whose results are written to ``estimates`` and ``residuals``."""
    single = Single(np.empty(1, np.int64), np.empty(1, np.int64), np.empty(1), np.empty(1), estimates, residuals)
    held: Held = _hold(core, single)
    return held
