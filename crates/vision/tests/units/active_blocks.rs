//! Active blocks by their definition, also of frames of more than 64 blocks.

use super::*;
use proptest::prelude::*;

proptest! {
    #[test]
    fn blocks_near_a_hit_and_their_neighbours_are_active(
        width in prop_oneof![1..400_usize, 4000..9000_usize],
        reach in 0..6_usize,
        rows in prop::collection::vec(prop::collection::vec(any::<u16>(), 0..3), 1..60),
        quiet in 0..60_usize,
    ) {
        let blocks = width.div_ceil(BLOCK);
        let rows: Vec<Vec<usize>> = rows.into_iter().enumerate()
            .map(|(n, row)| if n.abs_diff(quiet) < 25 { vec![] } else {
                row.into_iter().map(|b| usize::from(b) % blocks).collect()
            })
            .collect();
        let active = |n: usize| -> Vec<bool> {
            let around = n.saturating_sub(reach)..(n + reach + 1).min(rows.len());
            let hits = rows.get(around).unwrap_or_default().concat();
            (0..blocks).map(|block| hits.iter().any(|b| block.abs_diff(*b) <= 1)).collect()
        };
        let bits = |words: &[u64]| -> Vec<bool> {
            (0..64 * words.len()).map(|b| words[b / 64] >> (b % 64) & 1 == 1).collect()
        };
        let mut strips = ActiveBlocks::default();
        strips.start(width, reach);
        let mut scanned = 0;
        for first in (0..rows.len()).step_by(STRIP) {
            strips.next_strip();
            let ahead = rows.len().min(first + STRIP + reach);
            for (n, row) in rows.iter().enumerate().take(ahead).skip(scanned) {
                let words = strips.hits(n + reach - first);
                for b in row {
                    words[b / 64] |= 1 << (b % 64);
                }
            }
            scanned = ahead;
            let any = strips.activate();
            for n in first..rows.len().min(first + STRIP) {
                let (found, expected) = (bits(strips.active(n - first)), active(n));
                prop_assert_eq!(&found[..blocks], &expected[..], "row {}", n);
                prop_assert!(found[blocks..].iter().all(|bit| !bit));
                prop_assert!(any || !expected.contains(&true));
                let above = n.checked_sub(1).map_or(vec![false; blocks], active);
                let new = bits(&strips.newly_active(n - first).collect::<Vec<u64>>());
                let expected = expected.iter().zip(above).map(|(new, old)| *new && !old);
                prop_assert_eq!(&new[..blocks], &expected.collect::<Vec<bool>>()[..]);
            }
        }
    }
}
