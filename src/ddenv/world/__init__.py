"""Reads SDF and URDF files into plain data, checks them, and writes SDF; and scenario files."""
