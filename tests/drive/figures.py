#!/usr/bin/env python3
"""Measures driving through the page's gateway over good and bad network paths: image rate,
latencies and braking, each beside its goal.

    figures.py [--seconds 60] [--size 640x360] [--programs target/release] [--out FILE]

A server, a gateway with keys and a page without a screen: it speaks the page's protocol
(client/teleop/web/PROTOCOL.md), counts an image as painted when it arrives, drives forward
and back by key and stops. An observer beside the server sees what arrives there. All
clocks are the host's. Needs root (network namespaces) and the Python package `wheelarm`.
"""

import argparse
import contextlib
import http.client
import json
import os
import secrets
import ssl
import statistics
import struct
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "client/python/src"))

import bad_line  # noqa: E402
import wheelarm  # noqa: E402
from websockets.sync.client import connect  # noqa: E402

HZ = 240
NEAR, FAR = bad_line.ENDS
HOST, PORT = bad_line.ENDS[NEAR][0], 7460
PASSWORD = "right and long"
# One way delay ms, loss %, Mbit/s, queue ms.
LINES = {"LAN": (0.15, 0, 1000, 100), "100 ms, 2 %, 5 Mbit/s": (50, 2, 5, 200)}
GOALS = {
    "LAN": {"painted": (50, 100), "images": 9.5, "gate": (3, 8, 15), "press": (200, 300), "stop": 20},
    "bbr": {"painted": (150, 320), "images": 9.0, "gate": (55, 65, 120), "press": (350, 600), "stop": 150},
    "cubic": {"painted": (180, 350), "images": 8.0, "gate": (55, 65, 120), "press": (350, 600), "stop": 150},
}


def quantile(values, share):
    if not values:
        return float("nan")
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


class Observer:
    """Messages that the server received and published, with the time of arrival here."""

    def __init__(self, endpoint):
        self.client = wheelarm.connect(endpoint, timeout=20)
        self.streams = self.client.streams("command", "odometry", "clock")
        self.zero = None  # monotonic moment of tick 0, the earliest seen
        self.commands, self.speeds = [], []
        threading.Thread(target=self.listen, daemon=True).start()

    def listen(self):
        for sample in self.streams:
            now = time.monotonic()
            message = sample.message
            tick = message.header.tick
            if sample.topic == "clock":
                zero = now - tick / HZ
                # Pacing may fall behind and never runs ahead: the newest second counts.
                self.zero = zero if self.zero is None else min(zero, self.zero + 2e-5)
            elif sample.topic == "odometry":
                self.speeds.append((tick, now, message.twist.linear.x))
            else:
                self.commands.append((tick, now, message))


class Page:
    """A page without a screen."""

    def __init__(self, authority):
        self.tls = ssl.create_default_context(cafile=authority)
        self.page = secrets.token_hex(16)
        self.running, self.lock = True, threading.Lock()
        self.images, self.situations, self.messages, self.rounds = [], [], [], []
        self.seq, self.epoch, self.held, self.shown = 0, 0, None, {}
        self.first_sent = {}  # shown tick: when it was first answered
        self.answers, self.asked = {}, 0

    def post(self, path, body, cookie=""):
        connection = http.client.HTTPSConnection(HOST, PORT, context=self.tls, timeout=20)
        origin = f"https://{HOST}:{PORT}"
        headers = {"Content-Type": "application/json", "Origin": origin, "Cookie": cookie}
        connection.request("POST", path, json.dumps(body), headers)
        answer = connection.getresponse()
        text = answer.read().decode()
        if answer.status != 200:
            raise RuntimeError(f"{path}: {answer.status} {text}")
        return answer, json.loads(text)

    def open(self):
        answer, _ = self.post("/login", {"user": "anna", "password": PASSWORD})
        self.cookie = answer.getheader("set-cookie").split(";")[0]
        _, body = self.post("/ticket", {"count": 4}, self.cookie)
        tickets = iter(body["tickets"])

        def socket(name, lane=0):
            headers = {"Cookie": self.cookie}
            made = connect(  # kept open until the program ends
                f"wss://{HOST}:{PORT}/ws/{name}", ssl=self.tls, additional_headers=headers,
                origin=f"https://{HOST}:{PORT}", compression=None, max_size=None, open_timeout=20,
            )  # fmt: skip
            hello = {"t": "hello", "protocol": 1, "ticket": next(tickets), "page": self.page, "lane": lane}
            made.send(json.dumps(hello))
            assert json.loads(made.recv())["t"] == "welcome"
            return made

        self.state, self.video = socket("state"), socket("video")
        self.lanes = [socket("control", lane) for lane in (0, 1)]
        for work in (self.watch, self.look, self.drive):
            threading.Thread(target=work, daemon=True).start()

    def watch(self):
        for text in self.state:
            now, message = time.monotonic(), json.loads(text)
            if message["t"] == "answer":
                self.answers[message["id"]] = message
            elif message["t"] == "situation":
                self.situations.append((now, len(text), message))
                echo = message.get("echo") or {}
                if echo.get("ms") is not None:
                    self.rounds.append(now * 1e3 - echo["ms"] - echo["held_ms"])
            else:
                self.messages.append((now, message))

    def ask(self, what, **more):
        self.asked += 1
        number = self.asked
        self.state.send(json.dumps({"t": "ask", "id": number, "ask": what, **more}))
        until = time.monotonic() + 20
        while number not in self.answers and time.monotonic() < until:
            time.sleep(0.01)
        return self.answers[number]

    def look(self):
        wanted = [{"camera": index, "width": 640} for index in (0, 1)]
        self.video.send(json.dumps({"t": "want", "codecs": self.codecs, "cameras": wanted}))
        for image in self.video:
            now = time.monotonic()
            codec, camera = image[1], image[3]
            width, seq, tick = struct.unpack_from("<HxxI4xQ", image, 4)
            with self.lock:
                self.shown[camera] = tick
                self.images.append((now, camera, tick, len(image), width, codec))
            self.video.send(json.dumps({"t": "ack", "camera": camera, "seq": seq, "painted": True}))

    def message(self, kind, **more):
        self.seq += 1
        shown = min(self.shown.values()) if self.shown else None
        now = time.monotonic()
        if shown is not None and kind == "drive":
            self.first_sent.setdefault(shown, now)
        message = {"t": kind, "seq": self.seq, "epoch": self.epoch, "shown": shown, "ms": now * 1e3,
            "device": "keyboard", "mode": "hold", "speed": 2, **more}  # fmt: skip
        text = json.dumps(message)
        for lane in self.lanes:
            lane.send(text)

    def drive(self):
        rounds = 0
        while self.running:
            with self.lock:
                if self.held:
                    self.message("drive", chair=self.held)
                elif rounds % 8 == 0:
                    self.message("alive")
            rounds += 1
            time.sleep(1 / 30)

    def press(self, chair):
        with self.lock:
            self.epoch += 1
            self.held = chair
            now = time.monotonic()
            self.message("drive", chair=chair)
        return now

    def stop(self):
        with self.lock:
            self.held = None
            now = time.monotonic()
            for _ in range(3):
                self.message("stop", why="person")
        return now


def processor_seconds(pid):
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def far(work):
    """Calls `work` in a thread of the remote namespace; returns its result."""
    out = {}

    def inside():
        bad_line.enter(FAR)
        try:
            out["value"] = work()
        except Exception as problem:  # raised below
            out["problem"] = problem

    thread = threading.Thread(target=inside)
    thread.start()
    thread.join()
    if "problem" in out:
        raise out["problem"]
    return out.get("value")


@contextlib.contextmanager
def allowed(congestion):
    """Allows a congestion control to unprivileged processes of the whole host; restores it at the end."""
    path = Path("/proc/sys/net/ipv4/tcp_allowed_congestion_control")
    before = path.read_text()
    path.write_text(f"reno {congestion}")
    try:
        yield
    finally:
        path.write_text(before)


def measure(name, congestion, options):
    programs = Path(options.programs)
    place = Path(tempfile.mkdtemp(prefix="wheelarm-figures-"))
    line = subprocess.Popen(
        [sys.executable, bad_line.__file__, *map(str, LINES[name])], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    others = []
    try:
        if line.stdout.readline().strip() != "ready":
            raise SystemExit("bad_line.py did not start: see the message above")
        inside = ["ip", "netns", "exec", NEAR]
        subprocess.run([*inside, "sysctl", "-qw", f"net.ipv4.tcp_congestion_control={congestion}"], check=True)
        keys = place / "keys"
        wheel = str(programs / "wheelarm")
        quiet = {"stdout": subprocess.DEVNULL}
        subprocess.run([wheel, "keys", "init", "--keys", str(keys), "--host", HOST], check=True, **quiet)
        subprocess.run(
            [wheel, "users", "add", "anna", "--role", "operator", "--password", "--keys", str(keys)],
            check=True, input=f"{PASSWORD}\n", text=True, **quiet,
        )  # fmt: skip
        size, rate = options.size, options.hz
        server = subprocess.Popen(
            [*inside, str(programs / "wheelarm-server"), "--listen", "tcp/127.0.0.1:7447", "--task", "pick_mustard",
             "--camera", f"gen3={size}@{rate}", "--camera", f"wheelchair={size}@{rate}"], **quiet, stderr=subprocess.DEVNULL)  # fmt: skip
        others.append(server)
        # The gateway uses BBR where it may.
        rights = ["setpriv", "--reuid=nobody", "--clear-groups"]
        subprocess.run(["chown", "-R", "nobody", str(place)], check=True)
        place.chmod(0o711)
        observer = {}

        def watch():
            bad_line.enter(NEAR)
            for _ in range(50):
                try:
                    observer["one"] = Observer("tcp/127.0.0.1:7447")
                    return
                except wheelarm.WheelArmError:
                    time.sleep(0.2)

        thread = threading.Thread(target=watch)
        thread.start()
        thread.join()
        observed = observer["one"]
        gateway = subprocess.Popen(
            [*inside, *rights, wheel, "--connect", "tcp/127.0.0.1:7447", "drive",
             "--page", f"{HOST}:{PORT}", "--keys", str(keys), "--name", HOST], stdout=subprocess.PIPE, text=True)  # fmt: skip
        others.append(gateway)
        gateway.stdout.readline()
        page = Page(keys / "ca.pem")
        page.codecs = options.codecs.split(",")
        far(page.open)
        while len(page.shown) < 2:
            time.sleep(0.1)
        assert page.ask("lease.ask")["mine"]
        return drive(page, observed, gateway.pid, line, options.seconds, server.pid)
    finally:
        for process in others:
            process.terminate()
        for process in others:
            process.wait()
        line.stdin.close()
        line.wait()


def drive(page, observed, gateway, line, seconds, server):
    time.sleep(3)
    presses, stops, side = [], [], 1
    began, busy, ticks = time.monotonic(), processor_seconds(gateway), observed.client.status().header.tick
    before = counted(line)
    while time.monotonic() - began < seconds:
        presses.append((page.press([-side, 0]), side))
        time.sleep(1.0)
        stops.append(page.stop())
        time.sleep(1.3)
        side = -side
    took = time.monotonic() - began
    cores = (processor_seconds(gateway) - busy) / took
    after = counted(line)
    factor = (observed.client.status().header.tick - ticks) / HZ / took
    page.running = False
    time.sleep(0.5)
    # Simulation time at arrival: a slow host falls behind the wall clock.
    painted, reached, moved, braked = [], [], [], []
    times = sorted((tick, now) for tick, now, _ in observed.speeds)
    stamps = {tick: now for tick, now in times}
    for now, camera, tick, *_ in page.images:
        # Odometry of the exposure's tick, published when the tick was simulated.
        if now > began and tick in stamps:
            painted.append((now - stamps[tick]) * 1e3)
    seen = set()
    for tick, now, message in observed.commands:
        answers = message.command.answers_tick if hasattr(message, "command") else message.answers_tick
        if answers in page.first_sent and answers not in seen and now > began:
            seen.add(answers)
            reached.append((now - page.first_sent[answers]) * 1e3)
    for at, _ in presses:
        tick = next((tick for tick, now, v in observed.speeds if now > at and abs(v) > 0.02), None)
        shown = tick and next((now for now, _, t, *_ in page.images if t >= tick and now > at), None)
        if shown and shown - at < 2:
            moved.append((shown - at) * 1e3)
    for at in stops:
        stopped = next((now for tick, now, m in observed.commands if now > at and is_still(m)), None)
        if stopped and stopped - at < 2:
            braked.append((stopped - at) * 1e3)
    per_camera = {}
    for now, camera, *_ in page.images:
        if now > began:
            per_camera.setdefault(camera, []).append(now)
    gaps = [b - a for all in per_camera.values() for a, b in zip(all, all[1:])]
    arrivals = sorted(now for _, now, _ in observed.commands if now > began)
    sizes = [size for now, _, _, size, *_ in page.images if now > began]
    return {
        "painted_ms": [quantile(painted, q) for q in (0.5, 0.95)],
        "pictures_hz": min(len(all) for all in per_camera.values()) / took,
        "longest_gap_ms": max(gaps) * 1e3,
        "gate_ms": [quantile(reached, q) for q in (0.5, 0.95, 0.99)],
        "round_ms": [quantile(page.rounds, q) for q in (0.5, 0.95, 0.99)],
        "press_ms": [quantile(moved, q) for q in (0.5, 0.95)],
        "stop_ms": [quantile(braked, 0.5), max(braked, default=float("nan"))],
        "presses": len(presses), "moved": len(moved), "braked": len(braked), "commands": len(arrivals),
        "down_mbit": (after["to_far"]["bytes"] - before["to_far"]["bytes"]) * 8e-6 / took,
        "up_kbit": (after["to_near"]["bytes"] - before["to_near"]["bytes"]) * 8e-3 / took,
        "lost": after["to_far"]["lost"] + after["to_near"]["lost"],
        "gateway_cores": cores,
        "factor": factor,
        "width": statistics.mode(width for now, _, _, _, width, _ in page.images if now > began),
        "picture_kB": sum(sizes) / len(sizes) / 1e3,
        "codec": {0: "jpeg", 1: "h264"}[page.images[-1][5]],
    }  # fmt: skip


def is_still(message):
    command = message.command if hasattr(message, "command") else message
    return command.HasField("base") and command.base.linear == 0 and command.base.angular == 0


def counted(line):
    line.stdin.write("\n")
    line.stdin.flush()
    return json.loads(line.stdout.readline())


def table(results):
    def numbers(values, digits=0):
        return " / ".join(f"{value:.{digits}f}" for value in values)

    rows = [
        ("exposure to painted, p50 / p95 (ms)", lambda g: numbers(g["painted"]), lambda r: numbers(r["painted_ms"])),
        ("images per second, each camera", lambda g: f">= {g['images']}", lambda r: f"{r['pictures_hz']:.1f}"),
        ("longest time without one (ms)", lambda g: "", lambda r: f"{r['longest_gap_ms']:.0f}"),
        ("page to gate, p50 / p95 / p99 (ms)", lambda g: numbers(g["gate"]), lambda r: numbers(r["gate_ms"])),
        ("page to gateway and back, p50 / p95 / p99 (ms)", lambda g: "", lambda r: numbers(r["round_ms"])),
        ("press to changed image, p50 / p95 (ms)", lambda g: numbers(g["press"]), lambda r: numbers(r["press_ms"])),
        ("STOP to brake at the gate, p50 / worst (ms)", lambda g: f"p99 {g['stop']}", lambda r: numbers(r["stop_ms"])),
        ("down (Mbit/s) / up (kbit/s)", lambda g: "0.8 to 1.0 / 60", lambda r: f"{r['down_mbit']:.2f} / {r['up_kbit']:.0f}"),
        ("gateway (share of a core)", lambda g: "0.20", lambda r: f"{r['gateway_cores']:.2f}"),
        ("simulated over wall seconds", lambda g: "", lambda r: f"{r['factor']:.2f}"),
        ("images", lambda g: "", lambda r: f"{r['codec']}, {r['width']} wide, {r['picture_kB']:.1f} kB"),
        ("presses, stops seen at the gate", lambda g: "", lambda r: f"{r['presses']}, {r['braked']}"),
    ]
    head = [f"{name}, {congestion}" for name, congestion in results]
    lines = ["| | " + " | ".join(f"goal | {title}" for title in head) + " |", "|---" * (1 + 2 * len(head)) + "|"]
    for title, goal, measured in rows:
        cells = []
        for (name, congestion), result in results.items():
            cells += [goal(GOALS["LAN" if name == "LAN" else congestion]), measured(result)]
        lines.append(f"| {title} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60, help="of driving on each line")
    parser.add_argument("--size", default="640x360", help="of both cameras")
    parser.add_argument("--hz", type=int, default=10)
    parser.add_argument("--codecs", default="h264,jpeg", help="in order of preference")
    parser.add_argument("--programs", default="target/release", help="folder with wheelarm and wheelarm-server")
    parser.add_argument("--only", help="one line: LAN or bad")
    parser.add_argument("--out", type=Path, help="figures as JSON")
    options = parser.parse_args()
    lan, bad = LINES
    runs = [(lan, "bbr"), (bad, "bbr"), (bad, "cubic")]
    if options.only:
        runs = [run for run in runs if (run[0] == lan) == (options.only == "LAN")]
    results = {}
    for name, congestion in runs:
        with allowed(congestion):
            results[name, congestion] = measure(name, congestion, options)
        print(f"{name}, {congestion}: {json.dumps(results[name, congestion])}", flush=True)
    print(table(results))
    if options.out:
        options.out.write_text(json.dumps({f"{n}, {c}": r for (n, c), r in results.items()}, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
