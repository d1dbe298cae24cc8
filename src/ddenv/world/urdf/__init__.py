"""URDF files, read as the SDF that they amount to."""
