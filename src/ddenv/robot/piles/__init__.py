"""Models that can move: which are simulated, held, or played back."""
