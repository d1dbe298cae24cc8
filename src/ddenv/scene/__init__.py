"""The 3-D scene of a run in a browser: a separate program that reads the run file and serves
Meshcat on this machine only.
"""
