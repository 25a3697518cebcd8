//! Compiles the `.proto` files without an installed `protoc`.

const FILES: [&str; 5] = [
    "wheelarm/v1/common.proto",
    "wheelarm/v1/scenario.proto",
    "wheelarm/v1/command.proto",
    "wheelarm/v1/stream.proto",
    "wheelarm/v1/control.proto",
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo:rerun-if-changed=wheelarm");
    let files = protox::compile(FILES, ["."])?;
    prost_build::Config::new()
        .bytes([
            ".wheelarm.v1.CameraFrame",
            ".wheelarm.v1.PreviewFrame",
            ".wheelarm.v1.SnapshotReply.snapshot",
            ".wheelarm.v1.ResetRequest.snapshot",
        ])
        .compile_fds(files)?;
    Ok(())
}
