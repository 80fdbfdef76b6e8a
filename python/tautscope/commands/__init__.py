"""Commands; those of logs, hardware, bench and ``doctor`` are in their packages."""
