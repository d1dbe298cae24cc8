"""Drives a reduction as a program of its own: `python -m ddenv.engine RUN`."""
