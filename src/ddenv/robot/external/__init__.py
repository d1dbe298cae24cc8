"""Another simulator in Drake's place: a command of the user's."""
