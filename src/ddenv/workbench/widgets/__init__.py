"""The panels of the run screen, one a file."""
