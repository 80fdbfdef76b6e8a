"""From recorded data to configuration values."""
