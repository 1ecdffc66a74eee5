//! Shows the progress of a solution: a line for each iteration and, on a terminal, the present state below these lines.

use std::{collections::VecDeque, io::IsTerminal, time::Duration};

use indicatif::{ProgressBar, ProgressStyle};
use solver::solution::{Iteration, Phase, Warning};

use super::{output, report};

/// The largest number of residuals that the curve in the state shows.
const CURVE: usize = 24;

/// The stream to which lines are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum To {
    /// Standard output: the lines are the output of the command.
    Output,
    /// Standard error: the lines accompany the output of the command.
    Error,
}

/// Shows one solution: prints its lines, and shows its present state.
pub(super) struct View {
    to: To,
    bar: ProgressBar,
    residuals: VecDeque<f64>,
    tolerance: f64,
    state: String,
    headed: bool,
}

impl View {
    pub(super) fn new(to: To) -> View {
        // drawn on standard error, and only if that is a terminal
        let bar = ProgressBar::new_spinner();
        let style = ProgressStyle::with_template("{spinner} {elapsed} {msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()));
        bar.enable_steady_tick(Duration::from_millis(120));
        View {
            to,
            bar,
            residuals: VecDeque::new(),
            tolerance: 0.0,
            state: String::new(),
            headed: false,
        }
    }

    /// Prints a line above the state.
    pub(super) fn line(&self, text: &str) -> std::io::Result<()> {
        self.bar.suspend(|| match self.to {
            To::Output => output::print(&format!("{text}\n")),
            To::Error => {
                eprintln!("{text}");
                Ok(())
            }
        })
    }

    /// Shows the present state.
    pub(super) fn state(&mut self, state: &str) {
        state.clone_into(&mut self.state);
        let curve = if self.residuals.is_empty() {
            String::new()
        } else {
            format!(
                "  residual {} → {:.0e}",
                sparkline(&self.residuals),
                self.tolerance
            )
        };
        self.bar.set_message(format!("{}{curve}", self.state));
    }

    /// Shows that a phase begins: as the state on a terminal, otherwise as a line, unless the lines are the output of
    /// the command.
    pub(super) fn phase(&mut self, phase: Phase) -> std::io::Result<()> {
        let words = report::phase(phase);
        if self.to == To::Error && !std::io::stderr().is_terminal() {
            self.line(&format!("{words} …"))?;
        }
        self.state(words);
        Ok(())
    }

    pub(super) fn iteration(&mut self, row: &Iteration) -> std::io::Result<()> {
        if !self.headed {
            self.headed = true;
            if std::io::stderr().is_terminal() {
                self.line("   k  stage         residuals                              contact (entered, left)")?;
            }
        }
        self.residuals
            .push_back(row.residual.max(row.friction_residual));
        self.tolerance = row.tolerance;
        if self.residuals.len() > CURVE {
            self.residuals.pop_front();
        }
        self.line(&report::iteration(row))?;
        let state = self.state.clone();
        self.state(&state);
        Ok(())
    }

    pub(super) fn warning(&self, warning: &Warning) -> std::io::Result<()> {
        self.line(&format!(
            "{}: {}: {}",
            <&str>::from(warning.code.severity()),
            warning.pointer,
            warning.message
        ))
    }

    /// Starts the curve of residuals anew, when the job is solved again.
    pub(super) fn anew(&mut self) {
        self.residuals.clear();
    }

    /// Removes the state from the terminal.
    pub(super) fn end(&self) {
        self.bar.finish_and_clear();
    }
}

/// Draws numbers as a curve of block characters, by their logarithms: the highest block is the largest number. No crate
/// draws a curve in a line of text without managing the whole screen.
fn sparkline(numbers: &VecDeque<f64>) -> String {
    const BLOCKS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let logarithms: Vec<f64> = numbers
        .iter()
        .map(|number| number.max(1e-300).log10())
        .collect();
    let least = logarithms.iter().copied().fold(f64::INFINITY, f64::min);
    let most = logarithms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let block = |logarithm: &f64| {
        let part = (logarithm - least) / (most - least).max(f64::MIN_POSITIVE);
        // from 0 to 1: the cast cannot fail
        BLOCKS[((part * 7.0).round() as usize).min(7)]
    };
    logarithms.iter().map(block).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_residual_that_falls_is_a_curve_that_falls() {
        let falling = VecDeque::from([1.0, 1e-2, 1e-7]);
        assert_eq!(sparkline(&falling), "█▆▁");
        assert_eq!(sparkline(&VecDeque::from([3.0])), "▁");
    }
}
