"""Keeps the core alive: one that has been killed is started again, and resumes from its journal."""
