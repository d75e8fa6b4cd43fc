//! What is left to visit.

use core::mem::MaybeUninit;

use crate::build::MAX_DEPTH;

/// Each level of a tree leaves at most seven children behind, and eight are written at once.
const SIZE: usize = 7 * MAX_DEPTH as usize + 8;

/// A stack of keys, distance above and child below. It lives on the machine's stack and is not cleared first: that
/// would cost as much as a short ray.
pub(crate) struct Stack {
    entries: [MaybeUninit<u64>; SIZE],
    len: usize,
}

impl Stack {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self { entries: [const { MaybeUninit::uninit() }; SIZE], len: 0 }
    }

    /// Puts the first `n` (at most 8) of these keys on top, the last of them topmost.
    ///
    /// # Panics
    /// If the stack is full, which no tree of bounded depth brings about.
    #[inline(always)]
    pub(crate) fn push(&mut self, keys: &[u64; 8], n: usize) {
        assert!(self.len + 8 <= SIZE && n <= 8, "trees are not so deep");
        for (slot, key) in self.entries[self.len..self.len + 8].iter_mut().zip(keys) {
            slot.write(*key);
        }
        self.len += n;
    }

    #[inline(always)]
    pub(crate) fn pop(&mut self) -> Option<u64> {
        self.len = self.len.checked_sub(1)?;
        // SAFETY: every entry below `len` was written by `push`, and `len` is below SIZE.
        Some(unsafe { self.entries.get_unchecked(self.len).assume_init() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn last_in_first_out_up_to_the_deepest_tree() {
        let mut stack = Stack::new();
        let mut twin = Vec::new();
        for level in 0..u64::from(MAX_DEPTH) {
            let keys = core::array::from_fn(|k| level * 8 + k as u64);
            let n = if level % 3 == 0 { 7 } else { level as usize % 8 };
            stack.push(&keys, n);
            twin.extend_from_slice(&keys[..n]);
            if level % 4 == 1 {
                assert_eq!(stack.pop(), twin.pop());
            }
        }
        while let Some(key) = twin.pop() {
            assert_eq!(stack.pop(), Some(key));
        }
        assert_eq!(stack.pop(), None);
    }
}
