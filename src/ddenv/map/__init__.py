"""Top-down maps of a world, independent of any screen: outlines of models, character cells, and
SVG.
"""
