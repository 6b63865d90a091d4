# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Recordings through the estimator, results beside the inputs. Called itself, it is ``replay.library.replay``."""

from lugre_steering.callable_room import make_callable

make_callable(__name__)
