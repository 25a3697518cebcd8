"""A network link between two namespaces in user space, with delay, loss, rate and queue
per direction. For kernels without `tc netem`; needs root and /dev/net/tun.

    bad_line.py DELAY_MS LOSS_PERCENT MBIT_PER_S QUEUE_MS    runs until stdin closes

The namespaces `wheelarm-near` (10.77.0.1) and `wheelarm-far` (10.77.0.2) exist while it
runs. For every input line it prints the packets and bytes of each direction so far.
"""

import ctypes
import fcntl
import heapq
import json
import os
import random
import select
import struct
import subprocess
import sys
import time

ENDS = {"wheelarm-near": ("10.77.0.1", "10.77.0.2"), "wheelarm-far": ("10.77.0.2", "10.77.0.1")}
NEW_NETWORK = 0x40000000  # CLONE_NEWNET
TUNSETIFF = 0x400454CA
TUN_WITHOUT_HEADER = 0x1001  # IFF_TUN | IFF_NO_PI
HOME = os.open("/proc/self/ns/net", os.O_RDONLY)
libc = ctypes.CDLL(None, use_errno=True)


def enter(namespace):
    """Switches this thread to the namespace: new sockets and devices open there;
    without a name back to the initial namespace of the process."""
    file = os.open(f"/var/run/netns/{namespace}", os.O_RDONLY) if namespace else HOME
    if libc.setns(file, NEW_NETWORK) != 0:
        raise OSError(ctypes.get_errno(), f"entering the network namespace {namespace}")
    if namespace:
        os.close(file)


def run(command):
    subprocess.run(command.split(), check=True, stdin=subprocess.DEVNULL)


def device(namespace, own, other):
    """The TUN device of a new namespace; reads and writes whole IP packets."""
    remove(namespace)
    run(f"ip netns add {namespace}")
    enter(namespace)
    end = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(end, TUNSETIFF, struct.pack("16sH", b"line", TUN_WITHOUT_HEADER))
    run(f"ip addr add {own} peer {other} dev line")
    run("ip link set line up mtu 1500")
    run("ip link set lo up")
    enter(None)
    return end


def remove(namespace):
    subprocess.run(["ip", "netns", "del", namespace], stderr=subprocess.DEVNULL, check=False)


class Direction:
    """Counters of one direction, and when its sender is free again."""

    def __init__(self):
        self.free, self.packets, self.bytes, self.lost, self.full = 0.0, 0, 0, 0, 0


def forward(near, far, delay, loss, rate, queue):
    """Forwards packets until stdin closes; delay in s, loss as share, rate in bit/s, queue in s."""
    other = {near: far, far: near}
    directions = {near: Direction(), far: Direction()}
    in_flight, count = [], 0
    random_source = random.Random(1)
    sources = [near, far, sys.stdin.fileno()]
    while True:
        now = time.monotonic()
        while in_flight and in_flight[0][0] <= now:
            _, _, end, packet = heapq.heappop(in_flight)
            try:
                os.write(end, packet)
            except BlockingIOError:
                directions[other[end]].full += 1
        wait = max(0.0, in_flight[0][0] - time.monotonic()) if in_flight else 1.0
        for end in select.select(sources, [], [], wait)[0]:
            if end == sys.stdin.fileno():
                if not sys.stdin.readline():
                    return
                names = ("to_far", "to_near")
                print(json.dumps(dict(zip(names, (vars(directions[e]) for e in (near, far))))), flush=True)
                continue
            direction = directions[end]
            while True:
                try:
                    packet = os.read(end, 2048)
                except BlockingIOError:
                    break
                now = time.monotonic()
                if direction.free - now > queue:
                    direction.full += 1
                    continue
                direction.free = max(direction.free, now) + len(packet) * 8 / rate
                if random_source.random() < loss:
                    direction.lost += 1
                    continue
                direction.packets, direction.bytes = direction.packets + 1, direction.bytes + len(packet)
                count += 1
                heapq.heappush(in_flight, (direction.free + delay, count, other[end], packet))


def main():
    delay, loss, rate, queue = (float(word) for word in sys.argv[1:5])
    if os.geteuid() != 0 or not os.path.exists("/dev/net/tun"):
        print("bad_line.py needs root and /dev/net/tun", file=sys.stderr)
        return 3
    try:
        ends = [device(name, *addresses) for name, addresses in ENDS.items()]
        print("ready", flush=True)
        forward(*ends, delay / 1e3, loss / 100, rate * 1e6, queue / 1e3)
    finally:
        for name in ENDS:
            remove(name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
