"""From what a user chose to a run file, and to the programs that work on it."""
