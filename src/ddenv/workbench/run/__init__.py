"""The run screen: one run, watched and guided."""
