"""Real cameras and drives."""
