"""Checks exported files with third-party libraries and the published formats.

Usage: check_exports.py FORMAT PATH RECORDING.h5 [RECORDING.h5 …]
FORMAT is wheelarm-sim, csv, lerobot, robomimic, mcap or aligned. Numbers are compared with the
recordings, which are read with h5py alone.
"""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np

JOINTS = (
    [f"{end}_{side}_wheel_joint" for end in ("back", "front") for side in ("left", "right")]
    + [f"joint_{i}" for i in range(1, 7)]
    + [
        "left_inner_knuckle_finger_tip_joint",
        "right_inner_knuckle_finger_tip_joint",
        "robotiq_85_left_finger_tip_joint",
        "robotiq_85_left_knuckle_joint",
        "robotiq_85_right_finger_tip_joint",
        "robotiq_85_right_knuckle_joint",
    ]
)
FRAMES = "wheelchair shoulder bicep forearm spherical_wrist_1 spherical_wrist_2 end_effector".split()
CAMERAS = ("gen3", "wheelchair")


def check_calibration(stored, streams, size=None):
    """Checks intrinsics, scaled to the size of the images, and their convention."""
    assert stored["pixel_centre"] == 0.5 and stored["convention"].startswith("pixel edge"), stored
    assert set(stored["cameras"]) == set(CAMERAS)
    for camera in CAMERAS:
        width, height, fx, fy, cx, cy = streams[f"camera/{camera}/intrinsics"][0]
        to = size or (width, height)
        scale = np.array([to[0] / width, to[1] / height])
        found = stored["cameras"][camera]
        assert (found["width"], found["height"]) == tuple(to), found
        # Scaling keeps the relative position of the principal point.
        expected = np.concatenate([scale * [fx, fy], scale * [cx, cy]])
        equal([found[k] for k in ("fx", "fy", "cx", "cy")], expected, camera, 1e-9)


def equal(a, b, what, tolerance=0.0):
    a, b = np.asarray(a), np.asarray(b)
    assert a.shape == b.shape, f"{what}: shape {a.shape}, expected {b.shape}"
    worst = np.abs(a.astype(float) - b.astype(float)).max() if a.size else 0.0
    assert worst <= tolerance, f"{what}: error {worst}"


def at_stamp(stream, stamp):
    """Index of the sample with exactly this stamp, nanoseconds."""
    found = np.flatnonzero(stream["stamp_nanos"][...] == stamp)
    assert len(found) == 1, f"{stream.name}: {len(found)} samples at {stamp}"
    return int(found[0])


def by_label(recordings):
    return {h5py.File(r).attrs["label"]: h5py.File(r) for r in recordings}


def wheelarm_sim(path, recordings):
    """Checks WheelArm-Sim's layout, name by name."""
    for label, source in by_label(recordings).items():
        streams = source["streams"]
        check_calibration(json.loads((path / f"{label}.cameras.json").read_text()), streams)
        height, width = streams["camera/gen3/rgb"].shape[1:3]
        with h5py.File(path / f"{label}.hdf5") as file:
            assert list(file) == ["data"], list(file)
            assert not file.attrs and not file["data"].attrs
            names = sorted(file["data"], key=int)
            assert names == [str(i + 1) for i in range(len(names))]
            expected = {}
            for joint in JOINTS:
                expected[f"processed_data_joint_state_{joint}"] = ((3,), "f8", 4)
                expected[f"processed_data_joint_state_{joint}_joint_name"] = ((), "str", None)
            for frame in FRAMES:
                expected[f"processed_data_cartesian_pose_{frame}"] = ((8,), "f8", 4)
                expected[f"processed_data_cartesian_velocity_{frame}"] = ((4,), "f8", 4)
            expected["processed_data_imu_orientation"] = ((5,), "f8", 4)
            expected["processed_data_imu_linear_acceleration"] = ((4,), "f8", 4)
            expected["processed_data_imu_angular_velocity"] = ((4,), "f8", 4)
            for camera in CAMERAS:
                expected[f"processed_data_cameras_rgb_{camera}"] = ((height * width * 3,), "i8", 4)
                expected[f"processed_data_cameras_depth_{camera}"] = ((height * width * 4,), "i8", 4)
                for kind in ("rgb", "depth"):
                    expected[f"processed_data_cameras_{kind}_{camera}time"] = ((), "f8", None)
            expected["processed_data_timesteps"] = ((), "f8", None)
            expected["processed_data_desired_pose"] = ((7,), "f8", 4)
            expected["instructions"] = ((), "str", None)
            assert len(expected) == 60
            for name in names:
                group = file["data"][name]
                assert set(group) == set(expected), set(group) ^ set(expected)
                for key, (shape, kind, level) in expected.items():
                    data = group[key]
                    assert data.shape == shape, f"{data.name}: {data.shape}"
                    if kind == "str":
                        info = h5py.check_string_dtype(data.dtype)
                        assert info.encoding == "utf-8" and info.length is None, data.name
                    else:
                        assert data.dtype == np.dtype(kind), f"{data.name}: {data.dtype}"
                    assert data.compression_opts == level, f"{data.name}: {data.compression_opts}"
                    assert not data.attrs
            for name in (names[0], names[len(names) // 2], names[-1]):
                group = file["data"][name]
                assert group["instructions"][()].decode() == source.attrs["instruction"]
                for camera in CAMERAS:
                    images = streams[f"camera/{camera}"]
                    stamp = group[f"processed_data_cameras_rgb_{camera}time"][()]
                    i = at_stamp(images, round(stamp * 1e9))
                    rgb = group[f"processed_data_cameras_rgb_{camera}"][...].astype(np.uint8)
                    equal(rgb, images["rgb"][i].ravel(), camera)
                    depth = group[f"processed_data_cameras_depth_{camera}"][...].astype(np.uint8)
                    metres = depth.view("<f4")
                    assert np.array_equal(metres, images["depth"][i].ravel()), camera
                for k, joint in enumerate(JOINTS):
                    stamp, position, velocity = group[f"processed_data_joint_state_{joint}"]
                    i = at_stamp(streams["joint_state"], round(stamp * 1e9))
                    row = [streams["joint_state/position"][i, k], streams["joint_state/velocity"][i, k]]
                    equal([position, velocity], row, joint)
                    assert group[f"processed_data_joint_state_{joint}_joint_name"][()].decode() == joint
                for k, frame in enumerate(FRAMES):
                    pose = group[f"processed_data_cartesian_pose_{frame}"][...]
                    i = at_stamp(streams["pose"], round(pose[0] * 1e9))
                    equal(pose[1:], streams["pose/pose"][i, k], frame)
                    velocity = group[f"processed_data_cartesian_velocity_{frame}"][1:]
                    equal(velocity, streams["pose/twist"][i, k, :3], frame)
                desired = group["processed_data_desired_pose"][...]
                stamps = streams["applied/stamp_nanos"][...]
                clock = round(group["processed_data_timesteps"][()] * 1e9)
                i = int(np.searchsorted(stamps, clock, side="right")) - 1
                pose = streams["applied/desired_pose"][i]
                equal(desired, np.concatenate([pose[:3] * 1e3, pose[3:]]), "desired pose")
            print(f"{label}: {len(names)} samples of 60 datasets")


def png(path_or_bytes):
    """Size, bits and color type of a PNG from its header."""
    data = path_or_bytes if isinstance(path_or_bytes, bytes) else Path(path_or_bytes).read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n", "not a PNG"
    return int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big"), data[24], data[25]


def csv_table(path, recordings):
    bodies = [f"robot_arm_{b}_" for b in sorted(FRAMES) if b != "wheelchair"] + ["wheelchair_"]
    header = [f"{b}{p}" for b in bodies for p in ("pos_x", "pos_y", "pos_z", "quat_x", "quat_y", "quat_z", "quat_w")]
    header += [f"{b}vel_{p}" for b in bodies for p in "xyz"]
    header += [f"imu_gyro_{p}" for p in "xyz"] + [f"imu_accel_{p}" for p in "xyz"] + [f"imu_quat_{p}" for p in "xyzw"]
    header += [f"{j}_{p}" for j in JOINTS for p in ("pos", "vel")]
    header += ["sim_time", "instructions", "trial_id", "image_frame_id", "state_labels"]
    for number, (label, source) in enumerate(by_label(recordings).items(), 1):
        with open(path / label / "final_data.csv", newline="", encoding="utf-8") as text:
            rows = list(csv.reader(text))
        assert rows[0] == header and len(header) == 117
        check_calibration(json.loads((path / label / "cameras.json").read_text()), source["streams"])
        state = np.array([[float(v) for v in r[:113]] for r in rows[1:]])
        assert np.isfinite(state).all()
        assert {r[113] for r in rows[1:]} == {source.attrs["instruction"]}
        assert {r[114] for r in rows[1:]} == {str(number)}
        assert [int(r[115]) for r in rows[1:]] == list(range(1, len(rows)))
        labels = [int(r[116]) for r in rows[1:]]
        assert set(labels) <= {0, 1, 2, 3} and labels[0] == 0
        equal(np.linalg.norm(state[:, 76:80], axis=1), np.ones(len(state)), "norm", 1e-9)
        streams = source["streams"]
        stamps = streams["camera/gen3/stamp_nanos"][...][-len(state):]
        equal(state[:, 112], (stamps - stamps[0]) * 1e-9, "sim_time", 1e-9)
        for row in (0, len(state) // 2, len(state) - 1):
            i = at_stamp(streams["joint_state"], stamps[row])
            equal(state[row, 80:112:2], streams["joint_state/position"][i], "joints", 1e-12)
            equal(state[row, 42:49], streams["pose/pose"][i, 0], "chair", 1e-12)
            equal(state[row, 7:14], streams["pose/pose"][i, 6], "end effector", 1e-12)
        with open(path / label / "rows.csv", newline="", encoding="utf-8") as text:
            made = list(csv.reader(text))
        assert len(made[0]) == 2 + 27 + 12 + 1 and len(rows) - 3 < len(made) <= len(rows)
        at = len(state) // 2
        middle = {int(row[0]): np.array([float(v) for v in row]) for row in made[1:]}[at + 1]
        assert abs(middle[1] - state[at, 112]) < 1e-9
        assert middle[41] == 0, "a deliberate error in an episode without one"
        equal(middle[29:41], next_pose(source, float(stamps[at + 1])), "action", 1e-5)
        height, width = streams["camera/gen3/rgb"].shape[1:3]
        for camera in CAMERAS:
            for kind, bits, color in (("rgb", 8, 2), ("depth", 8, 0), ("depth_mm", 16, 0)):
                folder = path / label / f"{camera}_{kind}"
                assert len(list(folder.iterdir())) == len(state), folder
                found = png(folder / f"frame_{len(state)}.png")
                assert found == (width, height, bits, color), f"{folder}: {found}"
        print(f"{label}: {len(state)} rows of 117 columns")


def next_pose(source, after):
    """An action of the kind next-pose from the streams alone, for a robot whose commander streams
    poses, independent of the export."""
    streams = source["streams"]
    ticks = streams["applied/stamp_nanos"][...].astype(float)
    tick = int(np.searchsorted(ticks, after - 1000.0)) - 1
    pose = streams["applied/desired_pose"][tick]
    x, y, z, w = pose[3:] / np.linalg.norm(pose[3:])
    first = [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)]
    second = [2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)]
    left, right = streams["applied/wheel_velocity"][tick]
    robot = source["robot"].attrs
    motion = [(left + right) / 2 * robot["wheel_radius"], (right - left) / robot["track"] * robot["wheel_radius"]]
    knuckle = streams["applied/knuckle"][tick + 1]
    return np.concatenate([pose[:3], first, second, [knuckle], motion])


def check_video(path, key, info, episode, exact, stamps):
    """Checks that an episode's frames, decoded by ffmpeg, are the recorded images in order."""
    place = {name: episode[f"videos/{key}/{name}"] for name in ("chunk_index", "file_index", "from_timestamp", "to_timestamp")}
    file = path / info["video_path"].format(video_key=key, **place)
    height, width, _ = info["features"][key]["shape"]
    ffmpeg = os.environ.get("WHEELARM_FFMPEG") or "ffmpeg"
    arguments = ["-loglevel", "error", "-i", file, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    raw = subprocess.run([ffmpeg, *arguments], check=True, capture_output=True).stdout
    frames = np.frombuffer(raw, np.uint8).reshape(-1, height, width, 3)
    first, last = (round(place[f"{end}_timestamp"] * info["fps"]) for end in ("from", "to"))
    assert last - first == episode["length"] and last <= len(frames)
    frames = frames[first:last].astype(float)
    sources = np.stack([exact["rgb"][at_stamp(exact, stamp)] for stamp in stamps]).astype(float)
    assert frames.shape == sources.shape, (frames.shape, sources.shape)
    noise = ((frames - sources) ** 2).mean(axis=(1, 2, 3))
    decibel = 10 * np.log10(255**2 / np.maximum(noise, 1e-9))
    assert decibel.mean() >= 36 and decibel.min() >= 30, (key, decibel.mean(), decibel.min())
    still = ((frames[1:] - sources[:-1]) ** 2).mean(axis=(1, 2, 3))
    assert still.mean() > 2 * noise.mean(), f"{key}: the frames also match the previous images"


def lerobot(path, recordings):
    import pyarrow.parquet as pq

    info = json.loads((path / "meta/info.json").read_text())
    cameras = json.loads((path / "meta/cameras.json").read_text())
    shape = info["features"]["observation.images.gen3"]["shape"]
    check_calibration(cameras, h5py.File(recordings[0])["streams"], (shape[1], shape[0]))
    assert info["codebase_version"] == "v3.0"
    assert info["robot_type"] == h5py.File(recordings[0])["robot"].attrs["name"]
    joint = h5py.File(recordings[0])["robot"].attrs["arm_joints"][0]
    assert info["features"]["observation.state"]["names"][0] == f"{joint}.position"
    table = pq.read_table(sorted(path.glob("data/*/*.parquet")))
    features = info["features"]
    columns = {name for name, feature in features.items() if feature["dtype"] != "video"}
    assert set(table.column_names) == columns
    assert json.loads(table.schema.metadata[b"huggingface"])["info"]["features"].keys() == columns
    assert table.num_rows == info["total_frames"]
    column = {name: table[name].to_pylist() for name in table.column_names if "images" not in name}
    assert column["index"] == list(range(table.num_rows))
    episodes = pq.read_table(path / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert len(episodes) == info["total_episodes"] == len(recordings)
    sources = by_label(recordings)
    for episode in episodes:
        rows = range(episode["dataset_from_index"], episode["dataset_to_index"])
        assert len(rows) == episode["length"]
        source = sources[episode["recording"]]
        assert episode["tasks"] == [source.attrs["instruction"]]
        assert episode["success"] == bool(source.attrs["success"])
        for frame, row in enumerate(rows):
            assert column["frame_index"][row] == frame
            assert column["episode_index"][row] == episode["episode_index"]
            assert abs(column["timestamp"][row] - frame / info["fps"]) <= 1e-4
            assert column["next.done"][row] == (frame + 1 == len(rows))
        streams = source["streams"]
        for row in (rows[0], rows[len(rows) // 2], rows[-1]):
            stamp = round(column["simulation_time"][row] * 1e9)
            i = at_stamp(streams["joint_state"], stamp)
            state = np.array(column["observation.state"][row])
            equal(state[:6], streams["joint_state/position"][i, 4:10], "state", 1e-5)
            assert state.shape == (27,)
            equal(state[14:17], streams["pose/pose"][i, 6, :3], "end effector", 1e-5)
            if "observation.scan" in features:
                scans = streams["sensed_scan"] if len(streams["sensed_scan/stamp_nanos"]) else streams["scan"]
                nearest = np.abs(scans["stamp_nanos"][...].astype("i8") - stamp).argmin()
                wanted = np.clip(scans["ranges"][nearest], 0, 12)
                equal(np.array(column["observation.scan"][row]), wanted, "scan", 1e-5)
            equal(np.array(column["privileged.chair_pose"][row]), streams["pose/pose"][i, 0], "chair", 1e-5)
            if row + 1 < rows[-1]:
                after = round(column["simulation_time"][row + 1] * 1e9)
                equal(np.array(column["action"][row]), next_pose(source, after), "action", 1e-4)
        for camera in CAMERAS:
            key = f"observation.images.{camera}"
            if features[key]["dtype"] == "video":
                stamps = [round(column["simulation_time"][row] * 1e9) for row in rows]
                check_video(path, key, info, episode, streams[f"camera/{camera}"], stamps)
                continue
            for row in (rows[0], rows[-1]):
                image = table[key][row].as_py()
                assert png(image["bytes"]) == (shape[1], shape[0], 8, 2)
    stats = json.loads((path / "meta/stats.json").read_text())
    state = np.array(column["observation.state"])
    for name, found in (("min", state.min(0)), ("max", state.max(0)), ("mean", state.mean(0)), ("std", np.maximum(state.std(0), 0.01))):
        equal(stats["observation.state"][name], found, name, 1e-9)
    equal(stats["observation.state"]["q90"], np.quantile(state, 0.9, axis=0), "q90", 1e-9)
    assert np.array(stats["observation.images.gen3"]["mean"]).shape == (3, 1, 1)
    tasks = pq.read_table(path / "meta/tasks.parquet")
    assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == ["task"]
    print(f"{len(episodes)} episodes, {table.num_rows} rows")


def robomimic(path, recordings):
    with h5py.File(path) as file:
        data = file["data"]
        environment = json.loads(data.attrs["env_args"])
        assert {"env_name", "type", "env_kwargs"} <= set(environment)
        assert int(data.attrs["total"]) == sum(int(d.attrs["num_samples"]) for d in data.values())
        masks = [d.decode() for m in ("train", "valid") for d in file[f"mask/{m}"][...]]
        assert sorted(masks) == sorted(data), masks
        low, high = data.attrs["action_low"], data.attrs["action_high"]
        sources = by_label(recordings)
        assert len(data) == len(sources)
        for demo in data.values():
            n = int(demo.attrs["num_samples"])
            actions = demo["actions"][...]
            assert actions.shape[0] == n and np.abs(actions).max() <= 1.0
            moving = high > low
            raw = (actions[:, moving] + 1) / 2 * (high - low)[moving] + low[moving]
            equal(raw, demo["actions_raw"][:, moving], "raw actions", 1e-9)
            for key in demo["obs"]:
                assert demo["obs"][key].shape == demo["next_obs"][key].shape
                assert demo["obs"][key].shape[0] == n
                equal(demo["obs"][key][1:], demo["next_obs"][key][:-1], key)
            assert demo["obs/gen3_image"].dtype == np.uint8
            assert demo["dones"][-1] == 1 and demo["dones"][...].sum() == 1
            source = sources[demo.attrs["label"]]
            streams = source["streams"]
            i = at_stamp(streams["joint_state"], round(demo["simulation_time"][n // 2] * 1e9))
            equal(demo["obs/joint_pos"][n // 2], streams["joint_state/position"][i, 4:10], "joints", 1e-12)
            after = round(demo["simulation_time"][n // 2 + 1] * 1e9)
            equal(demo["actions_raw"][n // 2], next_pose(source, after), "action", 1e-5)
            assert not {"base_pos", "base_quat"} & set(demo["obs"]) and demo["states"].shape == (n, 27)
            equal(demo["privileged/base_pos"][n // 2], streams["pose/pose"][i, 0, :3], "chair", 1e-12)
            demo.visititems(check_attributes)
            check_mimicgen(demo, source)
        size = data["demo_0/obs/gen3_image"].shape[2:0:-1]
        check_calibration(json.loads(data.attrs["camera_calibration"]), source["streams"], size)
        print(f"{len(data)} demos, {int(data.attrs['total'])} samples")


def check_attributes(name, item):
    """Checks that every dataset except the sentence has a unit and a frame."""
    if isinstance(item, h5py.Dataset) and name != "instruction":
        assert item.attrs["units"] and "frame" in item.attrs, f"{name} lacks a unit or frame"
    if name.endswith("_image"):
        assert item.attrs["pixel_centre"] == 0.5 and item.attrs["convention"].startswith("pixel edge")


def check_mimicgen(demo, source):
    """Checks MimicGen's poses: all are in the house frame, consistent with the cameras on chair and
    hand, and the held object is in the hand."""
    info = demo["datagen_info"]
    assert set(info["object_poses"]) == set(source.attrs["objects"])
    poses = [info["eef_pose"], info["target_pose"], *info["object_poses"].values()]
    assert {p.attrs["frame"] for p in poses} == {"house"}
    assert demo["obs/eef_pos"].attrs["frame"] == demo["obs/eef_quat"].attrs["frame"] == "base_link"
    hand, target = info["eef_pose"][...], info["target_pose"][...]
    turn = hand[:, :3, :3]
    equal(turn @ np.transpose(turn, (0, 2, 1)), np.broadcast_to(np.eye(3), turn.shape), "rotation", 1e-9)
    # The wrist camera is fixed to the hand; its pose is recorded, not computed from joints.
    camera = source["streams/camera/gen3"]
    stamps = np.round(demo["simulation_time"][...] * 1e9).astype(np.uint64)
    index = np.array([at_stamp(camera, s) for s in stamps])
    in_hand = np.einsum("nji,nj->ni", turn, camera["pose"][...][index, :3] - hand[:, :3, 3])
    worst = np.linalg.norm(in_hand - in_hand[0], axis=1).max()
    assert worst < 2e-4, f"the wrist camera moves by {worst} m on the hand"
    off = np.linalg.norm(target[:, :3, 3] - hand[:, :3, 3], axis=1).max()
    assert off < 0.1, f"the target is {off} m away from the hand"
    held = source.attrs["task"].removeprefix("pick_")
    if bool(source.attrs["success"]) and held in info["object_poses"]:
        position = info[f"object_poses/{held}"][-1, :3, 3]
        apart = np.linalg.norm(position - hand[-1, :3, 3])
        assert apart < 0.3, f"{held} is held {apart:.2f} m away from the hand"
        print(f"{demo.attrs['label']}: {held} in the hand at {apart:.3f} m, camera on the hand within {1e3 * worst:.3f} mm")


def mcap(path, recordings):
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
    from mcap.reader import make_reader

    for label, source in by_label(recordings).items():
        counts, last, types, first, transforms, texts = {}, 0, {}, {}, {}, {}
        with open(path / f"{label}.mcap", "rb") as stream:
            reader = make_reader(stream)
            attached = {a.name: a.data.decode() for a in reader.iter_attachments()}
            metadata = {m.name: m.metadata for m in reader.iter_metadata()}
            for schema, channel, message in reader.iter_messages():
                assert message.log_time >= last, "not in order of time"
                last = message.log_time
                counts[channel.topic] = counts.get(channel.topic, 0) + 1
                if schema.encoding == "ros2msg":
                    assert (channel.message_encoding, schema.name, schema.data) == ("cdr", "std_msgs/msg/String", b"string data\n")
                    size = int.from_bytes(message.data[4:8], "little")
                    assert message.data[:4] == b"\0\1\0\0" and len(message.data) == 8 + size and message.data[-1] == 0
                    assert channel.topic in ("/robot_description", "/furniture_description")
                    texts[channel.topic] = message.data[8:-1].decode()
                    continue
                if schema.id not in types:
                    assert schema.encoding == channel.message_encoding == "protobuf"
                    pool = descriptor_pool.DescriptorPool()
                    for file in descriptor_pb2.FileDescriptorSet.FromString(schema.data).file:
                        pool.Add(file)
                    found = pool.FindMessageTypeByName(schema.name)
                    types[schema.id] = message_factory.GetMessageClass(found)
                # Of each topic the first message is compared, of transforms every one.
                if channel.topic in first and schema.name != "foxglove.FrameTransforms":
                    continue
                decoded = types[schema.id].FromString(message.data)
                first.setdefault(channel.topic, (message.log_time, decoded))
                if schema.name == "foxglove.FrameTransforms":
                    for t in decoded.transforms:
                        transforms.setdefault(t.child_frame_id, []).append((message.log_time, t))
        streams = source["streams"]
        for topic, stream in (
            ("/joint_states", "joint_state"), ("/tf", "pose"), ("/imu", "imu"), ("/odometry", "odometry"),
            ("/applied", "applied"), ("/command", "command"), ("/evaluation", "evaluation"),
            ("/phase", "phase"), ("/tf/objects", "object_pose"), ("/tf/links", "joint_state"),
            ("/contact", "contact"), ("/furniture_joints", "furniture_joint"),
            ("/tf/furniture", "furniture_joint"),
            ("/camera/gen3/rgb", "camera/gen3"), ("/camera/wheelchair/depth", "camera/wheelchair"),
            ("/camera/gen3/ids", "camera/gen3"), ("/camera/wheelchair/ids", "camera/wheelchair"),
        ):
            assert counts[topic] == len(streams[stream]["stamp_nanos"]), topic
        for topic, stream in (("/scan", "scan"), ("/sensed/scan", "sensed_scan")):
            if stream in streams and len(streams[stream]["stamp_nanos"]):
                assert counts[topic] == len(streams[stream]["stamp_nanos"]), topic
                stamp, scan = first[topic]
                ranges = streams[f"{stream}/ranges"][at_stamp(streams[stream], stamp)]
                assert np.array_equal(np.array(scan.ranges), ranges), topic
                assert abs(scan.end_angle - scan.start_angle - 2 * np.pi * (1 - 1 / len(ranges))) < 1e-9
        stamp, joints = first["/joint_states"]
        i = at_stamp(streams["joint_state"], stamp)
        equal([j.position for j in joints.joints], streams["joint_state/position"][i], "joints")
        stamp, drawers = first["/furniture_joints"]
        i = at_stamp(streams["furniture_joint"], stamp)
        assert [j.name for j in drawers.joints] == list(streams["furniture_joint/position"].attrs["names"])
        equal([j.position for j in drawers.joints], streams["furniture_joint/position"][i], "drawers")
        stamp, image = first["/camera/gen3/depth"]
        i = at_stamp(streams["camera/gen3"], stamp)
        metres = np.frombuffer(image.data, "<u2").reshape(image.height, image.width) * 1e-3
        truth = streams["camera/gen3/depth"][i]
        near = np.isfinite(truth) & (truth < 60)
        equal(metres[near], truth[near], "depth", 0.000501)
        assert first["/camera/gen3/rgb"][1].data[:2] == b"\xff\xd8", "not a JPEG"
        for camera in CAMERAS:
            stamp, image = first[f"/camera/{camera}/ids"]
            i = at_stamp(streams[f"camera/{camera}"], stamp)
            assert image.encoding == "16UC1" and image.step == 2 * image.width
            ids = np.frombuffer(image.data, "<u2").reshape(image.height, image.width)
            equal(ids, streams[f"camera/{camera}/ids"][i], "ids")
            k = first[f"/camera/{camera}/calibration"][1].K
            width, height, fx, fy, cx, cy = streams[f"camera/{camera}/intrinsics"][0]
            # Minus half a pixel: these readers count from the centre of the first pixel.
            equal(k, [fx, 0, cx - 0.5, 0, fy, cy - 0.5, 0, 0, 1], "K")
            equal(np.array(first[f"/camera/{camera}/calibration"][1].P)[[2, 6]], [cx - 0.5, cy - 0.5], "P")
        assert metadata["camera_calibration"]["convention"].startswith("pixel centre")
        legend = dict(zip(source["initial_state/instances/id"][...], source["initial_state/instances/name"].asstr()[...]))
        assert metadata["instance_ids"] == {str(i): name for i, name in legend.items()}
        check_contacts(path / f"{label}.mcap", types, streams)
        tree = check_robot(transforms, streams, attached, texts["/robot_description"])
        tree += f", {check_furniture(transforms, streams, texts['/furniture_description'])} moving leaves"
        print(f"{label}: {sum(counts.values())} messages on {len(counts)} topics, {foxglove(first)} compared with Foxglove's schemas; {tree}")


def check_contacts(path, types, streams):
    """Compares contacts with the columns of the recording."""
    from mcap.reader import make_reader

    touching = 0
    columns = "stamp_nanos pad_force pairs force point".split()
    # Read at once: a chunk is inflated for every row that is read alone.
    stamps, pad_forces, all_pairs, forces, points = (streams[f"contact/{name}"][...] for name in columns)
    with open(path, "rb") as stream:
        for i, (schema, _, message) in enumerate(make_reader(stream).iter_messages(topics=["/contact"])):
            decoded = types[schema.id].FromString(message.data)
            assert message.log_time == stamps[i]
            equal(decoded.pad_forces, pad_forces[i], "pad force")
            pairs = json.loads(all_pairs[i])
            assert [[c.first, c.second] for c in decoded.contacts] == pairs
            touching += len(pairs)
            for k, c in enumerate(decoded.contacts):
                equal([c.force.x, c.force.y, c.force.z], forces[i][k], "force")
                equal([c.point.x, c.point.y, c.point.z], points[i][k], "point")
    assert touching > 0, "the recording has no contact"


def check_robot(transforms, streams, attached, description):
    """Checks that the frames are one tree from the house to every link of the robot, with the recorded
    poses, and that the description names the same links and needs no file."""
    import xml.etree.ElementTree as xml

    parents = {}
    for child, samples in transforms.items():
        found = {t.parent_frame_id for _, t in samples}
        assert len(found) == 1, f"{child} has the parents {found}"
        parents[child] = found.pop()
    for child in parents:
        up, steps = child, 0
        while up != "house":
            assert up in parents and steps < 50, f"{child} is below {up}, not below the house"
            up, steps = parents[up], steps + 1
    (urdf,) = (text for name, text in attached.items() if name.endswith(".urdf"))
    recorded, shown = xml.fromstring(urdf), xml.fromstring(description)
    links = {link.get("name") for link in recorded.iter("link")}
    assert links == {link.get("name") for link in shown.iter("link")} and links <= set(parents)
    for link in ("back_left_wheel", "front_right_wheel", "robotiq_85_left_finger_tip_link", "robotiq_85_right_inner_knuckle_link"):
        assert link in links, link
    parent_of = {j.find("child").get("link"): j.find("parent").get("link") for j in recorded.iter("joint")}
    assert all(parents[child] == parent for child, parent in parent_of.items()), "a link has two parents"
    assert not list(shown.iter("mesh")), "a mesh outside the file"
    shapes = sum(len(link.findall("visual")) for link in shown.iter("link"))

    by_stamp = {frame: dict(samples) for frame, samples in transforms.items()}

    def pose_in_house(frame, stamp):
        """Pose of a frame in the house: position, rotation."""
        turn, at = np.array([0, 0, 0, 1.0]), np.zeros(3)
        while frame != "house":
            found = by_stamp[frame].get(int(stamp), transforms[frame][0][1])
            q, p = found.rotation, found.translation
            q = np.array([q.x, q.y, q.z, q.w])
            at, turn = rotate(q, at) + [p.x, p.y, p.z], multiply(q, turn)
            frame = parents[frame]
        return at, turn

    names = list(streams["pose/pose"].attrs["names"])
    frames = {"shoulder": "shoulder_link", "bicep": "bicep_link", "forearm": "forearm_link",
              "spherical_wrist_1": "spherical_wrist_1_link", "spherical_wrist_2": "spherical_wrist_2_link",
              "end_effector": "robotiq_85_base_link"}
    worst = [0.0, 0.0]
    stamps = streams["pose/stamp_nanos"][...]
    for i in range(0, len(stamps), max(1, len(stamps) // 40)):
        chair, base = pose_in_house("wheelchair_root", stamps[i]), pose_in_house("base_link", stamps[i])
        equal(chair[0], streams["pose/pose"][i, names.index("wheelchair"), :3], "chair", 1e-12)
        for name, link in frames.items():
            expected = streams["pose/pose"][i, names.index(name)]
            at, turn = pose_in_house(link, stamps[i])
            off = np.linalg.norm(at - base[0] - rotate(base[1], expected[:3]))
            angle = 2 * np.linalg.norm(multiply(turn * [-1, -1, -1, 1], multiply(base[1], expected[3:]))[:3])
            worst = [max(worst[0], off), max(worst[1], angle)]
    assert worst[0] < 1e-4 and worst[1] < 1e-4, f"links have an error of {worst[0]} m, {worst[1]} rad"
    # The pose of the wrist camera on the hand follows from the description alone.
    at, _ = pose_in_house("camera_color_frame", streams["camera/gen3/stamp_nanos"][-1])
    off = np.linalg.norm(at - streams["camera/gen3/pose"][-1, :3])
    assert off < 2e-4, f"the wrist camera has an error of {off} m"
    return f"{len(parents)} frames, links within {1e3 * worst[0]:.3f} mm, {np.degrees(worst[1]):.5f} deg, {shapes} solids"


def check_furniture(transforms, streams, description):
    """Checks that the description names every recorded joint with its kind of motion, and that the
    frames of the leaves are those of the description at the recorded positions."""
    import xml.etree.ElementTree as xml

    def turned(axis, angle):
        return np.concatenate([np.multiply(axis, np.sin(angle / 2)), [np.cos(angle / 2)]])

    position = streams["furniture_joint/position"]
    names, units = (list(position.attrs[key]) for key in ("names", "units_by_name"))
    joints = {j.get("name"): j for j in xml.fromstring(description).iter("joint")}
    for k, (name, unit) in enumerate(zip(names, units)):
        joint, slides = joints[name], unit == "m"
        assert joint.get("type") == ("prismatic" if slides else "revolute"), f"{name} is in {unit}"
        limit = joint.find("limit")
        low, high = float(limit.get("lower")), float(limit.get("upper"))
        assert low - 0.02 <= position[:, k].min() and position[:, k].max() <= high + 0.02, f"{name} leaves its limits"
        at, (roll, pitch, yaw) = (np.array(joint.find("origin").get(a).split(), float) for a in ("xyz", "rpy"))
        turn = multiply(multiply(turned([0, 0, 1], yaw), turned([0, 1, 0], pitch)), turned([1, 0, 0], roll))
        axis = np.array(joint.find("axis").get("xyz").split(), float)
        samples = transforms[joint.find("child").get("link")]
        equal([s for s, _ in samples], streams["furniture_joint/stamp_nanos"][...], name)
        for (_, t), value in list(zip(samples, position[:, k]))[::7]:
            assert t.parent_frame_id == joint.find("parent").get("link"), name
            moved = rotate(turn, axis * value) if slides else np.zeros(3)
            q = turn if slides else multiply(turn, turned(axis, value))
            equal([t.translation.x, t.translation.y, t.translation.z], at + moved, name, 1e-12)
            off = multiply(q * [-1, -1, -1, 1], np.array([t.rotation.x, t.rotation.y, t.rotation.z, t.rotation.w]))
            assert np.abs(off[:3]).max() < 1e-12, f"{name}: {off}"
    return len(names)


def foxglove(first):
    """Compares the fields of our messages with Foxglove's published ones."""
    import importlib

    done = set()
    for _, message in first.values():
        name = message.DESCRIPTOR.full_name
        if not name.startswith("foxglove.") or name in done:
            continue
        short = name.split(".")[1]
        theirs = getattr(importlib.import_module(f"foxglove_schemas_protobuf.{short}_pb2"), short).DESCRIPTOR
        fields = lambda d: {(f.number, f.name, f.type, f.is_repeated) for f in d.fields}  # noqa: E731
        assert fields(message.DESCRIPTOR) == fields(theirs), f"{name} differs"
        done.add(name)
    return len(done)


def cubic(rows, time, values, slopes):
    """Cubic interpolation of samples with their slopes per second."""
    i = np.clip(np.searchsorted(time, rows, side="right") - 1, 0, len(time) - 2)
    span = ((time[i + 1] - time[i]) * 1e-9)[:, None]
    s = np.clip((rows.astype("f8") - time[i])[:, None] * 1e-9 / span, 0, 1)
    a, b = values[i], values[i + 1]
    return (a * (1 + 2 * s) * (1 - s) ** 2 + b * s**2 * (3 - 2 * s)
            + span * (slopes[i] * s * (1 - s) ** 2 + slopes[i + 1] * s**2 * (s - 1)))


def rotate(q, v):
    """Rotates vectors by unit quaternions x y z w."""
    t = 2 * np.cross(q[..., :3], v)
    return v + q[..., 3:] * t + np.cross(q[..., :3], t)


def multiply(a, b):
    vector = a[..., 3:] * b[..., :3] + b[..., 3:] * a[..., :3] + np.cross(a[..., :3], b[..., :3])
    return np.concatenate([vector, a[..., 3:] * b[..., 3:] - (a[..., :3] * b[..., :3]).sum(-1, keepdims=True)], -1)


def check_rigid(file):
    """Checks that the interpolated pose of the chair and the recorded pose of the camera on it are
    fixed to each other."""
    camera = file["streams/camera/wheelchair"]
    same = (camera["stamp_nanos"][...] == file["stamp_nanos"][...]) & file["streams/pose/valid"][...].astype(bool)
    names = list(file["streams/pose/pose"].attrs["names"])
    chair = file["streams/pose/pose"][...][same, names.index("wheelchair")]
    camera, age = camera["pose"][...][same], file["streams/pose/age_nanos"][...][same]
    back = chair[:, 3:] * [-1, -1, -1, 1]
    place = rotate(back, camera[:, :3] - chair[:, :3])
    turn = multiply(back, camera[:, 3:])
    sampled = np.flatnonzero(age == 0)[0]
    off = np.linalg.norm(place - place[sampled], axis=1).max()
    angle = 2 * np.linalg.norm(multiply(turn, turn[sampled] * [-1, -1, -1, 1])[:, :3], axis=1).max()
    assert off < 1e-4, f"the chair moves by {off} m against its camera"
    assert angle < np.radians(0.01), f"the chair rotates by {np.degrees(angle)} deg against its camera"
    print(f"chair against its camera: {1e3 * off:.4f} mm, {np.degrees(angle):.5f} deg; {(age > 0).sum()} rows between samples")


def aligned(path, recordings):
    for recording in recordings:
        source = h5py.File(recording)
        streams = source["streams"]
        with h5py.File(path / f"{Path(recording).stem}.aligned.h5") as file:
            stamps = file["stamp_nanos"][...]
            equal(stamps, streams["camera/gen3/stamp_nanos"][...], "rows")
            for name in ("joint_state/position", "pose/pose", "imu/orientation", "imu/linear_acceleration"):
                stream = name.split("/")[0]
                found, valid = file["streams"][name][...], file[f"streams/{stream}/valid"][...].astype(bool)
                assert np.isnan(found[~valid]).all() and np.isfinite(found[valid]).all(), name
                time = streams[stream]["stamp_nanos"][...]
                inside = (stamps >= time[0]) & (stamps <= time[-1])
                assert not valid[~inside].any(), f"{name} is extrapolated"
                values = streams[name][...]
                if file["streams"][name].attrs["interpolation"].startswith("cubic"):
                    if name == "joint_state/position":
                        truth = cubic(stamps, time, values, streams["joint_state/velocity"][...])
                        equal(found[valid], truth[valid], name, 1e-9)
                elif name in ("joint_state/position", "imu/linear_acceleration"):
                    truth = np.stack([np.interp(stamps, time, c) for c in values.T], axis=1)
                    equal(found[valid], truth[valid], name, 1e-9)
            check_rigid(file)
            for camera in CAMERAS:
                attributes = file[f"streams/camera/{camera}/intrinsics"].attrs
                assert attributes["pixel_centre"] == 0.5 and attributes["convention"].startswith("pixel edge")
                for kind in ("rgb", "depth", "ids"):
                    equal(file[f"streams/camera/{camera}/{kind}"][7], streams[f"camera/{camera}/{kind}"][7], kind)
        print(f"{Path(recording).stem}: {len(stamps)} rows")


FORMATS = {
    "wheelarm-sim": wheelarm_sim, "csv": csv_table, "lerobot": lerobot,
    "robomimic": robomimic, "mcap": mcap, "aligned": aligned,
}

if __name__ == "__main__":
    np.seterr(invalid="ignore")
    FORMATS[sys.argv[1]](Path(sys.argv[2]), sys.argv[3:])
