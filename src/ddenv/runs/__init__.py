"""From what a user chose to a run file and the programs that work on it; and back to files."""
