"""The run file: one SQLite file that holds a whole reduction. Everything that views show is a fold
over its events.
"""
