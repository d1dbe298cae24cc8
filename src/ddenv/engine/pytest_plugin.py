"""The fixture `ddenv_reproduce` for pytest: minimal worlds as regression tests."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from ddenv.engine.single_test import Reproduction

Reproduce = Callable[..., "Reproduction"]


@pytest.fixture
def ddenv_reproduce(request: pytest.FixtureRequest) -> Reproduce:
    """`ddenv_reproduce(run, folder=None, most=60, trust=False)` runs what is left of a run until it
    is clear whether it still fails at the rate of its certificate. Paths are relative to the test's
    folder; `folder` has the user's own controller or simulator; with `trust` it is started unasked.
    The result has `fails` (None: the runs do not decide), `shown`, `runs` and `broken`; printed, it
    says the same in words. Raises UserError.
    """

    def reproduce(
        run: str | Path, folder: str | Path | None = None, most: int = 60, trust: bool = False
    ) -> Reproduction:
        from ddenv.engine.single_test import last_of

        here = request.path.parent
        return last_of(here / run, None if folder is None else here / folder, most, 1, trust)

    return reproduce
