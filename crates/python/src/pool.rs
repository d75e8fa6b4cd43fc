//! Threads, kept from call to call.

use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error;

/// The pools of a process.
struct Pools {
    process: u32,
    /// By how many threads were asked for, the last used at the end.
    by_threads: Vec<(usize, Arc<ThreadPool>)>,
}

static POOLS: Mutex<Option<Pools>> = Mutex::new(None);

/// The most threads that may be asked for.
const MOST: usize = 1024;

/// How many pools are kept. The threads of another one end when nothing works on them any more.
const KEPT: usize = 3;

/// Threads to work on; 0: one for each core. Not rayon's own pool: a process that was forked has none of its parent's
/// threads, and would wait for them forever.
///
/// # Errors
/// When there can be no such threads.
pub(crate) fn pool(threads: usize) -> PyResult<Arc<ThreadPool>> {
    if threads > MOST {
        return Err(error::value(format_args!("threads={threads}: at most {MOST}")));
    }
    // It is locked only while Python is held, so no fork happens meanwhile.
    let mut pools = POOLS.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    if pools.as_ref().is_some_and(|p| p.process != process) {
        // The parent's: there is nobody to end.
        std::mem::forget(pools.take());
    }
    let pools = pools.get_or_insert_with(|| Pools { process, by_threads: Vec::new() });
    let by_threads = &mut pools.by_threads;
    if let Some(i) = by_threads.iter().position(|(n, _)| *n == threads) {
        by_threads[i..].rotate_left(1);
        return Ok(by_threads[by_threads.len() - 1].1.clone());
    }
    // Before there are more threads.
    by_threads.drain(..by_threads.len().saturating_sub(KEPT - 1));
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = Arc::new(pool.map_err(|e| error::value(format_args!("threads={threads}: {e}")))?);
    by_threads.push((threads, pool.clone()));
    Ok(pool)
}
