"""What the workbench sends to a terminal, over SSH too, and to a browser."""
