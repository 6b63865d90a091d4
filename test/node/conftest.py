# Copyright 2026 The lugre_steering contributors
# SPDX-License-Identifier: Apache-2.0
"""Live tests share their processors with all other tests: one that fails is run again, as a machine that slept is no fault of the node."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

RERUNS = 2


@pytest.fixture(scope="session", autouse=True)
def template_of_nodes() -> Iterator[None]:
    """What nodes were forked from ends with the tests."""
    yield
    if "live_harness" in sys.modules:
        sys.modules["live_harness"].end_template()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.flaky(reruns=RERUNS))
