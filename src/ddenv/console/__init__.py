"""What the command line prints: a run's progress, its summary, lists and tables."""
