"""The tree of a run's reductions, and two of its places side by side."""
