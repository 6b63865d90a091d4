# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""The published experiments of Liang et al., Defence Technology 18 (2022) 797-810, doi 10.1016/j.dt.2021.03.026."""

from __future__ import annotations

from collections.abc import Callable

from lugre_steering.simulate.paper import conditions, double_cycle, stiffness
from lugre_steering.simulate.paper.bench import Bench
from lugre_steering.simulate.paper.outcome import Outcome

EXPERIMENTS: dict[str, tuple[str, Callable[[Bench], Outcome]]] = {
    "paper-extremes": (
        "double steering cycle: four torque extremes, original and improved LuGre",
        double_cycle.double_cycle,
    ),
    "paper-composition": ("elastic, damping and aligning part of the torque", double_cycle.composition),
    "paper-ambient": ("ambient temperature from -20 to 40 degC", conditions.ambient),
    "paper-rate": ("steering rate from 2 to 10 deg/s", conditions.rate),
    "paper-cycles": ("six cycles at 4 deg/s from 10 degC", conditions.six_cycles),
    "paper-pavements": ("six pavements", conditions.pavement),
    "paper-stiffness": ("slow load below break-away, held: stiffness", stiffness.stiffness),
    "paper-limit-stop": (
        "torque held at the limit stops: a hidden elastic stop shows in the residual",
        double_cycle.limit_stop,
    ),
}
ALL = "paper"
