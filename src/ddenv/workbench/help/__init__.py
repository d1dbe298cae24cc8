"""Keys, commands, settings and dialogs that every screen uses."""
