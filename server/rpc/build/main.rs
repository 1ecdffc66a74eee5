//! Generates the gRPC types, the conversions between them and our types, and the descriptor that reflection
//! serves. protox compiles the contract in Rust, so that protoc need not be installed.

mod conversions;
mod mirrors;

use std::{env, error::Error, fs, path::PathBuf};

use prost::Message;
use protox::prost_reflect::DescriptorPool;

fn main() -> Result<(), Box<dyn Error>> {
    for input in ["build", "../../proto"] {
        println!("cargo:rerun-if-changed={input}");
    }
    let contracts = [
        "signorini/v1/signorini.proto",
        "signorini/worker/v1/worker.proto",
    ];
    let descriptors = protox::compile(contracts, ["../../proto"])?;
    let out = PathBuf::from(env::var("OUT_DIR")?);
    fs::write(out.join("descriptors.bin"), descriptors.encode_to_vec())?;
    let pool = DescriptorPool::from_file_descriptor_set(descriptors.clone())?;
    fs::write(out.join("conversions.rs"), conversions::source(&pool)?)?;
    let mut types = prost_build::Config::new();
    // Ordered maps, so that equal responses have equal bytes; names, by which the codec finds a message's descriptor.
    types.btree_map(["."]).enable_type_names();
    tonic_prost_build::configure()
        .codec_path("crate::codec::Codec")
        .compile_fds_with_config(descriptors, types)?;
    Ok(())
}
