//! Generates the gRPC types, and the descriptor that reflection serves. protox compiles the
//! contract in Rust, so that nobody has to install protoc.

use std::{env, error::Error, fs, path::PathBuf};

use prost::Message;

fn main() -> Result<(), Box<dyn Error>> {
    // Tables and examples are compiled in too.
    for input in ["../proto", "../migrations", "../examples"] {
        println!("cargo:rerun-if-changed={input}");
    }
    let descriptors = protox::compile(["signorini/v1/signorini.proto"], ["../proto"])?;
    let out = PathBuf::from(env::var("OUT_DIR")?);
    fs::write(out.join("descriptors.bin"), descriptors.encode_to_vec())?;
    // Ordered maps: the same answer is the same bytes.
    tonic_prost_build::configure()
        .btree_map(".")
        .compile_fds(descriptors)?;
    Ok(())
}
