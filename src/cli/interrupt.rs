//! Ctrl-C and SIGTERM: the first asks to stop after the frame at hand, the second stops at once.

use signal_hook::consts::{SIGINT, SIGTERM};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize};

/// Watches for signals; the number of the first that comes is stored in the value returned.
pub fn watch() -> std::io::Result<Arc<AtomicUsize>> {
    let signal = Arc::new(AtomicUsize::new(0));
    for number in [SIGINT, SIGTERM] {
        // The order matters: the shutdown is armed by the signal before.
        let armed = Arc::new(AtomicBool::new(false));
        signal_hook::flag::register_conditional_shutdown(number, 128 + number, Arc::clone(&armed))?;
        signal_hook::flag::register(number, armed)?;
        signal_hook::flag::register_usize(number, Arc::clone(&signal), number as usize)?;
    }
    Ok(signal)
}
