//! Ctrl-C: once, and what there is so far is written; twice, or while there is nothing yet, and the program ends.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::SeqCst};

use crate::console::Console;
use crate::error::Exit;

/// Whether the user wants to stop.
#[derive(Clone, Debug, Default)]
pub(crate) struct Interrupt {
    requested: Arc<AtomicBool>,
    /// There is a result, or the beginning of one.
    working: Arc<AtomicBool>,
}

impl Interrupt {
    /// Listens for Ctrl-C from now on. SIGTERM and SIGHUP keep their meaning: `nohup` works, and an image is written
    /// whole or not at all anyway. `then` says what becomes of the first Ctrl-C.
    pub(crate) fn listen(console: Console, then: &'static str) -> Self {
        let interrupt = Self::default();
        let heard = interrupt.clone();
        // Without a handler Ctrl-C still ends the program: nothing to report.
        let _ = ctrlc::set_handler(move || {
            let again = heard.requested.swap(true, SeqCst);
            if again || !heard.working.load(SeqCst) {
                std::process::exit(Exit::Interrupted as i32);
            }
            console.say(format_args!("\ninterrupted: {then} (again: quit at once)"));
        });
        interrupt
    }

    /// From now on the first Ctrl-C only asks to stop.
    pub(crate) fn begin(&self) {
        self.working.store(true, SeqCst);
    }

    /// Whether it was asked to stop.
    pub(crate) fn requested(&self) -> bool {
        self.requested.load(SeqCst)
    }
}
