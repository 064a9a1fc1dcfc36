"""Which map node owns which particles."""

from __future__ import annotations


def share(particles: int, nodes: int, index: int) -> range:
    """Particles whose maps node `index` owns: contiguous, sizes differ by at most one."""
    base, extra = divmod(particles, nodes)
    first = index * base + min(index, extra)
    return range(first, first + base + (index < extra))


def owner(particle: int, particles: int, nodes: int) -> int:
    """Index of the map node that owns a particle's map."""
    return next(k for k in range(nodes) if particle in share(particles, nodes, k))
