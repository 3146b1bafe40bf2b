//! The layers of the network in their order: a U-Net over the volume (Ronneberger, Fischer, Brox 2015; Çiçek et al. 2016), which gives
//! depths, and a few layers over its features at these depths, which give the mask. Host and device carry out this one list;
//! `learn/network.py` trains it.

/// What carries out layers: functions of the host, or a schedule that is written for a device. Layers are named as in the file of weights.
pub trait Layers {
    /// Channels of a volume.
    type Volume;

    /// Their number.
    fn channels(of: &Self::Volume) -> usize;

    /// Output channels of a layer.
    fn outputs(&self, name: &str) -> usize;

    /// A convolution of the channels of all inputs, one after another: over 3 x 3 x 3 cells, or over one.
    fn convolved(&mut self, name: &str, inputs: &[&Self::Volume], over: Footprint) -> Self::Volume;

    /// Normalises a convolution by groups of channels and activates it; `with` is added in between.
    fn activate(&mut self, name: &str, of: &mut Self::Volume, with: Option<&Self::Volume>);

    /// A convolution of 2 x 2 x 2 cells to one.
    fn halved(&mut self, name: &str, fine: &Self::Volume) -> Self::Volume;

    /// A transposed convolution of a cell to 2 x 2 x 2.
    fn doubled(&mut self, name: &str, coarse: &Self::Volume) -> Self::Volume;

    /// What every column says, as channels of a plane: means of the features over the distribution of depths, their maxima, the
    /// largest logit, and the logarithm of the sum of their exponentials.
    fn columns(&mut self, features: &Self::Volume, logits: &Self::Volume) -> Self::Volume;

    /// A convolution over 3 x 3 cells of a plane.
    fn plane(&mut self, name: &str, input: &Self::Volume, then: Then) -> Self::Volume;

    /// These channels are read no more.
    fn free(&mut self, of: Self::Volume);
}

/// The cells that a convolution is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Footprint {
    /// 3 x 3 x 3.
    Near,
    /// One.
    One,
}

/// What follows the convolution of a plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Then {
    /// It is activated.
    Activated,
    /// It is activated, and the input is added.
    Added,
    /// Nothing: it is the answer.
    Last,
}

/// Logits of the depths of every column, and those of surface: four channels are the four pixels of a column.
pub fn answer<L: Layers>(l: &mut L, input: L::Volume) -> [L::Volume; 2] {
    let first = l.convolved("inp", &[&input], Footprint::Near);
    l.free(input);
    let x0 = block(l, "e0", first, None);
    let x1 = down(l, ["d1", "e1"], &x0);
    let x2 = down(l, ["d2", "e2"], &x1);
    let x3 = down(l, ["d3", "e3"], &x2);
    let y = up(l, ["u2", "f2"], x3, x2);
    let y = up(l, ["u1", "f1"], y, x1);
    let features = up(l, ["u0", "f0"], y, x0);
    let logits = l.convolved("depth", &[&features], Footprint::One);
    let columns = l.columns(&features, &logits);
    let mut plane = l.plane("m0", &columns, Then::Activated);
    for name in ["m1", "m2"] {
        plane = l.plane(name, &plane, Then::Added);
    }
    [logits, l.plane("m3", &plane, Then::Last)]
}

/// Two convolutions of the channels of `first` and `more`, around which the input is added (He et al. 2016). `first` is read no more.
pub(super) fn block<L: Layers>(
    l: &mut L,
    name: &str,
    first: L::Volume,
    more: Option<&L::Volume>,
) -> L::Volume {
    let of = |part: &str| format!("{name}.{part}");
    let both = [Some(&first), more];
    let inputs: Vec<_> = both.into_iter().flatten().collect();
    let mut a = l.convolved(&of("a"), &inputs, Footprint::Near);
    l.activate(&of("na"), &mut a, None);
    let skip = if more.is_none() && l.outputs(&of("b")) == L::channels(&first) {
        first
    } else {
        let skip = l.convolved(&of("skip"), &inputs, Footprint::One);
        l.free(first);
        skip
    };
    let mut b = l.convolved(&of("b"), &[&a], Footprint::Near);
    l.activate(&of("nb"), &mut b, Some(&skip));
    l.free(a);
    l.free(skip);
    b
}

/// A block at half as many cells along each axis.
fn down<L: Layers>(l: &mut L, [name, next]: [&str; 2], fine: &L::Volume) -> L::Volume {
    let coarse = l.halved(name, fine);
    block(l, next, coarse, None)
}

/// A block at twice as many cells along each axis, of these and those that were kept.
fn up<L: Layers>(l: &mut L, [name, next]: [&str; 2], coarse: L::Volume, kept: L::Volume) -> L::Volume {
    let fine = l.doubled(name, &coarse);
    l.free(coarse);
    let made = block(l, next, fine, Some(&kept));
    l.free(kept);
    made
}
