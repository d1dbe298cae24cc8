"""Lessons on the screen: the list, and a lesson or a run step by step."""
