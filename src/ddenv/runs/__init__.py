"""From the user's choices to a run file and the programs that work on it, and export back to
files.
"""
