//! Hostile inputs from good ones: changes bytes, numbers, words and order, and keeps what led to an answer that was
//! not seen before, so that later inputs go further.
//!
//! Written here: cargo-fuzz needs a nightly compiler, afl and honggfuzz a C compiler and a process of their own for
//! each target; both guide by branches taken, this by the answers of the program, which distinguish its refusals by
//! kind and place. The cases follow from a seed: each failure names what repeats it.
//!
//! `SIGNORINI_FUZZ_SECONDS` runs every target that long instead of a number of cases; `SIGNORINI_FUZZ_SEED` chooses
//! other cases; `SIGNORINI_FUZZ_CORPUS` is a folder that keeps what was found, from run to run.

use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// No input may take longer. The slowest takes a tenth of it, but the tests share the machine.
const LONGEST: Duration = Duration::from_secs(2);

/// Inputs may grow to this.
const LARGEST: usize = 128 << 10;

/// What a number becomes.
const NUMBERS: [&str; 18] = [
    "0",
    "-1",
    "1",
    "2",
    "7",
    "65536",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551615",
    "-9223372036854775808",
    "1e308",
    "1e999",
    "-1e-320",
    "0.1",
    "nan",
    "inf",
    "999999999999999999999999999999999999999999",
];

/// Bytes with a meaning in some format.
const BYTES: &[u8] = b"\0\n\r\t \"#$%&'()*+,-./0:;<=>?@AZ[\\]^_`az{|}~\x7f\x80\xbf\xc3\xff";

/// An attack on one reader.
#[derive(Debug)]
pub struct Target<'a> {
    /// Its name, in figures and failures.
    pub name: &'a str,
    /// Good inputs.
    pub seeds: Vec<Vec<u8>>,
    /// Words that mean something to the reader.
    pub words: &'a [&'a str],
    /// Cases of a short run.
    pub cases: u64,
}

/// What an attack came to.
#[derive(Clone, Debug)]
pub struct Figures {
    /// Inputs that were read.
    pub cases: u64,
    /// Inputs with an answer of their own, the seeds among them.
    pub corpus: usize,
    /// Different answers.
    pub answers: usize,
    /// The longest time for one input.
    pub slowest: Duration,
}

impl Target<'_> {
    /// Gives changed inputs to `read`, which names the kind of its answer: the same name for what is alike.
    ///
    /// Panics if `read` does, or takes too long, and leaves the input in `target/fuzz`.
    pub fn attack(self, read: impl Fn(&[u8]) -> String) -> Figures {
        let seconds = setting("SIGNORINI_FUZZ_SECONDS");
        let mut dice = Dice(setting("SIGNORINI_FUZZ_SEED").unwrap_or(1));
        let kept = std::env::var_os("SIGNORINI_FUZZ_CORPUS");
        let kept = kept.map(|folder| PathBuf::from(folder).join(self.name));
        let mut corpus = self.seeds.clone();
        corpus.extend(kept.as_deref().map(inputs).unwrap_or_default());
        assert!(!corpus.is_empty(), "{} has no seeds", self.name);
        let (mut answers, mut cases, mut slowest) = (BTreeSet::new(), 0, Duration::ZERO);
        let mut one = |input: &[u8]| -> bool {
            let began = Instant::now();
            let answer = catch_unwind(AssertUnwindSafe(|| read(input)));
            let took = began.elapsed();
            slowest = slowest.max(took);
            match answer {
                Ok(answer) if took < LONGEST => answers.insert(answer),
                Ok(_) => self.fail(input, &format!("took {took:?}")),
                Err(_) => self.fail(input, "panicked"),
            }
        };
        let seeds = corpus.clone();
        for seed in &seeds {
            one(seed);
        }
        let began = Instant::now();
        let more = |cases: u64| match seconds {
            Some(seconds) => began.elapsed() < Duration::from_secs(seconds),
            None => cases < self.cases,
        };
        while more(cases) {
            let mut input = corpus[dice.below(corpus.len())].clone();
            for _ in 0..1 + dice.below(4) {
                let other = dice.below(corpus.len());
                change(&mut input, &corpus[other], self.words, &mut dice);
            }
            input.truncate(LARGEST);
            cases += 1;
            if one(&input) {
                if let Some(folder) = &kept {
                    keep(folder, &input);
                }
                corpus.push(input);
            }
        }
        let figures = Figures {
            cases,
            corpus: corpus.len(),
            answers: answers.len(),
            slowest,
        };
        println!(
            "fuzz {}: {} executions in {:.0} s, corpus {}, answers {}, slowest {:.0} ms",
            self.name,
            figures.cases,
            began.elapsed().as_secs_f64(),
            figures.corpus,
            figures.answers,
            1e3 * slowest.as_secs_f64(),
        );
        figures
    }

    fn fail(&self, input: &[u8], what: &str) -> ! {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/fuzz");
        let file = keep(&folder, input);
        panic!(
            "{}: an input of {} bytes {what}; it is in {}",
            self.name,
            input.len(),
            file.display()
        );
    }
}

fn setting(name: &str) -> Option<u64> {
    let text = std::env::var(name).ok()?;
    Some(
        text.parse()
            .unwrap_or_else(|_| panic!("{name}={text} is not a number")),
    )
}

/// The files of a folder, in the order of their names; none if there is no such folder.
pub fn inputs(folder: &Path) -> Vec<Vec<u8>> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths
        .iter()
        .map(|path| std::fs::read(path).unwrap())
        .collect()
}

fn keep(folder: &Path, input: &[u8]) -> PathBuf {
    std::fs::create_dir_all(folder).unwrap();
    // FNV-1a: the same input has the same name in every run
    let name = input.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3)
    });
    let file = folder.join(format!("{name:016x}"));
    std::fs::write(&file, input).unwrap();
    file
}

/// One change of an input; `other` is another one, to take parts from.
fn change(input: &mut Vec<u8>, other: &[u8], words: &[&str], dice: &mut Dice) {
    let at = dice.below(input.len() + 1);
    let length = dice.short(9);
    let end = input.len().min(at + length);
    match dice.below(10) {
        0 if at < input.len() => input[at] = BYTES[dice.below(BYTES.len())],
        1 if at < input.len() => input[at] ^= 1 << dice.below(8),
        2 => drop(input.drain(at..end)),
        3 => {
            let part = input[at..end].to_vec();
            let times = 1 + dice.short(8);
            input.splice(at..at, part.repeat(times.min(LARGEST / part.len().max(1))));
        }
        4 | 5 => {
            let digit = |b: &u8| b.is_ascii_digit();
            let Some(start) = input[at..].iter().position(digit).map(|k| at + k) else {
                return;
            };
            let rest = input[start..].iter().position(|b| !digit(b));
            let end = rest.map_or(input.len(), |k| start + k);
            input.splice(start..end, NUMBERS[dice.below(NUMBERS.len())].bytes());
        }
        6 if !words.is_empty() => {
            let word = words[dice.below(words.len())].as_bytes();
            input.splice(
                at..end.min(at + word.len() * dice.below(2)),
                word.iter().copied(),
            );
        }
        7 => {
            // from another input
            let from = dice.below(other.len() + 1);
            let part = &other[from..other.len().min(from + length)];
            input.splice(at..at, part.iter().copied());
        }
        8 => input.truncate(at),
        _ => {
            // two parts change places
            let middle = at + (end - at) / 2;
            input[at..end].rotate_left(middle - at);
        }
    }
}

impl Dice {
    /// A number below 2^`bits`; small ones are as likely as large ones.
    fn short(&mut self, bits: usize) -> usize {
        let bits = self.below(bits);
        self.below(1 << bits)
    }
}

/// A generator of random numbers (SplitMix64): the same numbers from the same seed, everywhere.
struct Dice(u64);

impl Dice {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ (mixed >> 31)) % end.max(1) as u64) as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target() -> Target<'static> {
        Target {
            name: "self",
            seeds: vec![b"{\"a\": 1}".to_vec()],
            words: &["b"],
            cases: 20_000,
        }
    }

    #[test]
    fn an_attack_finds_what_is_rare_by_keeping_what_is_new() {
        // each step is seen only by an input that has made the one before
        let depth = |input: &[u8]| {
            let steps: [&[u8]; 3] = [b"b", b"bb", b"bbb"];
            steps
                .iter()
                .filter(|step| input.windows(step.len()).any(|w| w == **step))
                .count()
        };
        let figures = target().attack(|input| depth(input).to_string());
        assert_eq!(figures.answers, 4);
        assert!(figures.corpus >= 4);
    }

    #[test]
    fn a_panic_is_a_failure_that_leaves_its_input() {
        let attack = || {
            target().attack(|input| {
                assert!(!input.contains(&b'['), "a bracket");
                String::new()
            })
        };
        let failed = catch_unwind(attack).unwrap_err();
        let words = failed.downcast_ref::<String>().unwrap();
        let file = words.rsplit(' ').next().unwrap();
        assert!(std::fs::read(file).unwrap().contains(&b'['), "{words}");
        std::fs::remove_file(file).unwrap();
    }
}
