"""What a stranger may send to running nodes, for tests of what becomes of it."""

import io
import os
import time

import rospy

NUMBERS = (0, 1, 2, 3, 7, 1000, 2**31, 2**32 - 1)


def rounds(count):
    """So many of them, or those of RBPF_FUZZ_S seconds: tools/fuzz.sh."""
    end_s = time.monotonic() + float(os.environ.get("RBPF_FUZZ_S", 0.0))
    done = 0
    while done < count or time.monotonic() < end_s:
        yield done
        done += 1


def mutated(data, rng):
    """Behind sequence number and stamp some bytes are others, missing, or there twice."""
    data = bytearray(data)
    for _ in range(rng.integers(1, 4)):
        at, size = int(rng.integers(12, max(13, len(data)))), int(rng.integers(1, 40))
        kind = rng.integers(4)
        if kind == 0:
            data[at : at + 1] = bytes([rng.integers(256)])
        elif kind == 1:
            data[at : at + 4] = (b"\xff" * 4, b"\0\0\xc0\x7f", b"\xff\xff\xff\x3f")[rng.integers(3)]
        elif kind == 2:
            del data[at : at + size]
        else:
            data[at:at] = data[at : at + size]
    return bytes(data)


def rubbish_sender(message, advertise, rng):
    """Sends damaged copies of a message with a stamp that it is called with, as a stranger might.

    advertise: makes the publisher of a message's class.
    """

    class Rubbish(type(message)):
        """Goes on the wire as the bytes that it is given."""

        def serialize(self, buff):
            buff.write(self.data_on_wire)

    sender = advertise(Rubbish)

    def send(stamp_s):
        message.header.stamp = rospy.Time.from_sec(stamp_s)
        whole = io.BytesIO()
        message.serialize(whole)
        rubbish = Rubbish()
        rubbish.data_on_wire = mutated(whole.getvalue(), rng)
        sender.publish(rubbish)

    return send


def rubbish_request(request_class, rng, cut_share=0.2):
    """Absurd values, and now and then bytes that end too early.

    These a node of rospy never answers, though it lives on: whoever sends them waits for ever.
    """

    def value(kind):
        if kind == "uint8[]":
            return rng.bytes(rng.integers(40))
        if kind.endswith("[]"):
            return [value(kind[:-2]) for _ in range(rng.integers(5))]
        return bool(rng.integers(2)) if kind == "bool" else int(rng.choice(NUMBERS))

    class Cut(request_class):
        """Its last bytes are missing."""

        def serialize(self, buff):
            whole = io.BytesIO()
            super().serialize(whole)
            buff.write(whole.getvalue()[:-1])

    kind = Cut if rng.random() < cut_share else request_class
    return kind(*map(value, request_class._slot_types))


def is_answered(call, request):
    """Or refused by the middleware itself."""
    try:
        call(request)
    except rospy.ServiceException:
        return False
    return True
