use super::Twin;
use thirdbounce::gpu::Constant;
use thirdbounce::transport::kernels::{LearnedPush, PaperData, Push, SceneData};

/// A dispatch without its buffers.
#[derive(Debug, Clone)]
pub struct Call<'a> {
    /// The scene in float64.
    pub twin: Twin<'a>,
    /// The scene as kernels read it: its counts are those of the dispatch.
    pub scene: SceneData,
    /// The block of the paper's solver, for the kernels that bind it.
    pub paper: PaperData,
    /// Push constants.
    pub push: Push,
    /// Specialization constants that differ from the source.
    pub constants: Vec<(Constant, u32)>,
}

/// A twin: reads and changes the buffers of a dispatch, number `i` at binding `i + 1`. Unbound ones are empty.
pub type TwinFn = fn(&Call, &mut [Cells]);

impl Call<'_> {
    /// A specialization constant, whose value in the source is `usual`.
    pub fn constant(&self, constant: Constant, usual: u32) -> u32 {
        self.constants.iter().find(|c| c.0 == constant).map_or(usual, |c| c.1)
    }

    /// Parameters of a dispatch of the learned start.
    pub(super) fn learned(&self) -> LearnedPush {
        bytemuck::cast(self.push)
    }

    /// Number of cells of its layer.
    pub(super) fn learned_cells(&self) -> usize {
        let layer = self.learned();
        [layer.n_x, layer.n_y, layer.n_z].iter().map(|n| *n as usize).product()
    }

    /// A cell of its layer along x, y, z.
    pub(super) fn learned_cell(&self, cell: usize) -> [usize; 3] {
        let [ny, nz] = [self.learned().n_y, self.learned().n_z].map(|n| n as usize);
        [cell / (ny * nz), cell / nz % ny, cell % nz]
    }

    /// Number of cells of all histograms.
    pub(super) fn cells(&self) -> usize {
        thirdbounce::transport::cells(self.scene.pairs as usize, self.scene.bins as usize)
    }

    /// First cell of a histogram's bins.
    pub(super) fn row(&self, pair: usize) -> usize {
        thirdbounce::transport::cells(pair, self.scene.bins as usize)
    }

    /// Pair and bin of a cell, unless it is padding.
    pub(super) fn bin_of(&self, cell: usize) -> Option<(usize, usize)> {
        let (pair, at) = (cell / self.scene.stride as usize, cell % self.scene.stride as usize);
        let bin = at.checked_sub(thirdbounce::transport::kernels::PADDING as usize)?;
        (pair < self.scene.pairs as usize).then_some((pair, bin))
    }
}

/// The content of a buffer.
#[derive(Debug, Clone, PartialEq)]
pub enum Cells {
    /// Numbers: fp32 or fixed point on the device.
    Floats(Vec<f64>),
    /// Integers, and fp32 numbers by their bits.
    Words(Vec<u32>),
}

impl Cells {
    /// A number that a kernel may leave in any state: an intermediate result.
    pub const ANY: f64 = f64::INFINITY;

    /// All floats.
    pub fn f(&mut self) -> &mut [f64] {
        if let Cells::Floats(v) = self { v } else { &mut [] }
    }

    /// Floats in twos.
    pub fn v2(&mut self) -> &mut [[f64; 2]] {
        self.f().as_chunks_mut().0
    }

    /// Floats in threes.
    pub fn v3(&mut self) -> &mut [[f64; 3]] {
        self.f().as_chunks_mut().0
    }

    /// Floats in fours.
    pub fn v4(&mut self) -> &mut [[f64; 4]] {
        self.f().as_chunks_mut().0
    }

    /// All words.
    pub fn u(&mut self) -> &mut [u32] {
        if let Cells::Words(v) = self { v } else { &mut [] }
    }

    /// Words in fours.
    pub fn u4(&mut self) -> &mut [[u32; 4]] {
        self.u().as_chunks_mut().0
    }

    /// A buffer that the twin does not need.
    pub fn any(&mut self) -> &Cells {
        self
    }
}

/// Names the buffers from binding 1 on, each with the method of [`Cells`] that gives its content; after a semicolon
/// those of the last bindings.
macro_rules! bind {
    ($all:ident: $($name:ident $of:ident),* $(; $($last:ident $as:ident),*)?) => {
        let [$($name,)* .. $($(, $last)*)?] = $all else { unreachable!("fewer buffers than bindings") };
        $(let $name = $name.$of();)*
        $($(let $last = $last.$as();)*)?
    };
}
