"""Files that an SDF file names: finding them by their URIs, reading meshes, and keeping both for a run."""
