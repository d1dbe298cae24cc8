"""What the quick tier leaves out, and how many examples a property is tried with: see README.md in
this folder.
"""

from __future__ import annotations

from collections.abc import Iterable

import pytest
from hypothesis import HealthCheck, settings

# Why a test is slow by nature, as registered in pyproject.toml. The quick tier has one witness of
# each.
SLOW = ("rates", "claims", "fuzz", "terminal", "browser", "examples", "screens", "programs")

# A slow machine is no bug.
settings.register_profile(
    "quick",
    max_examples=10,
    derandomize=True,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
)
# The examples are always the same: what fails here fails again, and a change is judged by what it
# changes.
settings.register_profile("thorough", settings.get_profile("quick"), max_examples=40)
# New examples each time: finds what the others miss. What fails is printed so that it can be tried
# again elsewhere.
settings.register_profile(
    "nightly",
    settings.get_profile("thorough"),
    derandomize=False,
    max_examples=100,
    print_blob=True,
)


def slow(mark: pytest.MarkDecorator, values: Iterable, *, but: Iterable = ()) -> list:
    """Parameters that are left out of the quick tier, `but` for these witnesses."""
    but = list(but)
    return [value if value in but else pytest.param(value, marks=mark) for value in values]


def examples(weight: float, **more: object) -> settings:
    """As many examples as the profile says, times `weight`: below 1 where each is dear, above 1
    where it is cheap.
    """
    return settings(max_examples=max(2, round(weight * settings.default.max_examples)), **more)
