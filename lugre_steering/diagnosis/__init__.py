# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Which physics a model leaves out: from prepared runs over ``search`` and ``laws`` to what is told (``conclude``)."""
