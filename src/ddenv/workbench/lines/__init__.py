"""A run in plain lines: for screen readers, logs and pipes. Nothing is ever drawn again."""
