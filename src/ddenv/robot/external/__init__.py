"""The robot in another simulator: a user's own command runs it."""
