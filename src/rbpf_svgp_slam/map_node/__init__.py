"""A map node: trains the maps of its share of the particles and answers for them."""
