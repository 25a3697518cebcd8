"""The contract as tables. Made by `scripts/make_contract.py`; do not edit."""

CONTRACT_VERSION = 2
PHYSICS_VERSION = 8

# Name, request, reply, field of the request that stands in the key.
QUERIES = [
    ("status", "StatusRequest", "Status", ""),
    ("scene", "SceneRequest", "SceneReply", ""),
    ("tasks", "TasksRequest", "TaskList", ""),
    ("lease", "LeaseRequest", "LeaseReply", "commander"),
    ("reach", "ReachRequest", "ReachReply", ""),
    ("pick", "PickRequest", "PickReply", ""),
    ("reset", "ResetRequest", "ResetReply", ""),
    ("pause", "PauseRequest", "Ack", ""),
    ("resume", "ResumeRequest", "Ack", ""),
    ("show", "ShowRequest", "Ack", ""),
    ("episode_start", "EpisodeStartRequest", "EpisodeStarted", ""),
    ("episode_stop", "EpisodeStopRequest", "EpisodeStopped", ""),
    ("episode", "EpisodeRequest", "EpisodeState", ""),
    ("snapshot", "SnapshotRequest", "SnapshotReply", ""),
    ("sensors", "SensorsRequest", "SensorsReply", ""),
    ("shutdown", "ShutdownRequest", "Ack", ""),
]

# Name, key below `wheelarm/{sim}/`, message, rate, units, frame, who publishes it.
TOPICS = [
    ("camera", "camera/{camera}", "CameraFrame", "camera", "pixels, m", "house", "server"),
    ("compressed_camera", "compressed/{camera}", "CompressedCameraFrame", "camera", "pixels, m", "house", "server"),
    ("sensor", "sensor/{sensor}", "SensorFrame", "camera", "pixels, mm", "house", "server"),
    ("preview", "preview/{camera}/{level}", "PreviewFrame", "camera", "pixels", "", "server"),
    ("sent_command", "command/{commander}", "Command", "event", "", "", "commander"),
    ("refusal", "refusal", "Refusal", "event", "", "", "server"),
    ("joint_state", "stream/joint_state", "JointState", "state", "rad, rad/s, N·m", "", "server"),
    ("pose", "stream/pose", "PoseSet", "state", "m and 1, m/s and rad/s", "the chair in house, all others in base_link", "server"),
    ("imu", "stream/imu", "Imu", "imu", "1, rad/s, m/s²", "imu_link", "server"),
    ("odometry", "stream/odometry", "Odometry", "state", "m and 1, m/s and rad/s", "wheelchair_root where it started", "server"),
    ("sensed_joint", "stream/sensed_joint", "SensedJoints", "state", "rad, rad/s, N·m, m", "", "server"),
    ("sensed_odometry", "stream/sensed_odometry", "SensedOdometry", "state", "m and 1, m/s and rad/s", "wheelchair_root where the episode began", "server"),
    ("sensed_imu", "stream/sensed_imu", "SensedImu", "imu", "rad/s, m/s²", "imu_link", "server"),
    ("disturbance", "stream/disturbance", "Disturbance", "event", "rad, 1, N, 1", "house", "server"),
    ("person", "stream/person", "PersonState", "state", "rad, m, N", "house", "server"),
    ("evaluation", "stream/evaluation", "Evaluation", "state", "SI", "", "server"),
    ("episode_start", "episode/start", "EpisodeStarted", "event", "", "", "server"),
    ("episode_stop", "episode/stop", "EpisodeStopped", "event", "", "", "server"),
    ("recorder", "recorder/{recorder}", "RecorderStatus", "event", "", "", "recorder"),
    ("clock", "stream/clock", "Clock", "control", "1", "", "server"),
    ("command", "stream/command", "CommandLog", "event", "", "", "server"),
    ("applied", "stream/applied", "Applied", "control", "rad, rad/s, m", "base_link", "server"),
    ("object_pose", "stream/object_pose", "ObjectPoses", "state", "m and 1, m/s and rad/s", "house", "server"),
    ("furniture_joint", "stream/furniture_joint", "FurnitureJoints", "state", "m or rad, m/s or rad/s", "", "server"),
    ("deformable", "stream/deformable", "Deformable", "deformable", "m, J", "house", "server"),
    ("contact", "stream/contact", "Contacts", "state", "N, m", "house", "server"),
    ("phase", "stream/phase", "PhaseSample", "state", "", "", "server"),
    ("state_hash", "stream/state_hash", "StateHash", "second", "", "", "server"),
    ("event", "stream/event", "Event", "event", "", "", "server"),
]

# Tasks that ship, with their time limit in simulated seconds.
TASKS = {
    "close_drawer": 120.0,
    "open_drawer": 120.0,
    "pick_blue_mug": 100.0,
    "pick_bowl": 100.0,
    "pick_crackers": 100.0,
    "pick_glass_bottle": 100.0,
    "pick_grey_cup": 100.0,
    "pick_meat_can": 100.0,
    "pick_mustard": 100.0,
    "pick_silver_bottle": 100.0,
    "pick_tomato_soup": 100.0,
    "place_knife": 150.0,
    "place_teddy_bear": 150.0,
    "select_coke": 100.0,
    "serve_drink": 150.0,
    "serve_remote": 150.0,
    "serve_spoonful": 150.0,
    "take_floor_crackers": 100.0,
    "throw_meat_can": 150.0,
}
