//! Compiles Foxglove's messages and their descriptors, which are stored in exported
//! files, without an installed `protoc`.

use prost::Message;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo:rerun-if-changed=proto");
    let out = std::path::PathBuf::from(std::env::var("OUT_DIR")?);
    let foxglove = protox::compile(["foxglove.proto"], ["proto"])?;
    std::fs::write(out.join("foxglove.bin"), foxglove.encode_to_vec())?;
    prost_build::Config::new()
        .enable_type_names()
        .compile_fds(foxglove)?;
    Ok(())
}
