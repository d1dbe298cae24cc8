"""ddenv: find the few models of a world that make a robot fail."""

__version__ = "0.1.0"
