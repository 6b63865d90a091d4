# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Contact stage: friction of rubber on the ground."""

from lugre_steering.effects.entry import Effect, Parameter

EFFECTS = (
    Effect(
        "viscous_friction", "contact", 1, "Viscous adhesion of the rubber",
        "M += sigma_2 omega / (1 + thinning |omega|)", "Canudas de Wit et al., IEEE TAC 40 (1995) 419; dropped by Liang et al. 2022",
        "odd in the rate, zero at rest", "steering rate",
        (
            Parameter("sigma_2", "N m s/rad", "viscous coefficient of one track", 5e3, 0.0, 5e5),
            Parameter("thinning", "s/rad", "inverse rate at which it has halved", 3.0, 0.0, 100.0, optional=True),
        ),
        ("line_loss_linear",),
    ),
    Effect(
        "static_ageing", "contact", 1, "Contact strengthens while it rests",
        "g += Mc rate ln(1 + age / t_c), d age/dt = 1 - age |dtheta/dt| / slip_scale",
        "Dieterich, J. Geophys. Res. 77 (1972) 3690; Rice and Ruina, J. Appl. Mech. 50 (1983) 343",
        "torque peak after a restart that grows with the logarithm of the dwell before it", "dwell",
        (
            Parameter("rate", "1", "relative gain per e-fold of age", 0.01, 0.0, 0.3),
            Parameter("dwell", "s", "time constant t_c", 1.0, 0.01, 100.0, (0.1, 1.0)),
            Parameter("slip_scale", "rad", "slip that renews the contacts", 0.1, 0.005, 2.0, (0.02, 0.06, 0.2)),
        ),
        ("stress_relaxation",),
    ),
    Effect(
        "stress_relaxation", "contact", 1, "Held rubber relaxes with the logarithm of time",
        "M = sigma_0 z (1 - per_decade log10(1 + hold / onset)), recovered over recovery_angle",
        "Gent, J. Appl. Polym. Sci. 6 (1962) 433",
        "torque decays while the angle is held and comes back after the restart", "dwell",
        (
            Parameter("per_decade", "1", "share of the elastic torque lost per decade of time", 0.03, 0.0, 0.4),
            Parameter("onset", "s", "time at which the decay begins", 0.3, 0.02, 20.0, (0.1, 1.0)),
            Parameter("recovery_angle", "rad", "motion that brings the torque back", 0.02, 0.001, 0.5, (0.015, 0.08)),
        ),
        ("trapped_pressure", "carcass_heat_sink"),
    ),
    Effect(
        "payne_softening", "contact", 2, "Filled rubber is stiffer for small strains",
        "dz/dtheta times 1 + a / (1 + (angle since reversal / angle)^2)",
        "Payne, J. Appl. Polym. Sci. 6 (1962) 57; Kraus, J. Appl. Polym. Sci. Symp. 39 (1984) 75",
        "small reversals and minor loops stiffer than the slow load test", "angle since reversal",
        (
            Parameter("amplitude", "1", "relative stiffening at zero strain", 0.3, 0.0, 5.0),
            Parameter("angle", "rad", "angle since reversal at which half of it is lost", 0.02, 0.002, 0.3, (0.01, 0.03)),
        ),
        ("distributed_contact", "linkage_compliance"),
    ),
    Effect(
        "mullins_softening", "contact", 2, "Virgin rubber softens on its first full shear",
        "dz/dtheta times 1 + a erfc((z_max - |z|) / width)",
        "Mullins, Rubber Chem. Technol. 21 (1948) 281; Ogden and Roxburgh, Proc. R. Soc. A 455 (1999) 2861",
        "the first sweep is stiffer, later ones only near the farthest shear", "first sweep",
        (
            Parameter("amplitude", "1", "relative stiffening of virgin rubber", 0.2, 0.0, 3.0),
            Parameter("width", "rad", "deflection below the largest over which it fades", 0.02, 0.001, 0.5, (0.008, 0.03)),
        ),
        ("wear_polishing",),
    ),
    Effect(
        "surface_patch", "contact", 1, "A patch of other ground, or ground that changes",
        "Ms, Mc times (1 + change) inside an angle window or a time window; sigma_0 kept",
        "friction of pavements: Wong, Theory of Ground Vehicles",
        "plateau steps at fixed angles (or from a time on), presliding slope kept", "steering angle",
        (
            Parameter("change", "1", "relative change of the friction level", 0.05, -0.9, 2.0),
            Parameter("angle_low", "rad", "start of the angle window of each track", 0.05, -1.2, 1.2),
            Parameter("angle_high", "rad", "end of the angle window", 0.05, -1.2, 1.2),
            Parameter("time_start", "s", "start of the time window", 2.0, -10.0, 1e5),
            Parameter("time_end", "s", "end of the time window", 2.0, -10.0, 1e5),
        ),
        ("wear_polishing", "direction_asymmetry"),
    ),
    Effect(
        "wear_polishing", "contact", 1, "The contact polishes with slip",
        "Ms, Mc times 1 - amount (1 - exp(-slip / slip_scale))",
        "Grosch, Rubber Chem. Technol. 69 (1996) 495; transfer films: Tiwari et al. 2021",
        "friction falls with accumulated slip and does not recover in pauses", "accumulated slip",
        (
            Parameter("amount", "1", "relative loss in the end", 0.05, -0.5, 0.8),
            Parameter("slip_scale", "rad", "slip at which 63 % is reached", 1.0, 0.05, 100.0, (0.1, 0.3, 1.0), "slip"),
        ),
        ("carcass_heat_sink", "surface_patch", "flash_temperature"),
    ),
    Effect(
        "direction_asymmetry", "contact", 1, "Friction differs between left and right turns",
        "Ms, Mc times (1 + a sgn(omega))", "Ackermann geometry and uneven ground; Liang et al. 2022, alternating extremes",
        "plateaus differ by direction", "direction",
        (Parameter("asymmetry", "1", "relative half difference, positive: left turns harder", 0.01, -0.3, 0.3),),
        ("slope_bias",),
    ),
    Effect(
        "distributed_contact", "contact", 1, "The contact saturates patch after patch",
        "parallel bristles of log-normally graded stiffness, equal shares of g",
        "Iwan, J. Appl. Mech. 33 (1966) 893; generalised Maxwell slip: Al-Bender et al., IEEE TAC 50 (2005) 1883",
        "presliding curve sharper at first and rounder later; minor loops", "angle since reversal",
        (Parameter("spread", "1", "standard deviation of the logarithm of the stiffness", 0.4, 0.0, 2.0),),
        ("linkage_compliance", "payne_softening"),
    ),
    Effect(
        "side_asymmetry", "contact", 3, "Friction differs between the left and the right track",
        "mu_left = (1 + a) mu, mu_right = (1 - a) mu", "uneven ground; lateral load transfer", "nothing in the sum of both sides",
        "side", needs="pressure lines that belong to one side each",
    ),
    Effect(
        "load_transfer", "contact", 3, "Vertical load shifts with body attitude",
        "F_left, F_right = F (1 +- h i / t)", "Gillespie, Fundamentals of Vehicle Dynamics (1992)", "side torques only", "side",
        needs="an attitude sensor (roll and pitch), or lines per side",
    ),
    Effect(
        "rolling_relief", "contact", 3, "Rolling while steering relaxes the bristles",
        "dz/dt = omega - sigma_0 |omega| z / g - kappa |V| z", "Deur, Asgari, Hrovat, Vehicle Syst. Dyn. 42 (2004) 77",
        "torque collapses while the track drives", "drive speed", needs="the drive speed of the tracks",
    ),
)  # fmt: skip
