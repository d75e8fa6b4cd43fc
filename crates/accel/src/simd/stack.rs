//! What is left to visit.

use core::mem::MaybeUninit;

use crate::build::MAX_DEPTH;

/// Each level of a tree leaves at most seven children behind, and eight are written at once.
const SIZE: usize = 7 * MAX_DEPTH as usize + 8;

/// A stack of children, or of keys with the distance above and the child below. It lives on the machine's stack and is
/// not cleared first: that would cost as much as a short ray.
pub(crate) struct Stack<T> {
    entries: [MaybeUninit<T>; SIZE],
    len: usize,
}

impl<T: Copy> Stack<T> {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self { entries: [const { MaybeUninit::uninit() }; SIZE], len: 0 }
    }

    /// Puts the first `n` (at most 8) of these keys on top, the last of them topmost.
    ///
    /// # Panics
    /// If the stack is full, which no tree of bounded depth brings about.
    #[inline(always)]
    pub(crate) fn push(&mut self, keys: &[T; 8], n: usize) {
        assert!(self.len + 8 <= SIZE && n <= 8, "trees are not so deep");
        for (slot, key) in self.entries[self.len..self.len + 8].iter_mut().zip(keys) {
            slot.write(*key);
        }
        self.len += n;
    }

    #[inline(always)]
    pub(crate) fn pop(&mut self) -> Option<T> {
        self.len = self.len.checked_sub(1)?;
        // SAFETY: every entry below `len` was written by `push`, and `len` is below SIZE.
        Some(unsafe { self.entries.get_unchecked(self.len).assume_init() })
    }
}

impl Stack<u64> {
    /// Sorts the first `n` (2 to 8) of these keys, puts all but the smallest on top, smaller ones above, and returns the
    /// smallest (the other way round if `reversed`). Few keys, as nearly always, are sorted without a detour through
    /// memory.
    ///
    /// # Panics
    /// As [`Stack::push`].
    #[inline(always)]
    pub(crate) fn push_all_but_nearest(&mut self, mut keys: [u64; 8], n: usize, reversed: bool) -> u64 {
        if reversed {
            keys[..n.min(8)].iter_mut().for_each(|k| *k = !*k);
        }
        let [a, b, c, d, ..] = keys;
        let nearest = match n {
            2 => {
                let (a, b) = order(a, b);
                self.put([b], reversed);
                a
            }
            3 => {
                let (a, b) = order(a, b);
                let (b, c) = order(b, c);
                let (a, b) = order(a, b);
                self.put([c, b], reversed);
                a
            }
            4 => {
                let ((a, b), (c, d)) = (order(a, b), order(c, d));
                let ((a, c), (b, d)) = (order(a, c), order(b, d));
                let (b, c) = order(b, c);
                self.put([d, c, b], reversed);
                a
            }
            _ => self.push_many(keys, n, reversed),
        };
        if reversed { !nearest } else { nearest }
    }

    /// Any number. Inlined too: a call would make the caller keep everything in memory.
    #[inline(always)]
    fn push_many(&mut self, keys: [u64; 8], n: usize, reversed: bool) -> u64 {
        assert!(self.len + 8 <= SIZE, "trees are not so deep");
        let slots = &mut self.entries[self.len..self.len + 8];
        // Insertion, the largest lowest.
        let mut count = 0;
        while count < n.min(8) {
            let key = keys[count];
            let mut k = count;
            while k > 0 {
                // SAFETY: the slots below `count` were written by earlier turns.
                let below = unsafe { slots[k - 1].assume_init() };
                if below >= key {
                    break;
                }
                slots[k].write(below);
                k -= 1;
            }
            slots[k].write(key);
            count += 1;
        }
        if reversed {
            for slot in &mut slots[..count] {
                // SAFETY: the slots below `count` are written.
                slot.write(!unsafe { slot.assume_init() });
            }
        }
        self.len += count;
        match self.pop() {
            Some(nearest) if reversed => !nearest,
            Some(nearest) => nearest,
            None => 0,
        }
    }

    #[inline(always)]
    fn put<const N: usize>(&mut self, keys: [u64; N], reversed: bool) {
        assert!(self.len + N <= SIZE, "trees are not so deep");
        for (slot, key) in self.entries[self.len..self.len + N].iter_mut().zip(keys) {
            slot.write(if reversed { !key } else { key });
        }
        self.len += N;
    }
}

/// The smaller first.
#[inline(always)]
fn order(a: u64, b: u64) -> (u64, u64) {
    (a.min(b), a.max(b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_nearest_comes_first_then_the_others(keys in prop::array::uniform8(any::<u64>()), n in 2usize..=8) {
            let mut sorted = keys[..n].to_vec();
            sorted.sort_unstable();
            let mut stack = Stack::new();
            let mut got = vec![stack.push_all_but_nearest(keys, n, false)];
            got.extend(core::iter::from_fn(|| stack.pop()));
            prop_assert_eq!(&got, &sorted);
            got = vec![stack.push_all_but_nearest(keys, n, true)];
            got.extend(core::iter::from_fn(|| stack.pop()));
            sorted.reverse();
            prop_assert_eq!(&got, &sorted);
        }
    }

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
