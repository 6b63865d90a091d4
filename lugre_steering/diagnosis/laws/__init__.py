# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Laws that nobody listed: searched as channel x f(coordinate), refitted in the chain, proved, and put into words."""
