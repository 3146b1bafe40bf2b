use rayon::prelude::*;

use super::domain::{WORDS, inside};
use super::{Call, Cells, Real, index};

/// The rim: voxels among the 26 neighbours of an active voxel that are not active. Rows of eight voxels along x are the bits
/// of a byte.
pub fn rim<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: mask u, rim_mask u);
    let grid = call.grid::<F>();
    let [nx, ny, nz] = grid.bricks;
    // `[z][y][brick along x]`, each with its neighbours along x.
    let mut rows = vec![0u8; nx * 8 * ny * 8 * nz];
    rows.par_chunks_mut(nx).enumerate().for_each(|(row, bytes)| {
        let (y, z) = (row % (8 * ny), row / (8 * ny));
        for (x, byte) in bytes.iter_mut().enumerate() {
            *byte = byte_of(&mask[((z / 8 * ny + y / 8) * nx + x) * WORDS..][..WORDS], [y % 8, z % 8]);
        }
        let mut before = 0;
        for x in 0..nx {
            let (own, after) = (bytes[x], bytes.get(x + 1).copied().unwrap_or(0));
            bytes[x] = own | own << 1 | own >> 1 | before >> 7 | after << 7;
            before = own;
        }
    });
    rim_mask[..grid.storage() / 32].par_chunks_mut(WORDS).enumerate().for_each(|(brick, out)| {
        let [x, y, z] = [brick % nx, brick / nx % ny, brick / (nx * ny)];
        out.fill(0);
        for (j, k) in (0..64).map(|row| (row % 8, row / 8)) {
            let near = |at: usize, n: usize| at.saturating_sub(1)..(at + 2).min(8 * n);
            let around = near(8 * z + k, nz).flat_map(|z| near(8 * y + j, ny).map(move |y| z * 8 * ny + y));
            put_byte(out, [j, k], around.fold(0, |byte, row| byte | rows[row * nx + x]));
        }
        let active = &mask[brick * WORDS..][..WORDS];
        let allowed = inside(&grid, brick, 0);
        (0..WORDS).for_each(|w| out[w] &= allowed[w] & !active[w]);
    });
}

/// First word and bit of a row along x of a brick. Its voxels are at 0, 1, 8 and 9 bits from there, in this word and in the
/// second after it.
fn place([y, z]: [usize; 2]) -> (usize, usize) {
    let first = index([1; 3], [0, y, z]);
    (first / 32, first % 32)
}

/// The voxels of a row of a brick.
fn byte_of(brick: &[u32], row: [usize; 2]) -> u8 {
    let (word, bit) = place(row);
    let four = |word: u32| (word >> bit & 3 | word >> bit >> 6 & 12) as u8;
    four(brick[word]) | four(brick[word + 2]) << 4
}

fn put_byte(brick: &mut [u32], row: [usize; 2], byte: u8) {
    let (word, bit) = place(row);
    let spread = |four: u8| (u32::from(four & 3) | u32::from(four & 12) << 6) << bit;
    brick[word] |= spread(byte & 15);
    brick[word + 2] |= spread(byte >> 4);
}
