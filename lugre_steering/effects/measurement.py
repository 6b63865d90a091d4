# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Hydraulics and sensors: between the torque on the steering axis and the recorded pressures."""

from lugre_steering.effects.entry import Effect, Parameter

EFFECTS = (
    Effect(
        "cylinder_friction", "measurement", 1, "Friction of cylinder seals and steering joints",
        "M = (coulomb + load_share |M|) (holding seal(theta) + (1 - holding) sgn(omega)) (1 + breakaway ...) + viscous omega",
        "Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30 (1994) 1083", "step at each reversal, grows with pressure",
        "direction",
        (
            Parameter("coulomb", "N m", "of the vehicle, direction dependent", 300.0, -1e3, 3e4),
            Parameter("load_share", "1", "share of the torque", 0.01, -0.05, 0.4),
            Parameter("viscous", "N m s/rad", "of one track", 1e3, 0.0, 2e5, optional=True),
            Parameter("holding", "1", "share kept at standstill by the seals", 0.5, 0.0, 1.0, (0.0, 1.0)),
            Parameter("breakaway", "1", "raise at low rate (Stribeck)", 0.3, 0.0, 3.0, optional=True),
            Parameter("rate_scale", "rad/s", "rate over which the sign changes", 0.01, 0.0, 0.05, optional=True),
        ),
        ("back_pressure", "line_loss_linear"),
    ),
    Effect(
        "line_loss_linear", "measurement", 1, "Laminar pressure loss in the lines",
        "M = b omega", "Hagen-Poiseuille; Merritt 1967", "odd in the rate, zero at rest", "steering rate",
        (Parameter("b", "N m s/rad", "of one track", 5e3, 0.0, 5e5),), ("viscous_friction",),
    ),
    Effect(
        "line_loss_quadratic", "measurement", 1, "Turbulent or orifice loss in lines and valves",
        "M = c omega |omega|", "Merritt, Hydraulic Control Systems (1967)", "odd and quadratic in the rate, zero at rest",
        "steering rate", (Parameter("c", "N m s2/rad2", "of one track", 5e4, 0.0, 1e7),), ("viscous_friction", "line_loss_linear"),
    ),
    Effect(
        "back_pressure", "measurement", 2, "Back pressure of the return line",
        "M = torque (1 + flow |omega|) sgn(omega)", "Merritt 1967", "opposes motion, vanishes at rest", "direction",
        (
            Parameter("torque", "N m", "of the vehicle", 300.0, 0.0, 2e4),
            Parameter("flow", "s/rad", "growth with the return flow", 3.0, 0.0, 100.0, optional=True),
            Parameter("rate_scale", "rad/s", "rate over which the sign changes", 0.01, 0.0, 0.05, optional=True),
        ),
        ("cylinder_friction",),
    ),
    Effect(
        "relief_saturation", "measurement", 2, "Relief valve limits the torque",
        "|M| <= ceiling (1 + arm_slope u + arm_curvature u^2), u = theta sgn(M)", "Merritt 1967", "a torque ceiling", "torque",
        (
            Parameter("ceiling", "N m", "of the vehicle", 1e3, 1e3, 1e7),
            Parameter("arm_slope", "1/rad", "of the cylinder arms toward the push", 0.05, -2.0, 2.0, optional=True),
            Parameter("arm_curvature", "1/rad^2", "of the cylinder arms", 0.1, -5.0, 5.0, optional=True),
        ),
        ("end_stop",),
    ),
    Effect(
        "trapped_pressure", "measurement", 2, "Trapped oil leaks away at standstill",
        "M (1 - share (1 - exp(-dwell / tau))), refilled in motion", "Merritt 1967 (leakage of a blocked cylinder)",
        "exponential decay in holds",
        "dwell",
        (
            Parameter("share", "1", "of the torque lost in the end", 0.05, 0.0, 1.0),
            Parameter("time_constant", "s", "of the leak", 5.0, 0.2, 500.0, (1.0, 4.0, 15.0)),
            Parameter("refill_time", "s", "until the torque is back in motion", 0.1, 0.0, 2.0, optional=True),
        ),
        ("stress_relaxation",),
    ),
    Effect(
        "pressure_offset", "measurement", 1, "A pressure sensor reads a constant too much",
        "p_line += offset", "sensor data sheets", "at rest too, follows the moment arm of that line", "line",
        (Parameter("offset", "Pa", "reading minus true pressure", 5e4, -5e6, 5e6),), ("slope_bias", "pressure_drift"), per_line=True,
    ),
    Effect(
        "pressure_drift", "measurement", 1, "A pressure sensor drifts",
        "p_line += rate t", "sensor data sheets", "grows with time, at rest too", "time",
        (Parameter("drift", "Pa/s", "rate of the reading's error", 1e3, -1e5, 1e5),), ("slope_bias", "pressure_offset"),
        per_line=True,
    ),
    Effect(
        "pressure_lag", "measurement", 1, "Slow pressure sensors or filters",
        "tau dp_m/dt + p_m = p", "first-order lag", "proportional to dM/dt, in transients", "torque rate",
        (Parameter("tau", "s", "time constant", 0.01, 0.0, 2.0),), ("time_delay",),
    ),
    Effect(
        "moment_arm_error", "measurement", 1, "The cylinder arms differ from the drawing",
        "true arm = arm (1 + linear theta + quadratic theta^2)", "linkage geometry; Sharp and Granger 2003",
        "multiplies the torque by an even function of the angle", "steering angle",
        (
            Parameter("linear", "1/rad", "odd part", 0.05, -2.0, 2.0),
            Parameter("quadratic", "1/rad^2", "even part", 0.1, -5.0, 5.0),
        ),
        ("kingpin_jacking", "end_stop"),
    ),
)  # fmt: skip
