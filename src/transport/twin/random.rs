/// Three numbers in [0, 1) from a voxel's storage index, the iteration and a stream: the same bits as in the kernels.
/// PCG3D, Jarzynski & Olano 2020, "Hash functions for GPU rendering".
pub fn random3(index: u32, iteration: u32, stream: u32, seed: u32) -> [f64; 3] {
    let v = [index, iteration, seed ^ stream.wrapping_mul(0x9e37_79b9)];
    let [mut x, mut y, mut z] = v.map(|a| a.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    x = x.wrapping_add(y.wrapping_mul(z));
    y = y.wrapping_add(z.wrapping_mul(x));
    z = z.wrapping_add(x.wrapping_mul(y));
    [x, y, z] = [x ^ x >> 16, y ^ y >> 16, z ^ z >> 16];
    x = x.wrapping_add(y.wrapping_mul(z));
    y = y.wrapping_add(z.wrapping_mul(x));
    z = z.wrapping_add(x.wrapping_mul(y));
    [x, y, z].map(|a| f64::from(a >> 8) / 16_777_216.0)
}
