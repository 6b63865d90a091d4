# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Which physics a model leaves out: from recordings (``data``) over ``fitting`` and ``search`` to what is told (``conclude``)."""
