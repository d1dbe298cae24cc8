"""The setup screen: what to reduce, and how."""
