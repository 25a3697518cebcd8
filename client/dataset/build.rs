//! Compiles Foxglove's messages, and both packages' descriptors, which stand in
//! exported files, without an installed `protoc`.

use prost::Message;

const OURS: [&str; 2] = ["wheelarm/v1/stream.proto", "wheelarm/v1/command.proto"];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo:rerun-if-changed=proto");
    println!("cargo:rerun-if-changed=../../proto/wheelarm");
    let out = std::path::PathBuf::from(std::env::var("OUT_DIR")?);
    let foxglove = protox::compile(["foxglove.proto"], ["proto"])?;
    std::fs::write(out.join("foxglove.bin"), foxglove.encode_to_vec())?;
    prost_build::Config::new().compile_fds(foxglove)?;
    let ours = protox::compile(OURS, ["../../proto"])?;
    std::fs::write(out.join("wheelarm.bin"), ours.encode_to_vec())?;
    Ok(())
}
