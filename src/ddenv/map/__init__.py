"""The world from above, drawn without a screen: outlines of models, cells of characters, and SVG."""
