"""Fails where a trace of strace tells an address beyond this machine.

    python connects.py TRACE

Loopback, sockets of the file system and the kernel's own (netlink) are fine. A
trace without one connection would prove nothing and fails too.
"""

import collections
import ipaddress
import re
import sys

counts, beyond = collections.Counter(), []
for line in open(sys.argv[1], errors="replace"):
    family = re.search(r"sa_family=(AF_\w+)", line)
    if not family:
        continue
    if family[1] in ("AF_INET", "AF_INET6"):
        told = re.search(r'inet_addr\("([^"]+)"\)|inet_pton\(AF_INET6, "([^"]+)"', line)
        address = ipaddress.ip_address(told[1] or told[2])
        if not address.is_loopback:
            beyond.append(line.strip())
        counts["loopback" if address.is_loopback else str(address)] += 1
    elif family[1] in ("AF_UNIX", "AF_NETLINK", "AF_UNSPEC"):
        counts[family[1]] += 1
    else:
        beyond.append(line.strip())
print("addresses:", ", ".join(f"{name} {count}" for name, count in counts.most_common()))
if beyond:
    sys.exit("error: beyond this machine:\n" + "\n".join(beyond[:10]))
if not counts["loopback"] and not counts["AF_UNIX"]:
    sys.exit("error: the trace holds no connection at all: nothing was observed")
