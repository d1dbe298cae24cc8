"""How the environment is searched: one algorithm a file.

An algorithm takes the elements and a `Guide`, yields rounds, is sent the first similar candidate of each or None, and returns what
is left. It runs nothing, and knows no clock, no file, no screen.
"""
