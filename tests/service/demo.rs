//! `signorini demo`.

use std::process::Command;

use crate::SIGNORINI;

#[test]
fn the_demo_solves_five_examples_over_both_protocols_and_draws_one() {
    // a proxy at an address without a listener: the demo must connect to itself directly
    let output = Command::new(SIGNORINI)
        .arg("demo")
        .env("HTTP_PROXY", "http://127.0.0.1:9")
        .env("http_proxy", "http://127.0.0.1:9")
        .output()
        .unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(
        output.status.code(),
        Some(0),
        "{text}\n{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let verdicts = text
        .lines()
        .filter(|line| line.contains(" good: normal force "));
    assert_eq!(verdicts.count(), 5, "{text}");
    assert!(
        text.contains("Both protocols gave the same bits") && text.contains("σ_n"),
        "{text}"
    );
    assert!(text.contains("signorini serve"), "{text}");
    // it is read from beginning to end
    assert!(text.lines().count() < 50, "{text}");
    assert!(
        !text.contains('\x1b'),
        "plain lines where there is no terminal"
    );
}
