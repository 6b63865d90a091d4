# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Unlisted structure: a short formula over named, unit-carrying variables, and what it gains on held-out data.

Orthogonal matching pursuit over physical terms (Pati, Rezaiifar, Krishnaprasad 1993): honest about its reach, it proposes a
description, never a name.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lugre_steering.recording import Array

MAX_TERMS = 3
PERIODS_DEG = np.arange(1.0, 12.5, 0.25)
CYCLES = np.arange(1.0, 40.5, 0.5)
"""Periods to try: in degrees for a joint, as cycles over the travel for a linear axis, which may be of any size."""
REVERSAL_RAD, REVERSAL_SHARE = 0.05, 0.05
"""Length of the memory after a reversal: for a joint, and as share of the travel of a linear axis."""


@dataclass(frozen=True)
class Formula:
    text: str
    gain: float
    """Share of the held-out residual energy it removes."""


def terms(c: Mapping[str, Array], linear: bool = False) -> dict[str, Array]:
    """Library of candidate terms (n,) with their text, which writes a linear axis as an angle too (``units.law``)."""
    theta, rate, direction = c["steering angle"], c["steering rate"], c["direction"]
    travel = float(np.ptp(theta))
    reversal = float(f"{REVERSAL_SHARE * travel:.2g}") if linear else REVERSAL_RAD
    periods = (
        {f"{period:.4g} rad": period for period in travel / CYCLES}
        if linear
        else {f"{degrees:.2f} deg": float(np.radians(degrees)) for degrees in PERIODS_DEG}
    )
    library = {
        "1": np.ones_like(theta), "theta [rad]": theta, "theta^2 [rad2]": theta**2, "theta^3 [rad3]": theta**3,
        "omega [rad/s]": rate, "omega |omega| [rad2/s2]": rate * np.abs(rate), "sgn(omega)": direction,
        "theta omega [rad2/s]": theta * rate, "theta^2 sgn(omega) [rad2]": theta**2 * direction,
        "alpha [rad/s2]": c["steering acceleration"], "M [N m]": c["torque"], "|M| sgn(omega) [N m]": np.abs(c["torque"]) * direction,
        "dM/dt [N m/s]": c["torque rate"], f"sgn(omega) exp(-angle since reversal / {reversal:g} rad)":
        direction * np.exp(-c["angle since reversal"] / reversal), "log(1 + dwell [s]) M [N m]": np.log1p(c["dwell"]) * c["torque"],
    }  # fmt: skip
    for text, period in periods.items():
        library[f"sin(2 pi theta / {text})"] = np.sin(2 * np.pi * theta / period)
        library[f"cos(2 pi theta / {text})"] = np.cos(2 * np.pi * theta / period)
    for tau in (0.5, 1.0, 2.0, 4.0, 8.0):
        library[f"low-pass({tau:g} s) of omega [rad/s]"] = _low_pass(rate, c["time"], tau)
        library[f"low-pass({tau:g} s) of sgn(omega)"] = _low_pass(direction, c["time"], tau)
    return library


def _low_pass(value: Array, time: Array, tau: float) -> Array:
    """First-order low-pass of (n,) values, each recording (its time [s] starts anew) from rest."""
    from scipy.signal import lfilter

    pieces = []
    for piece in np.split(np.arange(time.size), np.flatnonzero(np.diff(time) <= 0.0) + 1):
        decay = np.exp(-(time[piece[1]] - time[piece[0]]) / tau)
        pieces.append(lfilter([1.0 - decay], [1.0, -decay], value[piece]))
    return np.concatenate(pieces)


def propose(
    coordinates: Mapping[str, Array], residual: Array, fit_weight: Array, held_weight: Array, linear: bool = False
) -> Formula | None:
    """Best formula of up to three terms, each of which must lower the held-out error; None if even one term does not."""
    library = terms(coordinates, linear)
    names = list(library)
    matrix = np.column_stack([library[name] for name in names])
    norms = np.linalg.norm(matrix * fit_weight[:, None], axis=0)
    usable = norms > 1e-9
    target = residual * fit_weight
    held_start = float(np.sum((residual * held_weight) ** 2))
    chosen: list[int] = []
    values: Array = np.zeros(0)
    best_held = held_start
    left: Array = target
    while len(chosen) < MAX_TERMS and held_start > 0.0:
        correlation = np.abs((matrix * fit_weight[:, None]).T @ left) / np.where(usable, norms, np.inf)
        correlation[chosen] = 0.0
        trial = [*chosen, int(np.argmax(correlation))]
        trial_values: Array = np.asarray(
            np.linalg.lstsq(matrix[:, trial] * fit_weight[:, None], target, rcond=None)[0], np.float64
        )
        held = float(np.sum(((residual - matrix[:, trial] @ trial_values) * held_weight) ** 2))
        if held > best_held - 0.02 * held_start:
            break
        chosen, values, best_held = trial, trial_values, held
        left = target - (matrix[:, chosen] * fit_weight[:, None]) @ values
    if not chosen:
        return None
    text = " ".join(f"{value:+.4g} {names[i]}" for value, i in zip(values, chosen, strict=True))
    return Formula(f"torque [N m] = {text}", 1.0 - best_held / held_start)
