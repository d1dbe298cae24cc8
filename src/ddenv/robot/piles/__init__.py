"""Models that can move: which ones are simulated, held still, or played back."""
