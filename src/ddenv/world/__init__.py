"""SDF in, SDF out: worlds and scenarios as plain data."""
