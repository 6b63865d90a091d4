# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Many tests look at the same simulated runs and the same signals from different sides: what is expensive about them is done once."""

from __future__ import annotations

import hashlib
import pickle
from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from lugre_steering.data import dataset, quality, stamps
from lugre_steering.proof import simulator

KEPT = 64


def remembered(pure: Callable[..., Any]) -> Callable[..., Any]:
    """The function with its last results kept by the content of its arguments, arrays included; nobody may write to a result."""
    kept: OrderedDict[bytes, Any] = OrderedDict()

    def ask(*arguments: Any, **named: Any) -> Any:
        key = hashlib.blake2b(pickle.dumps((arguments, named), protocol=5), digest_size=16).digest()
        if key not in kept:
            kept[key] = pure(*arguments, **named)
            for part in kept[key] if isinstance(kept[key], tuple) else (kept[key],):
                if isinstance(part, np.ndarray):
                    part.flags.writeable = False
        kept.move_to_end(key)
        if len(kept) > KEPT:
            kept.popitem(last=False)
        return kept[key]

    return ask


@contextmanager
def same_signals_once() -> Iterator[None]:
    """What is found out about single signals, and tracks of the second simulator, once: most tests change one channel of one recording."""
    of_signals = (dataset, "smooth_angle"), (dataset, "sensed"), (dataset, "louder"), (stamps, "sampling_grid"), (quality, "_examine")
    with pytest.MonkeyPatch.context() as patch:
        for module, name in (*of_signals, (simulator, "run_track")):
            patch.setattr(module, name, remembered(getattr(module, name)))
        yield
