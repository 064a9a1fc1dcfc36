"""The core and what it serves its map nodes with."""
