"""The workbench: a terminal screen on one run file. It watches, and asks; the engine works in a process of its own."""
