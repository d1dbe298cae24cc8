"""The dialog that writes what a run left."""
