//! `triplanar token`.

use std::io::{self, Write as _};

use rand::Rng as _;
use sha2::{Digest, Sha256};

use super::{Failed, output};
use crate::config::Role;

/// Bytes of randomness in a token.
const RANDOM_BYTES: usize = 32;

/// Make bearer tokens: their lines for the configuration, and the tokens themselves
///
/// Standard output gets what is to be pasted under [http] in the configuration; the tokens, which the
/// service can't tell again, go to standard error. Several are made by several --role, each with its
/// --name.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// What a token allows; once for each token
    #[arg(long, value_enum, required = true)]
    role: Vec<Role>,
    /// Whose it is, in the order of the roles; stands in the log [default: the role's name]
    #[arg(long, value_parser = name)]
    name: Vec<String>,
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

pub(super) fn run(args: Args) -> Result<(), Failed> {
    if args.name.len() > args.role.len() {
        return Err(Failed::usage("there are more names than roles"));
    }
    let mut lines = String::from("tokens = [\n");
    for (index, role) in args.role.iter().enumerate() {
        let name = args.name.get(index).map_or(role.name(), String::as_str);
        let mut random = [0_u8; RANDOM_BYTES];
        rand::rng().fill_bytes(&mut random);
        let token = hex::encode(random);
        let digest = hex::encode(Sha256::digest(&token));
        show(&format!("token of {name} (shown once, keep it secret): {token}"))?;
        lines.push_str(&format!(
            "  {{ name = \"{name}\", role = \"{}\", sha256 = \"{digest}\" }},\n",
            role.name()
        ));
    }
    show("to be pasted under [http] in the configuration; of two lists make one:")?;
    lines.push_str("]\n");
    output::print(lines)
}

/// A line on standard error: what is shown once must be seen.
fn show(line: &str) -> Result<(), Failed> {
    writeln!(io::stderr(), "{line}")
        .map_err(|error| Failed::internal(format!("standard error can't be written: {error}")))
}
