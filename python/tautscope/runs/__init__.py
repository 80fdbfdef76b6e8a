"""Runs of the loop: experiments, what they record, and their replay."""
