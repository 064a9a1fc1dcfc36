"""Which nodes run. A master ends the first of two that take one name, so who starts looks first."""

from __future__ import annotations

import socket
from urllib.parse import urlsplit

import rosgraph

# Of a host; one that has been switched off never does.
ANSWER_S = 5.0


class NameTaken(RuntimeError):
    """A node of this name runs already; the message says where."""


def uri_of(node: str) -> str | None:
    """Where a node of our namespace is registered, if it is. Raises OSError, of a silent master."""
    name = rosgraph.names.ns_join(rosgraph.names.get_ros_namespace(), node)
    try:
        return rosgraph.Master("/" + node).lookupNode(name)
    except rosgraph.MasterError:
        return None


def listens(uri: str) -> bool:
    """A node that was killed stays registered, and one that is stopped still listens."""
    address = urlsplit(uri)
    try:
        socket.create_connection((address.hostname, address.port), ANSWER_S).close()
    except OSError:
        return False
    return True


def running_at(node: str) -> str | None:
    """Where a node of this name runs, if one does. Raises OSError."""
    uri = uri_of(node)
    return uri if uri is not None and listens(uri) else None


def expect_free(node: str) -> None:
    """Raises NameTaken. A master that is silent is left to who registers: it waits for it."""
    try:
        uri = running_at(node)
    except OSError:
        return
    if uri is not None:
        raise NameTaken(
            f"{node} runs already, at {uri}; expected one at a ROS master: end the survey that it "
            "belongs to, or start this one with a master of its own"
        )
