"""The version, in a module of its own: views ask for it, and must not import what the package offers."""

__version__ = "0.1.0"
