# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""From one MCAP message record to the next, compiled: a file may hold tens of millions of them, sound or made to hold up."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lugre_steering.bag.mcap_records import MESSAGE, MESSAGE_HEAD, RECORD
from lugre_steering.chain.compiled import njit
from lugre_steering.recording import IntArray

_HEAD, _LEAST = RECORD.size, MESSAGE_HEAD.size
LEAST_BYTES = _HEAD + _LEAST


@njit(cache=True)
def walk(raw: NDArray[np.uint8], at: int, starts: IntArray, count: int) -> tuple[int, int]:
    """Write into ``starts``, behind the first ``count``, where the message records begin that follow on each other from byte ``at``.

    As many as there is room for; returns how many there are now, and where the last ends.
    """
    while count < starts.size and at + _HEAD <= raw.size and raw[at] == MESSAGE:
        size = np.int64(0)
        for byte in range(_HEAD - 1, 0, -1):
            size = size << 8 | np.int64(raw[at + byte])
        if not _LEAST <= size <= raw.size - at - _HEAD:
            break
        starts[count] = at
        count += 1
        at += _HEAD + int(size)
    return count, at
