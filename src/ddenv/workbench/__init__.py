"""The workbench: a terminal screen on one run file. It shows the run and sends commands; the engine
is a separate process.
"""
