# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Motion stage: what the contact really does against the measured angle."""

from lugre_steering.effects.entry import Effect, Parameter

EFFECTS = (
    Effect(
        "angle_offset", "motion", 2, "Angle sensor mounted with an offset",
        "theta = theta_m - offset", "sensor geometry; no friction effect, shifts aligning torque and moment arms",
        "a slow function of the angle, the same on both sweep directions", "steering angle",
        (Parameter("offset", "rad", "constant added by both angle sensors", 0.02, -0.15, 0.15),),
        ("slope_bias", "pressure_offset", "kingpin_jacking"),
    ),
    Effect(
        "angle_scale", "motion", 2, "Angle sensor with a scale error",
        "theta = theta_m / (1 + scale)", "sensor calibration",
        "presliding slope and aligning torque scaled together", "steering angle",
        (Parameter("scale", "1", "relative error of the measured angle", 0.02, -0.2, 0.2),),
        ("linkage_compliance", "kingpin_jacking"),
    ),
    Effect(
        "backlash", "motion", 1, "Free play between angle sensor and track",
        "contact angle = theta_m - width / 2 tanh(M / (100 N m + softness)); the gap opens where the torque changes sign",
        "Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities (1996)",
        "flat, near-zero torque after each sign change of the torque, then a delayed build-up", "torque sign change",
        (
            Parameter("width", "rad", "full width of the gap", 0.006, 0.0, 0.1),
            Parameter("softness", "N m", "torque over which a flank gives, beyond 100 N m", 500.0, 0.0, 2e4, optional=True),
        ),
        ("linkage_compliance",),
    ),
    Effect(
        "linkage_compliance", "motion", 1, "Elastic linkage between angle sensor and track",
        "contact angle = theta_m - compliance M / (1 + stiffening |M|)",
        "series spring; Merritt, Hydraulic Control Systems (1967) for the hydraulic share",
        "presliding slope and its curvature; nothing on plateaus", "angle since reversal",
        (
            Parameter("compliance", "rad/(N m)", "inverse stiffness at small torque", 3e-7, 0.0, 5e-6),
            Parameter("stiffening", "1/(N m)", "inverse torque at which the compliance has halved", 4e-5, 0.0, 1e-3, optional=True),
        ),
        ("distributed_contact", "backlash"),
    ),
    Effect(
        "time_delay", "motion", 1, "Pressures stamped late or early",
        "p(t) recorded at t + delay", "clock skew of acquisition devices", "proportional to dM/dt, both signs", "torque rate",
        (Parameter("delay", "s", "positive: pressures stamped late", 0.01, -0.5, 0.5),), ("pressure_lag", "yaw_inertia"),
    ),
)  # fmt: skip
