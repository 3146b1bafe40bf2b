use super::shared::{LearnedPush, PADDING, PaperData, Push, SceneData, SurfaceData};
use super::{Real, SceneGrid};

/// A dispatch without its buffers.
#[derive(Debug, Clone)]
pub struct Call<'c> {
    /// The scene. Its counts are those of the dispatch.
    pub scene: SceneData,
    /// The block of the paper's solver; zero where the kernel does not bind it.
    pub paper: PaperData,
    /// The block of the surface solver; zero where the kernel does not bind it.
    pub surface: SurfaceData,
    /// Push constants.
    pub push: Push,
    /// Specialization constants that differ from the source.
    pub constants: &'c [(&'static str, u32)],
}

/// A kernel: reads and changes the buffers of a dispatch, number `i` at binding `i + 1`. Unbound ones are empty.
pub type Function<F> = fn(&Call<'_>, &mut [Cells<F>]);

impl<'c> Call<'c> {
    /// A dispatch with these constants and push constants. `block`: content of a bound uniform block by name.
    pub fn new<'b>(
        constants: &'c [(&'static str, u32)],
        push: [u32; 7],
        block: impl Fn(&str) -> Option<&'b [u32]>,
    ) -> Call<'c> {
        fn read<T: bytemuck::AnyBitPattern + Default>(words: Option<&[u32]>) -> T {
            let bytes = words.map(bytemuck::cast_slice::<u32, u8>);
            let own = bytes.and_then(|bytes| bytes.get(..size_of::<T>()));
            own.map_or_else(T::default, bytemuck::pod_read_unaligned)
        }
        Call {
            scene: read(block("scene")),
            paper: read(block("paper")),
            surface: read(block("surface")),
            push: bytemuck::cast(push),
            constants,
        }
    }

    /// A specialization constant, whose value in the source is `usual`.
    pub fn constant(&self, name: &str, usual: u32) -> u32 {
        self.constants.iter().find(|c| c.0 == name).map_or(usual, |c| c.1)
    }

    /// Whether a specialization constant, 0 in the source, is set.
    pub fn is(&self, name: &str) -> bool {
        self.constant(name, 0) != 0
    }

    /// The voxels.
    pub fn grid<F: Real>(&self) -> SceneGrid<F> {
        SceneGrid::of(&self.scene)
    }

    /// Parameters of a dispatch of the learned start.
    pub fn learned(&self) -> LearnedPush {
        bytemuck::cast(self.push)
    }

    /// Number of cells of the learned start's layer.
    pub fn learned_cells(&self) -> usize {
        let layer = self.learned();
        [layer.n_x, layer.n_y, layer.n_z].iter().map(|n| *n as usize).product()
    }

    /// A cell of the learned start's layer along x, y, z.
    pub fn learned_cell(&self, cell: usize) -> [usize; 3] {
        let [ny, nz] = [self.learned().n_y, self.learned().n_z].map(|n| n as usize);
        [cell / (ny * nz), cell / nz % ny, cell % nz]
    }

    /// Number of bins of a histogram.
    pub fn bins(&self) -> usize {
        self.scene.bins as usize
    }

    /// Cells from one histogram to the next.
    pub fn stride(&self) -> usize {
        self.scene.stride as usize
    }

    /// Number of cells of `pairs` histograms, with the padding after the last.
    pub fn cells_of(&self, pairs: usize) -> usize {
        pairs * self.stride() + PADDING as usize
    }

    /// Number of cells of all histograms.
    pub fn cells(&self) -> usize {
        self.cells_of(self.scene.pairs as usize)
    }

    /// First cell of a histogram's bins.
    pub fn row(&self, pair: usize) -> usize {
        self.cells_of(pair)
    }

    /// Pair and bin of a cell, unless it is padding.
    pub fn bin_of(&self, cell: usize) -> Option<(usize, usize)> {
        let (pair, at) = (cell / self.stride(), cell % self.stride());
        let bin = at.checked_sub(PADDING as usize)?;
        (pair < self.scene.pairs as usize).then_some((pair, bin))
    }
}

/// The content of a buffer.
#[derive(Debug, Clone, PartialEq)]
pub enum Cells<F> {
    /// Numbers. Of float64 kernels: fp32 or fixed point on a device.
    Floats(Vec<F>),
    /// Integers, and fp32 numbers by their bits. On the host all buffers.
    Words(Vec<u32>),
}

impl<F: Real> Cells<F> {
    /// A number that a kernel may leave in any state: an intermediate result.
    pub const ANY: f64 = f64::INFINITY;

    /// No buffer.
    pub const NONE: Cells<F> = Cells::Words(vec![]);

    /// All floats.
    pub fn f(&mut self) -> &mut [F] {
        match self {
            Cells::Floats(all) => all,
            Cells::Words(all) => F::of_words(all),
        }
    }

    /// Floats in twos.
    pub fn v2(&mut self) -> &mut [[F; 2]] {
        self.f().as_chunks_mut().0
    }

    /// Floats in threes.
    pub fn v3(&mut self) -> &mut [[F; 3]] {
        self.f().as_chunks_mut().0
    }

    /// Floats in fours.
    pub fn v4(&mut self) -> &mut [[F; 4]] {
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

    /// A buffer that the kernel does not need.
    pub fn any(&mut self) -> &Cells<F> {
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
