"""Reads SDF elements into plain data; the entry point is `ddenv.world.sdf.read`."""
