"""Verbs of the command line; those of logs, of hardware and ``doctor`` are in their packages."""
