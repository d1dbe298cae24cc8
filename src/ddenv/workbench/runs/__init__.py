"""The screen that lists all runs."""
