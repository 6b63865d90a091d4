# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Compiled arithmetic shared by the stages, and where compiled code is kept between runs."""

from __future__ import annotations

import hashlib
import math
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

import numba
from llvmlite import ir
from numba import njit as njit  # for all that is compiled and kept: importing it from here arranges where and how
from numba import types
from numba.extending import intrinsic

from lugre_steering.chain.cache import keep_safely


def _keep_compiled_code() -> None:
    """Give Numba a cache folder that changes with any source of the compiled chain.

    Numba looks at the file of the cached function only and would run stale code after an edit of a stage it calls.
    """
    package = Path(__file__).parents[1]
    sources = [file for room in ("chain", "effects", "estimator") for file in sorted((package / room).glob("*.py"))]
    digest = hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:16]
    for folder in _cache_folders():
        try:
            (folder / digest).mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder / digest, os.W_OK | os.X_OK):
            numba.config.CACHE_DIR = str(folder / digest)  # type: ignore[attr-defined]
            return


def _cache_folders() -> Iterator[Path]:
    """Where compiled code may be kept: the user's cache, or without one (a service, a container) the temporary folder."""
    if given := os.environ.get("XDG_CACHE_HOME"):
        yield Path(given) / "lugre_steering"
    with suppress(RuntimeError):  # a user without a home
        yield Path.home() / ".cache" / "lugre_steering"
    shared = Path(tempfile.gettempdir()) / f"lugre_steering-{os.getuid()}"
    with suppress(OSError):
        shared.mkdir(mode=0o700, exist_ok=True)
        if shared.stat().st_uid == os.getuid():  # code that somebody else has put there is never run
            yield shared


if not os.environ.get("NUMBA_CACHE_DIR"):
    _keep_compiled_code()
keep_safely()

_LOG2_E = 1.4426950408889634
_LN2_HIGH = 6.93147180369123816490e-01
_LN2_LOW = 1.90821492927058770002e-10
_ROUND = 6755399441055744.0  # 1.5 * 2**52: adding it leaves round(x) in the low mantissa bits


@intrinsic
def _power_of_two(typing_context: Any, shifted: Any) -> Any:  # noqa: ARG001 (signature fixed by Numba)
    """2**n for the integer n that ``x + 1.5 * 2**52`` carries in its low bits."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
        bits = builder.bitcast(arguments[0], ir.IntType(64))
        exponent = builder.add(bits, ir.Constant(ir.IntType(64), 1023))
        return builder.bitcast(builder.shl(exponent, ir.Constant(ir.IntType(64), 52)), ir.DoubleType())

    return types.float64(types.float64), codegen


_NO_DOORS: Any = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
_UNCOUNTED: Any = {**_NO_DOORS, "_nrt": False}
inner = njit(**_UNCOUNTED)
"""Decorator of what only compiled code calls: without the entrances for Python and C, and without counting who holds an array (so it can
make none), two fifths of the time to compile the estimator."""
Law = TypeVar("Law", bound=Callable[..., Any])
_LAW: Any = {"fastmath": {"contract"}, "error_model": "numpy", "no_cfunc_wrapper": True}
LAW_OPTIONS: Any = {**_LAW, **_NO_DOORS}
"""Those of ``law``, for what is compiled by way of ``overload``."""
IN_PLACE: Any = {**LAW_OPTIONS, "forceinline": True}
"""For what stands alone within a loop: part of it, not called from it (LLVM thinks the step too long for that; a tenth of its time)."""


def law(function: Law) -> Law:
    """Decorator of every law of the chain: fused multiply-adds; divisions without the check that blocks vectorisation.

    The package's own are kept, so that another composition costs its step alone; what those of users call may change unseen.
    """
    ours = (function.__module__ or "").startswith("lugre_steering.")  # what is made of an expression has no module
    return njit(**_LAW, cache=ours)(function)  # type: ignore[no-any-return]


@law
def exp(x: float) -> float:
    """e**x within 3 ulp for -708 < x < 708, clamped outside (0 is never returned; inf never either).

    Cody-Waite reduction and the Taylor polynomial of degree 12 in Estrin's order. The library call costs about four
    times as much here because it can be neither inlined nor vectorised over parameter sets.
    """
    x = -708.0 if x < -708.0 else (708.0 if x > 708.0 else x)
    shifted = x * _LOG2_E + _ROUND
    n = shifted - _ROUND
    r = (x - n * _LN2_HIGH) - n * _LN2_LOW
    r2 = r * r
    r4 = r2 * r2
    low = (1.0 + r) + r2 * (0.5 + r * (1.0 / 6.0))
    mid = (1.0 / 24.0 + r * (1.0 / 120.0)) + r2 * (1.0 / 720.0 + r * (1.0 / 5040.0))
    high = (
        (1.0 / 40320.0 + r * (1.0 / 362880.0))
        + r2 * (1.0 / 3628800.0 + r * (1.0 / 39916800.0))
        + r4 * (1.0 / 479001600.0)
    )
    return (low + r4 * (mid + r4 * high)) * _power_of_two(shifted)  # type: ignore[call-arg]


@law
def tanh(x: float) -> float:
    """Hyperbolic tangent within 3e-16 of one, for the reasons that ``exp`` has."""
    return math.copysign(1.0 - 2.0 / (1.0 + exp(2.0 * abs(x))), x)
