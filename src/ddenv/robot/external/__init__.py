"""Another simulator in Drake's place: a command or a class of the user's."""
