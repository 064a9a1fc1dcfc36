"""Two hosts in one machine: network namespaces joined by a link of a given delay."""
