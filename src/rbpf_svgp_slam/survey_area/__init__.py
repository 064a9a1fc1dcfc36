"""The polygon that is surveyed, and grids over it."""
