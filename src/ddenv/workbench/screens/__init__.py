"""The two screens, and the dialogs that open above them."""
