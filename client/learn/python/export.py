#!/usr/bin/env python3
"""Writes a policy with weights of another precision: 8 bits to ship it, 16, or 32 for LeRobot.

    python3 export.py runs/mustard/policy.safetensors --bits 8 --out mustard.safetensors
"""

import argparse
import sys
from pathlib import Path

import ledger
import policy_file


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("policy", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--bits", type=int, choices=[8, 16, 32], default=8)
    options = parser.parse_args()
    if options.out.exists():
        print(f"export.py: cannot write {options.out}: it exists; move it or choose another --out", file=sys.stderr)
        return 1
    try:
        state, card = policy_file.read(options.policy)
        policy_file.write(options.out, state, card, options.bits, record=ledger.read(options.policy))
    except (ValueError, OSError) as error:
        print(f"export.py: {error}", file=sys.stderr)
        return 1
    print(f"{options.out}: {options.out.stat().st_size / 1e6:.2f} MB, {options.bits} bits")
    return 0


if __name__ == "__main__":
    sys.exit(main())
