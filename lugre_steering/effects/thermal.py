# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Thermal stage: where the friction heat goes."""

from lugre_steering.effects.entry import Effect, Parameter

EFFECTS = (
    Effect(
        "carcass_heat_sink", "thermal", 1, "The tread gives heat to the carcass behind it",
        "C dT/dt = P - ... - k (T - T_b), C_b dT_b/dt = k (T - T_b)",
        "two-node heat balance; Carslaw and Jaeger, Conduction of Heat in Solids (1959)",
        "friction recovers in pauses, the decline bends", "rubber temperature",
        (
            Parameter("conductance", "W/K", "between tread and carcass", 200.0, 0.0, 1e5),
            Parameter("capacity", "J/K", "of the carcass node", 2e4, 5e2, 1e7, (5e3, 2e4, 1e5)),
        ),
        ("heat_partition", "flash_temperature", "wear_polishing"),
    ),
    Effect(
        "flash_temperature", "thermal", 2, "Hot spots at the asperities while sliding",
        "friction reads T + R P / sqrt(1 + P / saturation_power), low-passed with tau",
        "Persson, J. Phys.: Condens. Matter 18 (2006) 7789; Greenwood, Wear 150 (1991) 153",
        "plateaus fall with the power, within a second, and recover at once", "friction power",
        (
            Parameter("resistance", "K/W", "temperature rise per friction power of one track", 1e-3, 0.0, 0.1),
            Parameter("time_constant", "s", "of the flash", 0.5, 0.05, 20.0, (0.3, 3.0)),
            Parameter("saturation_power", "W", "power beyond which it grows with the root (large Peclet number)", 500.0, 10.0, 1e7,
                      (100.0, 1e5)),
        ),
        ("carcass_heat_sink", "wear_polishing"),
    ),
    Effect(
        "heat_partition", "thermal", 1, "Part of the friction heat enters the ground",
        "power into the rubber = (1 - ground_share) P",
        "Carslaw and Jaeger 1959 (effusivities); Liang et al. 2022 assume zero",
        "slope of the decline per work; exactly that of a larger heat capacity with larger cooling", "accumulated work",
        (Parameter("ground_share", "1", "share of the friction power that the ground takes", 0.2, 0.0, 0.95),),
        ("carcass_heat_sink",),
    ),
    Effect(
        "ambient_drift", "thermal", 2, "The air warms or cools during the recording",
        "T_air = T_air0 + rate t", "test conditions", "slow change of the level with time", "time",
        (Parameter("rate", "K/s", "of the air temperature", 0.05, -1.0, 1.0),),
        ("carcass_heat_sink",),
    ),
)  # fmt: skip
