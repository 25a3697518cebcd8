"""Fails when a trace of strace contains an address of another machine.

    python connects.py TRACE

Loopback, sockets in the file system and netlink are allowed. A trace without a connection proves
nothing and fails too.
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
        match = re.search(r'inet_addr\("([^"]+)"\)|inet_pton\(AF_INET6, "([^"]+)"', line)
        address = ipaddress.ip_address(match[1] or match[2])
        if not address.is_loopback:
            beyond.append(line.strip())
        counts["loopback" if address.is_loopback else str(address)] += 1
    elif family[1] in ("AF_UNIX", "AF_NETLINK", "AF_UNSPEC"):
        counts[family[1]] += 1
    else:
        beyond.append(line.strip())
print("addresses:", ", ".join(f"{name} {count}" for name, count in counts.most_common()))
if beyond:
    sys.exit("error: connections to other machines:\n" + "\n".join(beyond[:10]))
if not counts["loopback"] and not counts["AF_UNIX"]:
    sys.exit("error: the trace has no connection: run the program under strace -f -e connect")
