//! Progress on a terminal, and Ctrl-C.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use runtime::error::Error;
use runtime::render::Progress;
use std::io::IsTerminal;
use std::sync::atomic::{AtomicU32, Ordering};

/// Steps of the bar.
const STEPS: u64 = 1000;
/// Exit code after a second Ctrl-C, as shells expect of an interrupted program.
const INTERRUPTED: i32 = 130;

static INTERRUPTS: AtomicU32 = AtomicU32::new(0);

/// Makes Ctrl-C finish the current samples, and a second one stop at once.
///
/// # Errors
/// Failed, when the handler cannot be set.
pub fn catch_interrupts() -> Result<(), Error> {
    ctrlc::set_handler(|| {
        if INTERRUPTS.fetch_add(1, Ordering::SeqCst) > 0 {
            std::process::exit(INTERRUPTED);
        }
        super::say("\nstopping after the current samples; Ctrl-C again stops at once and loses them");
    })
    .map_err(|error| Error::failed(format!("cannot catch Ctrl-C: {error}")))
}

/// Whether Ctrl-C was pressed.
pub fn interrupted() -> bool {
    INTERRUPTS.load(Ordering::SeqCst) > 0
}

/// A bar with samples, rate and time left; silent when stderr is no terminal.
pub fn bar() -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::hidden());
    }
    let bar = ProgressBar::new(STEPS);
    // The template is a constant; the default style is as good should it ever be wrong.
    let style = ProgressStyle::with_template("{wide_bar} {msg}").unwrap_or_else(|_| ProgressStyle::default_bar());
    bar.set_style(style);
    bar
}

/// Shows how far a render is.
pub fn show(bar: &ProgressBar, progress: &Progress) {
    let taken = progress.taken as f64 * 1e-6;
    let rate = progress.per_second * 1e-6;
    let mut message = format!("{taken:.1} Msamples at {rate:.2} M/s");
    if let Some(part) = progress.part {
        bar.set_position((part * STEPS as f64) as u64);
        if part > 0.0 {
            let left = bar.elapsed().as_secs_f64() * (1.0 - part) / part;
            message.push_str(&format!(", {left:.0} s left"));
        }
    }
    bar.set_message(message);
}
