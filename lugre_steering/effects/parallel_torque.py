# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Torques that act on the steering axis beside the contact."""

from lugre_steering.effects.entry import Effect, Parameter

EFFECTS = (
    Effect(
        "end_stop", "parallel_torque", 1, "Elastic end stop of the steering",
        "M = sgn(theta) (k1 x + k3 x^3 + c x'), x = |theta| - engage_angle > 0; unloading branch lower by loss",
        "limit device named by Liang et al. 2022; Hunt and Crossley, J. Appl. Mech. 42 (1975) 440 for contact with loss",
        "torque beyond a knee in the angle, holds included", "steering angle",
        (
            Parameter("stiffness", "N m/rad", "k1 of one track", 5e4, 0.0, 1e7),
            Parameter("engage_angle", "rad", "track angle at which the stop begins", 0.02, 0.02, 1.5,
                      (0.55, 0.65, 0.75, 0.82, 0.88, 0.94), "max_angle"),
            Parameter("cubic_stiffness", "N m/rad^3", "k3 of one track", 1e7, 0.0, 1e10, optional=True),
            Parameter("loss", "1", "share of the torque lost on unloading", 0.2, 0.0, 0.95, optional=True),
            Parameter("damping", "N m s/rad", "while the stop is driven in", 1e4, 0.0, 1e6, optional=True),
            Parameter("shift", "rad", "later engagement of negative angles", 0.01, -0.3, 0.3, optional=True),
        ),
        ("soil_shear", "moment_arm_error"),
    ),
    Effect(
        "yaw_inertia", "parallel_torque", 1, "Yaw inertia of the track assemblies",
        "M = J alpha", "Newton-Euler", "starts, stops and shakes", "steering acceleration",
        (Parameter("inertia", "kg m2", "of one track about its hinge", 200.0, 0.0, 1e5),),
        ("time_delay", "pressure_lag"),
    ),
    Effect(
        "kingpin_jacking", "parallel_torque", 1, "Jacking torque of the inclined kingpin",
        "M = amplitude sin(theta) + second_harmonic sin(2 theta) + even sin(theta)^2",
        "Reimpell, Stoll, Betzler, The Automotive Chassis (2001); Pacejka, Tire and Vehicle Dynamics, ch. 9",
        "the mean of both sweep branches is a function of the angle", "steering angle",
        (
            Parameter("amplitude", "N m", "of one track", 500.0, -5e4, 5e4),
            Parameter("second_harmonic", "N m", "of one track", 300.0, -5e4, 5e4, optional=True),
            Parameter("even", "N m", "caster part of one track", 300.0, -5e4, 5e4, optional=True),
        ),
        ("moment_arm_error", "angle_scale"),
    ),
    Effect(
        "slope_bias", "parallel_torque", 1, "Constant torque from standing on a slope",
        "M = torque", "gravity through the kingpin offset", "constant, at rest too", "none (constant)",
        (Parameter("torque", "N m", "of the vehicle", 200.0, -3e4, 3e4),),
        ("pressure_offset",),
    ),
    Effect(
        "soil_shear", "parallel_torque", 1, "Berms of soft ground pushed outward",
        "M = torque (1 + growth b) (1 - (b - |theta|) / span) near the farthest push b, slack between",
        "Wong, Theory of Ground Vehicles, ch. 2 (bulldozing)", "rises only into fresh ground", "steering angle",
        (
            Parameter("torque", "N m", "of one track at fresh ground", 1000.0, 0.0, 1e5),
            Parameter("span", "rad", "over which the berm is compressed", 0.05, 0.005, 0.5, (0.03, 0.1, 0.25)),
            Parameter("growth", "1/rad", "of the berm with its distance", 1.0, 0.0, 20.0, optional=True),
        ),
        ("end_stop", "kingpin_jacking"),
    ),
)  # fmt: skip
