"""The version, and how to install it, in a module of its own: views ask for it, and must not import what the package offers."""

__version__ = "0.1.0"


def how_to_install(extra: str = "") -> str:
    """What to type for ddenv, or for one of its extras, in words."""
    what = f"'.[{extra}]'" if extra else "."
    return f"pip install {what} in ddenv's clone (the ddenv on PyPI is another program)"
