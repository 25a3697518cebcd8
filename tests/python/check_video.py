"""Decodes videos of an episode with ffmpeg and compares them with the recording.

Usage: check_video.py RECORDING.h5 PLAIN.mp4 CAMERA WHOLE.gif SPEED FPS
PLAIN shows one camera in its recorded size; WHOLE all cameras side by side with text, at SPEED
and FPS.
"""

import json
import subprocess
import sys

import h5py
import numpy as np


def frames(path):
    """All frames, and frames per second."""
    probe = subprocess.run(
        ["ffprobe", "-v", "error", "-select_streams", "v", "-show_streams", "-of", "json", path],
        check=True, capture_output=True,
    )
    (stream,) = json.loads(probe.stdout)["streams"]
    raw = subprocess.run(
        ["ffmpeg", "-v", "error", "-i", path, "-fps_mode", "passthrough", "-f", "rawvideo", "-pix_fmt", "rgb24", "pipe:1"],
        check=True, capture_output=True,
    ).stdout
    above, below = map(int, stream["r_frame_rate"].split("/"))
    return np.frombuffer(raw, np.uint8).reshape(-1, stream["height"], stream["width"], 3), above / below


def psnr(found, expected):
    """Peak signal to noise, dB."""
    error = np.mean((found.astype(float) - expected.astype(float)) ** 2)
    return 10 * np.log10(255**2 / max(error, 1e-9))


def main():
    recording, plain, camera, whole, speed, fps = sys.argv[1:]
    speed, fps = float(speed), float(fps)
    with h5py.File(recording) as file:
        stamps = file[f"streams/camera/{camera}/stamp_nanos"][...].astype(np.int64)
        images = file[f"streams/camera/{camera}/rgb"][...]
        cameras = {name: file[f"streams/camera/{name}/rgb"][...] for name in sorted(file["streams/camera"])}
        last = max(file[f"streams/{s}/stamp_nanos"][-1] for s in ("clock", "pose"))
    step = int(np.median(np.diff(stamps)))

    found, rate = frames(plain)
    assert round(rate * step) == 1_000_000_000, f"{rate} frames per second"
    assert found.shape[1:] == images.shape[1:], f"{found.shape}, expected {images.shape}"
    assert len(found) == (last - stamps[0]) // step + 1, f"{len(found)} frames"
    # Videos store color at every second pixel: small details lose most.
    worst = min(psnr(frame, images[k]) for k, frame in enumerate(found))
    assert worst > 27, f"{plain}: {worst:.1f} dB"
    own, next_one = (np.mean([psnr(f, p) for f, p in zip(found, images[shift:])]) for shift in (0, 1))
    assert own > next_one + 1, f"{plain}: {own:.1f} dB, {next_one:.1f} dB to the next image"

    film, rate = frames(whole)
    assert rate == fps, f"{rate} frames per second"
    assert len(film) == int((last - stamps[0]) * 1e-9 * fps / speed + 0.01) + 1, f"{len(film)} frames"
    # Side by side from the left, with equal heights and a small gap.
    height, width = film.shape[1:3]
    shapes = [p.shape[2] / p.shape[1] for p in cameras.values()]
    gap = max(width // 200, 2)
    tall = round((width - gap * (len(shapes) - 1)) / sum(shapes))
    wide = round(tall * shapes[0])
    off = []
    for k in range(0, len(film), 7):
        index = np.searchsorted(stamps, stamps[0] + k * speed / fps * 1e9 + 1000, side="right") - 1
        source = next(iter(cameras.values()))[index]
        rows = (np.arange(tall) + 0.5) * source.shape[0] / tall
        columns = (np.arange(wide) + 0.5) * source.shape[1] / wide
        expected = source[rows.astype(int)][:, columns.astype(int)]
        # The corner shows the name of the camera.
        off.append(psnr(film[k, tall // 3 : tall, :wide], expected[tall // 3 :]))
    assert min(off) > 20, f"{whole}: {min(off):.1f} dB"
    text = film[:, tall:].astype(int)
    lines = text[:, (height - tall) // 6 :]
    assert all((frame.max(2) > 180).mean() > 0.005 for frame in lines), "a frame without text"
    assert len({frame.tobytes() for frame in lines}) > 0.5 * len(lines), "the displayed time does not advance"
    print(f"{len(found)} frames within {worst:.1f} dB, {len(film)} of the GIF within {min(off):.1f} dB")


main()
