"""What a run came to, as a report to read and to mail."""
