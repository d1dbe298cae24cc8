"""The files that an SDF file refers to: finding them by URI, reading meshes, and keeping both for a
run.
"""
