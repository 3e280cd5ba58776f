"""The device's end of the device protocol (docs/device-protocol.md), with Python's standard library only.

    python3 examples/python/device_client.py 127.0.0.1 9750 10

It plays a tool that circles on a plane, pressed with 1 N, for some seconds, and prints what it was told to drive. A program
that owns a real device does the same: `Device.exchange(sensed)` sends what was sensed and returns what is to be driven.
Python keeps no deadlines: a force loop wants the C client.
"""

import math
import socket
import struct
import sys
import time
from dataclasses import astuple, dataclass

# Magic, version, kind, sequence, sequence that is answered, time in ns; then what is sensed or driven.
STATE, COMMAND = struct.Struct("<4sHHIIQ12d"), struct.Struct("<4sHHIIQ6d")
ZERO = (0.0, 0.0, 0.0)


@dataclass
class Sensed:
    """What the device senses; what it does not have stays zero. SI units: m, rad, N, N m."""

    position: tuple = ZERO
    orientation: tuple = ZERO
    force: tuple = ZERO
    torque: tuple = ZERO


@dataclass
class Driven:
    """What is to be driven, N and A; all zero where no answer came. `running` is false when the graph has ended."""

    force: tuple = ZERO
    current: float = 0.0
    brake: float = 0.0
    running: bool = True
    round_trip_s: float | None = None


class Device:
    """A connection to a graph that runs live with a `UdpDevice`."""

    def __init__(self, host="127.0.0.1", port=9750, watchdog_s=0.02):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect((host, port))
        self.watchdog_s, self.sequence = watchdog_s, 0

    def exchange(self, sensed):
        """Sends what is sensed and waits for the answer, at most as long as the watchdog: then everything is zero."""
        sequence, self.sequence = self.sequence, (self.sequence + 1) % 2**32
        sent_ns = time.monotonic_ns()
        numbers = [number for part in astuple(sensed) for number in part]
        try:
            self.socket.send(STATE.pack(b"HGRF", 1, 1, sequence, 0, sent_ns, *numbers))
        except ConnectionRefusedError:
            pass  # nobody listened to an earlier packet
        while (left_s := self.watchdog_s - 1e-9 * (time.monotonic_ns() - sent_ns)) > 0:
            self.socket.settimeout(left_s)
            try:
                driven = self.understand(self.socket.recv(COMMAND.size + 1), sequence)
            except ConnectionRefusedError:
                continue
            except TimeoutError:
                break
            if driven is not None:
                return driven
        return Driven()

    @staticmethod
    def understand(packet, sequence):
        """A command that answers this state; none where the packet is another one."""
        if len(packet) != COMMAND.size:
            return None
        magic, version, kind, _, answers, sent_ns, *force, current, brake, running = COMMAND.unpack(packet)
        if (magic, version, kind) != (b"HGRF", 1, 2) or (running and answers != sequence):
            return None
        took_s = 1e-9 * (time.monotonic_ns() - sent_ns)
        return Driven(tuple(force), current, brake, running != 0.0, took_s)


def main(host="127.0.0.1", port="9750", seconds="10"):
    device, start = Device(host, int(port)), time.monotonic()
    answers, longest_s, largest = 0, 0.0, 0.0
    while (t := time.monotonic() - start) < float(seconds):
        circle = (0.02 * math.cos(2 * math.pi * t), 0.02 * math.sin(2 * math.pi * t), 0.0)
        driven = device.exchange(Sensed(position=circle, force=(0.0, 0.0, 1.0)))
        if not driven.running:
            break
        if driven.round_trip_s is not None:
            answers, longest_s = answers + 1, max(longest_s, driven.round_trip_s)
            largest = max(largest, math.hypot(*driven.force), abs(driven.current), abs(driven.brake))
        time.sleep(0.001)
    print(f"{answers} answers, longest round trip {1e3 * longest_s:.3f} ms, largest drive (N or A) {largest:g}")
    return 0 if answers > 0 else 2


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:4]))
