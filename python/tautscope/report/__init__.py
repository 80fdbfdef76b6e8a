"""Figures of merit, tables, figures and reports of recorded runs."""
