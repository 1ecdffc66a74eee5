//! `signorini demo`.

use std::process::Command;

use crate::SIGNORINI;

#[test]
fn the_demo_solves_five_examples_over_both_protocols_and_prints_a_profile() {
    // A proxy where nobody listens: the demo speaks with itself.
    let output = Command::new(SIGNORINI)
        .arg("demo")
        .env("HTTP_PROXY", "http://127.0.0.1:9")
        .env("http_proxy", "http://127.0.0.1:9")
        .output()
        .unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    assert_eq!(
        output.status.code(),
        Some(0),
        "{said}\n{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert_eq!(
        said.lines()
            .filter(|line| line.contains("converged after"))
            .count(),
        10,
        "{said}"
    );
    assert_eq!(
        said.lines()
            .filter(|line| line.contains("same bits"))
            .count(),
        5,
        "{said}"
    );
    assert!(said.contains("σ_n") && said.contains("slip"), "{said}");
    assert!(
        !said.contains('\x1b'),
        "plain lines where there is no terminal"
    );
}
