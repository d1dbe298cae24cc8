"""The 3-D scene of a run, in a browser: a program of its own that reads the run file and serves Meshcat on this machine only."""
