//! Tokens, by which clients are identified.
//!
//! A token is `sgn_<id>_<secret>`. The id, which is not secret, finds the record; only the SHA-256 of the secret is
//! stored, and compared in constant time. The secret has 256 random bits, so that neither guessing nor a stolen record
//! reveals it.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
};

use base64::{Engine, prelude::BASE64_URL_SAFE_NO_PAD};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use subtle::ConstantTimeEq;

use crate::{
    caller::{Caller, Scope},
    time::Time,
};

/// The prefix of every token, by which people and scanners for leaked secrets recognise it.
const PREFIX: &str = "sgn_";

/// The number of bytes of an id, written in hexadecimal digits.
const ID_BYTES: usize = 6;

/// The number of bytes of a secret.
const SECRET_BYTES: usize = 32;

/// A token, without its secret.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Token {
    /// The id, which is not secret: the token begins with `sgn_` and this.
    pub id: String,
    /// A name for people, such as where the token is used.
    pub name: String,
    /// The owner of the jobs that are submitted with the token.
    pub owner: String,
    /// The scopes of the token.
    pub scopes: BTreeSet<Scope>,
    /// The time when the token was created.
    pub created_at: Time,
    /// The time from which the token is refused; null: never.
    pub expires_at: Option<Time>,
    /// The time since which the token is refused; null: it was not revoked.
    pub revoked_at: Option<Time>,
}

impl Token {
    /// Whether the token is accepted at this time.
    pub fn is_valid(&self, now: Time) -> bool {
        self.revoked_at.is_none() && self.expires_at.is_none_or(|end| now < end)
    }

    /// The caller that the token identifies.
    pub fn caller(&self) -> Caller {
        Caller::new(self.owner.clone(), self.scopes.iter().copied())
    }
}

/// The tokens by their ids, each with the hash of its secret.
pub type Tokens = BTreeMap<String, (Token, SecretHash)>;

/// The hash of a secret, which is stored instead of the secret.
#[derive(Clone, Copy)]
pub struct SecretHash(pub [u8; 32]);

impl SecretHash {
    fn of(secret: &str) -> SecretHash {
        SecretHash(Sha256::digest(secret.as_bytes()).into())
    }
}

impl PartialEq for SecretHash {
    /// Compares in a time that does not depend on how many bytes are equal.
    fn eq(&self, other: &SecretHash) -> bool {
        self.0.ct_eq(&other.0).into()
    }
}

impl fmt::Debug for SecretHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("SecretHash(…)")
    }
}

/// A token as a client sends it: its id, and the hash of its secret.
#[derive(Clone, Debug)]
pub struct Presented {
    /// The id.
    pub id: String,
    /// The hash of the secret.
    pub hash: SecretHash,
}

impl Presented {
    /// Reads a token; `None` if the text is not a token.
    pub fn parse(text: &str) -> Option<Presented> {
        let (id, secret) = text.strip_prefix(PREFIX)?.split_once('_')?;
        let hex = |byte: u8| byte.is_ascii_digit() || (b'a'..=b'f').contains(&byte);
        if id.len() != 2 * ID_BYTES || !id.bytes().all(hex) {
            return None;
        }
        let bytes = BASE64_URL_SAFE_NO_PAD.decode(secret).ok()?;
        (bytes.len() == SECRET_BYTES).then(|| Presented {
            id: id.into(),
            hash: SecretHash::of(secret),
        })
    }
}

/// The whole text of a new token, which is shown only once. The type cannot be printed by accident.
#[derive(Clone, PartialEq, Eq)]
pub struct Secret(String);

impl Secret {
    /// A secret for a token with this id.
    pub fn new(id: &str) -> Result<(Secret, SecretHash), getrandom::Error> {
        let secret = BASE64_URL_SAFE_NO_PAD.encode(random::<SECRET_BYTES>()?);
        let hash = SecretHash::of(&secret);
        Ok((Secret(format!("{PREFIX}{id}_{secret}")), hash))
    }

    /// The text, for the owner alone.
    pub fn reveal(self) -> String {
        self.0
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Secret(…)")
    }
}

/// The id of a new token.
pub fn new_id() -> Result<String, getrandom::Error> {
    let bytes = random::<ID_BYTES>()?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

fn random<const N: usize>() -> Result<[u8; N], getrandom::Error> {
    let mut bytes = [0; N];
    getrandom::fill(&mut bytes)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_token_is_known_by_its_id_and_the_hash_of_its_secret() {
        let id = new_id().unwrap();
        let (secret, hash) = Secret::new(&id).unwrap();
        let text = secret.clone().reveal();
        let presented = Presented::parse(&text).unwrap();
        assert_eq!(presented.id, id);
        assert_eq!(presented.hash, hash);
        let (other, other_hash) = Secret::new(&id).unwrap();
        assert_ne!(other, secret);
        assert!(other_hash != hash);
        assert!(!format!("{secret:?} {presented:?}").contains(&text[20..]));
    }

    #[test]
    fn a_text_that_is_no_token_is_not_read() {
        let (secret, _) = Secret::new("0123456789ab").unwrap();
        let text = secret.reveal();
        assert!(Presented::parse(&text).is_some());
        for wrong in [
            "",
            "sgn_",
            "sgn__",
            "sgn_0123456789ab",
            "sgn_0123456789ab_",
            "sgn_0123456789AB_x",
            &text[1..],
            &text[..text.len() - 1],
            &format!("{text}A"),
            &text.replace("sgn_0", "sgn_g"),
        ] {
            assert!(Presented::parse(wrong).is_none(), "{wrong}");
        }
    }

    #[test]
    fn a_token_is_valid_until_it_expires_or_is_revoked() {
        let at = |s: i64| Time::from_micros(s * 1_000_000);
        let token = Token {
            id: "0123456789ab".into(),
            name: "laptop".into(),
            owner: "ada".into(),
            scopes: [Scope::Read].into(),
            created_at: at(0),
            expires_at: Some(at(10)),
            revoked_at: None,
        };
        assert!(token.is_valid(at(9)) && !token.is_valid(at(10)));
        let forever = Token {
            expires_at: None,
            ..token.clone()
        };
        assert!(forever.is_valid(at(1 << 30)));
        let revoked = Token {
            revoked_at: Some(at(5)),
            ..forever
        };
        assert!(!revoked.is_valid(at(5)));
        assert_eq!(token.caller(), Caller::new("ada", [Scope::Read]));
    }
}
