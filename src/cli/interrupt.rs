//! Ctrl-C and SIGTERM: the first asks the run to stop, which it does at the next row of pixels; the second ends the
//! program at once.

use super::say;
use buzz::error::Error;
use buzz::frame::{FrameId, FrameKind, FrameStats};
use buzz::output::remove_temporary_files;
use buzz::sequence::Observer;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering::SeqCst};

/// Whether the user asked to stop.
#[derive(Debug, Default)]
pub struct Interrupt {
    /// Number of the last signal; 0 if none came.
    signal: AtomicI32,
    /// Something is being written: the run must be left to finish it.
    writing: AtomicBool,
}

impl Interrupt {
    /// Watches for signals from now on. Until [`Interrupt::writing`], the first ends the program too. `advice` tells the user how
    /// to go on.
    pub fn watch(advice: &'static str) -> std::io::Result<Arc<Self>> {
        let mut signals = Signals::new([SIGINT, SIGTERM])?;
        let interrupt = Arc::new(Self::default());
        let shared = Arc::clone(&interrupt);
        std::thread::Builder::new().name("buzz-signals".into()).spawn(move || {
            for signal in signals.forever() {
                let first = shared.signal.swap(signal, SeqCst) == 0;
                if !(first && shared.writing.load(SeqCst)) {
                    remove_temporary_files();
                    say::complain(format_args!("{}{advice}", Error::Interrupted { signal }));
                    std::process::exit(128 + signal);
                }
            }
        })?;
        Ok(interrupt)
    }

    /// From now on the first signal is left to the run.
    pub fn writing(&self) {
        self.writing.store(true, SeqCst);
    }
}

impl Observer for Interrupt {
    fn frame_done(&mut self, _: FrameId, _: FrameKind, _: &FrameStats, _: bool) {}

    fn stop_requested(&self) -> Option<i32> {
        Some(self.signal.load(SeqCst)).filter(|&signal| signal != 0)
    }
}
