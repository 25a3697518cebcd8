"""A line between two network namespaces, in user space: delay, loss, rate and queue of
each direction. For kernels without `tc netem`; needs root and /dev/net/tun.

    bad_line.py DELAY_MS LOSS_PERCENT MBIT_PER_S QUEUE_MS    until its input ends

The namespaces `wheelarm-near` (10.77.0.1) and `wheelarm-far` (10.77.0.2) live as long.
Every line of input is answered with the packets and bytes that went each way so far.
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
    """Sockets and devices that this thread opens from now on are in the namespace;
    without a name in the one that the process began in."""
    file = os.open(f"/var/run/netns/{namespace}", os.O_RDONLY) if namespace else HOME
    if libc.setns(file, NEW_NETWORK) != 0:
        raise OSError(ctypes.get_errno(), f"entering the network namespace {namespace}")
    if namespace:
        os.close(file)


def run(command):
    subprocess.run(command.split(), check=True, stdin=subprocess.DEVNULL)


def device(namespace, own, other):
    """The end of the line in a new namespace: whole IP packets are read and written."""
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
    """Packets on their way from one end: when the sender is free again, what went."""

    def __init__(self):
        self.free, self.packets, self.bytes, self.lost, self.full = 0.0, 0, 0, 0, 0


def carry(near, far, delay, loss, rate, queue):
    """Until the input ends. s, share, bit/s, s."""
    other = {near: far, far: near}
    ways = {near: Direction(), far: Direction()}
    under_way, count = [], 0
    chance = random.Random(1)
    sources = [near, far, sys.stdin.fileno()]
    while True:
        now = time.monotonic()
        while under_way and under_way[0][0] <= now:
            _, _, end, packet = heapq.heappop(under_way)
            try:
                os.write(end, packet)
            except BlockingIOError:
                ways[other[end]].full += 1
        wait = max(0.0, under_way[0][0] - time.monotonic()) if under_way else 1.0
        for end in select.select(sources, [], [], wait)[0]:
            if end == sys.stdin.fileno():
                if not sys.stdin.readline():
                    return
                names = ("to_far", "to_near")
                print(json.dumps(dict(zip(names, (vars(ways[e]) for e in (near, far))))), flush=True)
                continue
            way = ways[end]
            while True:
                try:
                    packet = os.read(end, 2048)
                except BlockingIOError:
                    break
                now = time.monotonic()
                if way.free - now > queue:
                    way.full += 1
                    continue
                way.free = max(way.free, now) + len(packet) * 8 / rate
                if chance.random() < loss:
                    way.lost += 1
                    continue
                way.packets, way.bytes = way.packets + 1, way.bytes + len(packet)
                count += 1
                heapq.heappush(under_way, (way.free + delay, count, other[end], packet))


def main():
    delay, loss, rate, queue = (float(word) for word in sys.argv[1:5])
    if os.geteuid() != 0 or not os.path.exists("/dev/net/tun"):
        print("a bad line needs root and /dev/net/tun", file=sys.stderr)
        return 3
    try:
        ends = [device(name, *addresses) for name, addresses in ENDS.items()]
        print("ready", flush=True)
        carry(*ends, delay / 1e3, loss / 100, rate * 1e6, queue / 1e3)
    finally:
        for name in ENDS:
            remove(name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
