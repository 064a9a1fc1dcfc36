"""Services of map nodes, for tests that play the core."""

import threading
import time

import rospy

PATIENCE_S = 20.0  # for what must happen; reached only by a bug


def service(node, name, service_class):
    full_name = f"svgp_node_{node}/{name}"
    rospy.wait_for_service(full_name, PATIENCE_S)
    return rospy.ServiceProxy(full_name, service_class)


def wait_until(condition, what, patience_s=PATIENCE_S):
    deadline_s = time.monotonic() + patience_s
    while not condition():
        if time.monotonic() > deadline_s:
            raise AssertionError(f"waited {patience_s:g} s in vain for {what}")
        time.sleep(0.01)


def at_once(calls):
    """Run calls at the same time; their results."""
    replies = [None] * len(calls)

    def run(k):
        replies[k] = calls[k]()

    threads = [threading.Thread(target=run, args=(k,)) for k in range(len(calls))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return replies
