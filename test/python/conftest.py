"""Shared by all tests of the Python package."""

import sys

import pytest


@pytest.fixture(autouse=True)
def keep_denormals():
    """Training flushes denormals to zero in its whole process; hypothesis refuses to draw then."""
    yield
    if "torch" in sys.modules:
        sys.modules["torch"].set_flush_denormal(False)
