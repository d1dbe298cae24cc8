"""Reading and writing SDF: one file an idea; `ddenv.world.read` is the way in."""
