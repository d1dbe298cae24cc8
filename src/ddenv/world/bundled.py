"""Where the scenarios and worlds that come with ddenv are: in the wheel, or in the checkout it was installed from."""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]
_ROOT = _PACKAGE / "data" if (_PACKAGE / "data").is_dir() else _PACKAGE.parents[1]
SCENARIOS = _ROOT / "scenarios"
SDF = _ROOT / "sdf"


def bundled_names() -> list[str]:
    """Names of the bundled scenarios, sorted."""
    return sorted(path.stem for path in SCENARIOS.glob("*.yaml"))
