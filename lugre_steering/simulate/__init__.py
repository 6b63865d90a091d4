# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Simulated recordings: manoeuvres, the modelled vehicle, its actuation and its sensors; and the published
experiments. Called itself, it is ``simulate.library.simulate``."""

from lugre_steering.callable_room import make_callable

make_callable(__name__)
