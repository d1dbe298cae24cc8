"""The reduction itself, pure: partitioning, prioritization, algorithms, verdicts and statistics. It runs nothing."""
