"""The result of a run, as a report to read or mail."""
