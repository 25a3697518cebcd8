//! Long parts of `--help` and of the man pages: examples, exit codes, environment.

macro_rules! manual {
    ($examples:literal, $codes:literal $(, $more:literal)*) => {
        concat!("Examples:\n", $examples, "\nExit codes:\n", $codes $(, $more)*)
    };
}

/// `wheelarm`.
pub const WHEELARM: &str = manual!(
    "  wheelarm doctor                    checks this host and the server
  wheelarm server                    a server, until Ctrl-C, for the commands below
  wheelarm demo                      records one episode, without a running server
  wheelarm teleop                    drives by keyboard; a page shows the cameras
  wheelarm record --out data/today   records every episode into a file
  ssh -N -L 7447:127.0.0.1:7447 HOST forwards the port of a remote server
",
    "  0  done
  1  failed; the message names the fix
  2  the command line is wrong
  3  finished with loss: a recording is incomplete, or samples were missed
",
    "
Environment:
  WHEELARM_CONNECT  endpoint of the server, as --connect
  WHEELARM_SIM      name of the server, as --sim
  WHEELARM_KEYS     folder of keys, as --keys
  WHEELARM_USER     user of that folder, as --user
  RUST_LOG          more messages on standard error, for example RUST_LOG=wheelarm_cli=debug"
);

/// `wheelarm status`.
pub const STATUS: &str = manual!(
    "  wheelarm status
  wheelarm --connect tcp/127.0.0.1:7448 --sim left status
",
    "  0  a server replied
  1  no server replied
"
);

/// `wheelarm map`.
pub const MAP: &str = manual!(
    "  wheelarm map
  wheelarm map --out maps --name anna-flat
  ros2 run nav2_map_server map_server --ros-args -p yaml_filename:=maps/anna-flat.yaml
",
    "  0  the map was printed or written
  1  no server replied
"
);

/// `wheelarm pack`.
pub const PACK: &str = manual!(
    "  wheelarm pack check anna-flat
  wheelarm pack list --packs homes
  wheelarm --connect tls/sim-host:7447 --keys ada pack put anna-flat
  wheelarm pack extract data/demo-seed0.h5 --out homes
",
    "  0  done
  1  a pack is not valid, or the server rejects it; the message names the fix
",
    "\nEnvironment:\n  WHEELARM_PACKS    folders of packs, separated by `:`, as --packs"
);

/// `wheelarm keys`.
pub const KEYS: &str = manual!(
    "  wheelarm keys init --host sim-host --keys /srv/wheelarm/keys
  wheelarm users add anna --role operator --keys /srv/wheelarm/keys
  wheelarm keys user anna --days 90 --keys /srv/wheelarm/keys
  wheelarm keys router --keys /srv/wheelarm/keys --out router.json5
  wheelarm-server --keys /srv/wheelarm/keys --listen tls/0.0.0.0:7447
  wheelarm --connect tls/sim-host:7447 --keys anna teleop
",
    "  0  made
  1  the folder or the user is invalid
"
);

/// `wheelarm router`.
pub const ROUTER: &str = manual!(
    "  wheelarm router --keys /srv/wheelarm/keys
  wheelarm-server --sim kitchen --keys /srv/wheelarm/keys \\
    --connect tls/sim-host:7447 --listen unixsock-stream/kitchen.socket
  wheelarm --connect tls/sim-host:7447 --keys anna --sim kitchen teleop
",
    "  0  it was interrupted and ended
  1  the keys are invalid, or the endpoint is in use
"
);

/// `wheelarm users`.
pub const USERS: &str = manual!(
    "  wheelarm users add anna --role operator --keys /srv/wheelarm/keys
  wheelarm users password anna --keys /srv/wheelarm/keys
  wheelarm users role anna --role viewer --keys /srv/wheelarm/keys
  wheelarm users remove anna --keys /srv/wheelarm/keys
  wheelarm users list --keys /srv/wheelarm/keys
",
    "  0  done
  1  the folder or the user is invalid
"
);

/// `wheelarm tasks`.
pub const TASKS: &str = manual!(
    "  wheelarm tasks
",
    "  0  listed, by the server or by the program wheelarm-server beside this one
  1  neither returned a list
"
);

/// `wheelarm reset`.
pub const RESET: &str = manual!(
    "  wheelarm reset --seed 7
  wheelarm reset --task pick_mustard --seed 3
  wheelarm reset --seed 7 --starts anywhere
",
    "  0  set up
  1  refused (an episode runs, another client is in control, unknown task), or no server replied
"
);

/// `wheelarm pause` and `wheelarm resume`.
pub const PAUSE: &str = manual!(
    "  wheelarm pause; wheelarm status; wheelarm resume
",
    "  0  done
  1  no server replied
"
);

/// `wheelarm lease`.
pub const LEASE: &str = manual!(
    "  wheelarm lease hold --commander anna     and in another terminal:
  wheelarm episode start --label try-1
  wheelarm episode stop
",
    "  0  control was released
  1  refused (another client is in control), or control was lost
",
    "\nLines on standard input, one command each:
  drive LINEAR TURN   chair speeds, m/s and rad/s, until the next line of the chair
                      or the end of the lines
  stop                chair and arm stop
  open, close         the gripper
  quit                releases control, as Ctrl-C does"
);

/// `wheelarm episode`.
pub const EPISODE: &str = manual!(
    "  wheelarm episode start --label try-1 --instruction \"Pick up the mustard\" --require-recorders 1
  wheelarm episode stop
  wheelarm episode stop --discard
",
    "  0  started or ended
  1  refused (one runs already, none runs), or it did not begin (a recorder is
     missing or cannot record it), or no server replied
"
);

/// `wheelarm record`.
pub const RECORD: &str = manual!(
    "  wheelarm record --out data/session
  wheelarm record --out data/session --episodes 1 --depth u16
  wheelarm --connect tcp/router:7447 --sim '*' record --out data/all   every server behind a router
",
    "  0  every file is complete
  1  an episode could not be recorded
  3  a file is partial: the file lists what is missing
"
);

/// `wheelarm operate`.
pub const OPERATE: &str = manual!(
    "  wheelarm operate --task pick_mustard --require-recorders 1
",
    "  0  the task succeeded
  1  it did not, or no server replied
"
);

/// `wheelarm demo`.
pub const DEMO: &str = manual!(
    "  wheelarm demo --seed 3 --out data/demo
  wheelarm demo --seeds 0..10 --camera 640x360@10
",
    "  0  every task succeeded and every file is complete
  1  one did not
  3  a file is partial
",
    "\nEnvironment:\n  WHEELARM_ASSETS   assets folder, as --assets"
);

/// `wheelarm evaluate`.
pub const EVALUATE: &str = manual!(
    "  wheelarm evaluate --task all --seeds 0..50 --jobs 4
  wheelarm evaluate --task all --seeds 0..50 --again   repeats episodes that broke
  wheelarm evaluate compare data/one data/other
  wheelarm evaluate verify data/core/robustness-core.json --rerun 5
",
    "  0  every episode of every task succeeded
  1  one did not, or a program could not be started
  3  in one of them the physics, the server or the scenario failed: episodes.jsonl
     lists it as failed, with the scenario, and the other episodes were run
",
    "\nEnvironment:\n  WHEELARM_ASSETS   assets folder, as --assets"
);

/// `wheelarm multiply`.
pub const MULTIPLY: &str = manual!(
    "  wheelarm multiply data/mine --task pick_mustard --episodes 100 --out data/more --jobs 2
  wheelarm multiply data/mine --task place_knife --episodes 20 --noise 0 --out data/exact
  wheelarm replay data/more/FILE.h5 --out data/rendered --camera '*=640x360@10'   renders one
",
    "  0  the requested number of episodes was kept
  1  fewer were kept, or nothing could be multiplied; the same command continues
",
    "\nEnvironment:\n  WHEELARM_ASSETS   assets folder, as --assets
\nThe root attribute multiplied_from of a file names its source episode. The folder's
report.json counts the attempts and their failures."
);

/// `wheelarm replay`.
pub const REPLAY: &str = manual!(
    "  wheelarm replay data/demo/pick_mustard-seed0.h5
  wheelarm replay FILE --out data/again --camera room=1280x720@10
",
    "  0  the same bits
  1  they differ (the first differing tick is named), or the file cannot be replayed
",
    "\nEnvironment:\n  WHEELARM_ASSETS   assets folder, as --assets"
);

/// `wheelarm teleop`.
pub const TELEOP: &str = manual!(
    "  wheelarm teleop
  wheelarm teleop --instruction \"Bring me the mustard\"
  ssh -t HOST wheelarm teleop --dead-man 2
  wheelarm teleop --take             takes control over from its holder
",
    "  0  you left
  1  the terminal closed, a signal arrived, or standard output is not a terminal; the
     chair was stopped
",
    "\nEnvironment:\n  NO_COLOR          no colours
\nKeys (also ? inside):
  u i o  j k l  m , .   chair; k stops; a direction stays until another key of the chair
  q z  w x  e c         both speeds, forward speed, turn rate: 10 % more, less
  v n  h f  g b         hand forward/back, left/right, up/down; Space: turn instead
  - =                   finer, coarser steps
  r y                   close, open the gripper
  Esc                   everything stops
  s  →  ← ←  d d        start, finish, redo, discard an episode
  t  p  a  !            task and seed, pause, reach shell, take control
  Ctrl-C                leave"
);

/// `wheelarm drive`.
pub const DRIVE: &str = manual!(
    "  wheelarm drive                         connects to the server of this host
  wheelarm drive --task pick_mustard --out data/drive   starts and records its own server
  ssh -N -L 7460:127.0.0.1:7460 HOST     then open the printed link here
",
    "  0  interrupted; the chair was stopped and control released
  1  no server replies, or the address cannot be used
"
);

/// `wheelarm preview`.
pub const PREVIEW: &str = manual!(
    "  wheelarm preview
  wheelarm preview --page 127.0.0.1:8000
  ssh -N -L 7450:127.0.0.1:7450 HOST   then open http://127.0.0.1:7450
",
    "  0  interrupted
  1  the address cannot be used
"
);

/// `wheelarm watch`.
pub const WATCH: &str = manual!(
    "  wheelarm watch
  wheelarm watch --once --json | jq '.streams.joint_state.rate_hz'
  wheelarm watch --only camera --cameras --duration 10
",
    "  0  measured, nothing missed
  1  no server replied, or a server of another version replied; with --once or
     at the end of --duration also when the server ended
  3  measured, samples were missed
"
);

/// `wheelarm doctor`.
pub const DOCTOR: &str = manual!(
    "  wheelarm doctor
  wheelarm doctor --server --out /data/session
",
    "  0  everything works; warnings may remain
  1  a check failed: the line after it names the fix
"
);

/// `wheelarm cache`.
pub const CACHE: &str = manual!(
    "  wheelarm cache          the folder, number and size of its entries
  wheelarm cache clear    removes all entries
",
    "  0  shown or cleared
  1  the folder cannot be listed, or an entry cannot be removed
",
    "\nEnvironment:\n  WHEELARM_CACHE    folder of the cache; off for none"
);

/// `wheelarm home`.
pub const HOME: &str = manual!(
    "  wheelarm home import FLAT.sh3d --name anna-flat
  wheelarm home import HOUSE.sh3d --name house --level 2 --without chairs,rugs
  wheelarm home make studio --style nordic --layout-seed 3 --out homes
  wheelarm home list
  wheelarm home report anna-flat --out anna-report
  wheelarm-server --scene anna-flat
",
    "  0  imported, listed or reported; what was left out is printed
  1  the file is not a home, has no closed room, or the pack or robot cannot be read or written
",
    "\nEnvironment:\n  WHEELARM_PACKS    folders of packs; an import writes into the first"
);

/// `wheelarm new`.
pub const NEW: &str = manual!(
    "  wheelarm new object my_mug
  wheelarm evaluate --packs . --scene my_mug --task pick_my_mug --seeds 0..5
  wheelarm new robot my_robot --assets assets
",
    "  0  written; the next commands are printed
  1  the name is invalid, the folder exists already, or a file cannot be written
"
);

/// `wheelarm object`.
pub const OBJECT: &str = manual!(
    "  wheelarm object import mug.glb --category mug --license CC0-1.0
  wheelarm object import can.stl --category can --scale 0.001 --up z --out packs/kitchen
  wheelarm object check mug
  wheelarm-server --objects mug --task take_anything
",
    "  0  imported or checked; what is unusual is printed
  1  the mesh, an option or the pack cannot be used
",
    "\nEnvironment:\n  WHEELARM_PACKS    folders of packs; an import writes into the first"
);

/// `wheelarm completions`.
pub const COMPLETIONS: &str = manual!(
    "  wheelarm completions bash > ~/.local/share/bash-completion/completions/wheelarm
  wheelarm completions zsh > ~/.zfunc/_wheelarm
  wheelarm completions fish > ~/.config/fish/completions/wheelarm.fish
",
    "  0  written to standard output
"
);

/// `wheelarm man`.
pub const MAN: &str = manual!(
    "  wheelarm man ~/.local/share/man/man1 && man wheelarm-teleop
",
    "  0  written
  1  the folder cannot be written
"
);

/// `wheelarm shutdown`.
pub const SHUTDOWN: &str = manual!(
    "  wheelarm shutdown
",
    "  0  the server ends; a running episode is finished first
  1  no server replied
"
);

/// `wheelarm collect`.
pub const COLLECT: &str = manual!(
    "  wheelarm collect assets/campaigns/small.toml --dry-run      episodes, samples, disk, time
  wheelarm collect assets/campaigns/small.toml                runs the missing episodes
  wheelarm collect PLAN --out DIR --shard 3/8                 one of eight parts
  wheelarm collect --merge DIR                                joins, checks, lists missing episodes
",
    "  0  every planned episode exists
  1  failed, or ended early; the same command continues
  3  episodes are missing, or the physics or a server failed: the journal has the
     scenario, and an attempt with a new seed replaced it
",
    "
Environment:
  WHEELARM_ASSETS   assets folder, as --assets
  TMPDIR            folder for the sockets of the workers, /tmp without it"
);
