"""The run file: one SQLite file that holds a whole reduction. Everything shown is a fold over its events."""
