//! `triplanar token`.

use rand::Rng as _;
use sha2::{Digest, Sha256};

use super::Failed;
use crate::config::Role;

/// Bytes of randomness in a token.
const RANDOM_BYTES: usize = 32;

/// Make a bearer token and print it with the line for the configuration
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// What the token allows
    #[arg(long, value_enum)]
    role: Role,
    /// Whose it is; stands in the log
    #[arg(long, default_value = "unnamed", value_parser = name)]
    name: String,
}

/// The name stands inside quotes in TOML and in log lines.
fn name(text: &str) -> Result<String, &'static str> {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_.@ ".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) {
        Ok(text.to_owned())
    } else {
        Err("letters, digits, blank and - _ . @ alone")
    }
}

pub(super) fn run(Args { role, name }: Args) -> Result<(), Failed> {
    let mut random = [0_u8; RANDOM_BYTES];
    rand::rng().fill_bytes(&mut random);
    let token = hex::encode(random);
    let digest = hex::encode(Sha256::digest(&token));
    println!("token (shown once, keep it secret): {token}");
    println!(
        "line for [http] tokens: {{ name = \"{name}\", role = \"{}\", sha256 = \"{digest}\" }}",
        role.name()
    );
    Ok(())
}
