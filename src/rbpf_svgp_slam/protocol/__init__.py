"""What the core, the map nodes and the recorder agree on: names, shares, arrays on the wire."""
