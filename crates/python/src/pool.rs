//! Threads, kept from call to call.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error;

/// The pools of a process, by how many threads were asked for.
struct Pools {
    process: u32,
    by_threads: HashMap<usize, Arc<ThreadPool>>,
}

static POOLS: Mutex<Option<Pools>> = Mutex::new(None);

/// The most threads that may be asked for.
const MOST: usize = 1024;

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
    let pools = pools.get_or_insert_with(|| Pools { process, by_threads: HashMap::new() });
    if let Some(pool) = pools.by_threads.get(&threads) {
        return Ok(pool.clone());
    }
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = Arc::new(pool.map_err(|e| error::value(format_args!("threads={threads}: {e}")))?);
    pools.by_threads.insert(threads, pool.clone());
    Ok(pool)
}
