"""Writes and reads reports: the page, and the command lines that score and compare runs."""
