# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""What a misfit could be: fingerprints of the catalogue, onsets, patterns outside it, trials, and the build-up of names."""
