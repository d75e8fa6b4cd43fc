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

    #[inline(always)]
    pub(crate) fn top(&mut self) -> Top<'_, T> {
        Top { entries: &mut self.entries, len: &mut self.len }
    }
}

/// Several, no larger than a tree's depth asks for.
pub(crate) struct Stacks<T, const N: usize> {
    entries: Box<[MaybeUninit<T>]>,
    /// Entries of each.
    room: usize,
    len: [usize; N],
}

impl<T: Copy, const N: usize> Stacks<T, N> {
    /// For trees of so many levels.
    pub(crate) fn new(depth: u32) -> Self {
        let room = 7 * depth as usize + 8;
        Self { entries: Box::new_uninit_slice(N * room), room, len: [0; N] }
    }

    /// Empties all.
    #[inline(always)]
    pub(crate) fn clear(&mut self) {
        self.len = [0; N];
    }

    /// Of one of them.
    ///
    /// # Panics
    /// If there is no such stack.
    #[inline(always)]
    pub(crate) fn top(&mut self, which: usize) -> Top<'_, T> {
        let from = which * self.room;
        Top { entries: &mut self.entries[from..from + self.room], len: &mut self.len[which] }
    }
}

/// Where a stack grows. What lies below `len` was written.
pub(crate) struct Top<'a, T> {
    entries: &'a mut [MaybeUninit<T>],
    len: &'a mut usize,
}

impl<T: Copy> Top<'_, T> {
    /// Puts the first `n` (at most 8) of these keys on top, the last of them topmost.
    ///
    /// # Panics
    /// If the stack is full, which no tree of bounded depth brings about.
    #[inline(always)]
    pub(crate) fn push(self, keys: &[T; 8], n: usize) {
        assert!(*self.len + 8 <= self.entries.len() && n <= 8, "trees are not so deep");
        for (slot, key) in self.entries[*self.len..*self.len + 8].iter_mut().zip(keys) {
            slot.write(*key);
        }
        *self.len += n;
    }

    #[inline(always)]
    pub(crate) fn peek(self) -> Option<T> {
        let last = self.len.checked_sub(1)?;
        // SAFETY: as of `pop`.
        Some(unsafe { self.entries.get_unchecked(last).assume_init() })
    }

    #[inline(always)]
    pub(crate) fn pop(self) -> Option<T> {
        *self.len = self.len.checked_sub(1)?;
        // SAFETY: every entry below `len` was written by `push`, and `len` is below what there is room for.
        Some(unsafe { self.entries.get_unchecked(*self.len).assume_init() })
    }
}

impl Top<'_, u64> {
    /// Sorts the first `n` (1 to 8) of these keys, puts all but the smallest on top, smaller ones above, and returns the
    /// smallest (the other way round if `reversed`).
    ///
    /// # Panics
    /// As [`Top::push`].
    #[inline(always)]
    pub(crate) fn push_all_but_nearest(self, keys: [u64; 8], n: usize, reversed: bool) -> u64 {
        if reversed {
            return self.push_all_but_farthest(keys, n);
        }
        if n <= 4 { self.push_few(keys, n) } else { self.push_many(keys, n) }
    }

    #[cold]
    #[inline(never)]
    fn push_all_but_farthest(self, mut keys: [u64; 8], n: usize) -> u64 {
        keys[..n].sort_unstable();
        let Self { entries, len } = self;
        Top { entries, len }.push(&keys, n);
        Top { entries, len }.pop().unwrap_or(0)
    }

    /// One to four, sorted without a detour through memory.
    #[inline(always)]
    fn push_few(self, keys: [u64; 8], n: usize) -> u64 {
        let [a, b, c, d, ..] = keys;
        match n {
            2 => {
                let (a, b) = order(a, b);
                self.put([b]);
                a
            }
            3 => {
                let (a, b) = order(a, b);
                let (b, c) = order(b, c);
                let (a, b) = order(a, b);
                self.put([c, b]);
                a
            }
            4 => {
                let ((a, b), (c, d)) = (order(a, b), order(c, d));
                let ((a, c), (b, d)) = (order(a, c), order(b, d));
                let (b, c) = order(b, c);
                self.put([d, c, b]);
                a
            }
            _ => a,
        }
    }

    /// The same as [`Top::push_all_but_nearest`] without a branch, for nodes of which most children are visited: how many
    /// those are is not to be predicted.
    ///
    /// # Panics
    /// As [`Top::push`].
    #[inline(always)]
    pub(crate) fn push_sorted(mut self, keys: [u64; 8], n: usize) -> u64 {
        static UNUSED: [[u64; 8]; 9] = {
            let mut masks = [[0; 8]; 9];
            let mut n = 0;
            while n < 9 {
                let mut k = 0;
                while k < n && k < 8 {
                    masks[n][k] = u64::MAX;
                    k += 1;
                }
                n += 1;
            }
            masks
        };
        // What follows the keys becomes 0, and the last.
        let mask = &UNUSED[n.min(8)];
        let [a, b, c, d, e, f, g, h] = keys;
        let (a, b, c, d) = (a & mask[0], b & mask[1], c & mask[2], d & mask[3]);
        let (e, f, g, h) = (e & mask[4], f & mask[5], g & mask[6], h & mask[7]);
        // Batcher's network of 19 comparisons (Knuth, TAOCP volume 3, section 5.3.4), the larger first.
        let ((b, a), (d, c), (f, e), (h, g)) = (order(a, b), order(c, d), order(e, f), order(g, h));
        let ((c, a), (d, b), (g, e), (h, f)) = (order(a, c), order(b, d), order(e, g), order(f, h));
        let ((c, b), (g, f)) = (order(b, c), order(f, g));
        let ((e, a), (f, b), (g, c), (h, d)) = (order(a, e), order(b, f), order(c, g), order(d, h));
        let ((e, c), (f, d)) = (order(c, e), order(d, f));
        let ((c, b), (e, d), (g, f)) = (order(b, c), order(d, e), order(f, g));
        self.reborrow().push(&[a, b, c, d, e, f, g, h], n);
        self.pop().unwrap_or(0)
    }

    #[inline(always)]
    fn reborrow(&mut self) -> Top<'_, u64> {
        Top { entries: self.entries, len: self.len }
    }

    /// Puts these on top, the last of them topmost.
    ///
    /// # Panics
    /// As [`Top::push`].
    #[inline(always)]
    pub(crate) fn put<const N: usize>(self, keys: [u64; N]) {
        let len = *self.len;
        assert!(len + N <= self.entries.len(), "trees are not so deep");
        for (slot, key) in self.entries[len..len + N].iter_mut().zip(keys) {
            slot.write(key);
        }
        *self.len = len + N;
    }

    /// Any number. Inlined too: a call would make the caller keep everything in memory.
    #[inline(always)]
    fn push_many(self, keys: [u64; 8], n: usize) -> u64 {
        let len = *self.len;
        assert!(len + 8 <= self.entries.len(), "trees are not so deep");
        let slots = &mut self.entries[len..len + 8];
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
        *self.len += count;
        self.pop().unwrap_or(0)
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
        fn the_nearest_comes_first_then_the_others(keys in prop::array::uniform8(any::<u64>()), n in 1usize..=8) {
            let mut sorted = keys[..n].to_vec();
            sorted.sort_unstable();
            let mut stack = Stack::new();
            let mut got = vec![stack.top().push_all_but_nearest(keys, n, false)];
            got.extend(core::iter::from_fn(|| stack.top().pop()));
            prop_assert_eq!(&got, &sorted);
            got = vec![stack.top().push_sorted(keys, n)];
            got.extend(core::iter::from_fn(|| stack.top().pop()));
            prop_assert_eq!(&got, &sorted);
            got = vec![stack.top().push_all_but_nearest(keys, n, true)];
            got.extend(core::iter::from_fn(|| stack.top().pop()));
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
            stack.top().push(&keys, n);
            twin.extend_from_slice(&keys[..n]);
            if level % 4 == 1 {
                assert_eq!(stack.top().pop(), twin.pop());
            }
        }
        while let Some(key) = twin.pop() {
            assert_eq!(stack.top().pop(), Some(key));
        }
        assert_eq!(stack.top().pop(), None);
    }
}
