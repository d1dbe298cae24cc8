"""The map as a widget: a world from above that keys and the mouse move."""
