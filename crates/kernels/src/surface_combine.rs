use rayon::prelude::*;

use super::pixels::{NOWHERE, PixelField, has_normals};
use super::shared::*;
use super::{Call, Cells, Real, V2};

/// Gradients by every pixel's own slopes, depth and albedo, from those of its points and of the prior: for each pair of
/// neighbours
///   bond * (bend (off / size)² + jump (a_i - a_j)²) / 2
/// where `off` is the distance along z of one pixel from the plane through the other with the mean slopes of both; and
/// for every pixel the term that keeps few of them lit. Keeps the largest gradients, and sums the prior by workgroups.
pub fn surface_combine<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(
        b: pixels u, pixel_of u, heights v2, slopes v2, gradient v4, height_gradient v4, weights f, l1_partials f,
        bond_depths f
    );
    let count = call.push.last as usize;
    let field = PixelField::<F>::new(call, pixels, pixel_of);
    let prior = Prior {
        field: &field,
        heights,
        slopes,
        bond_depths,
        bend: weights[SURFACE_BEND as usize],
        jump: weights[SURFACE_JUMP as usize],
        sparse: weights[SURFACE_SPARSE as usize],
        faint: weights[SURFACE_FAINT as usize],
    };
    let (points, directed) = (call.constant("POINTS", 4) as usize, has_normals(call));
    let share = F::of(1.0 / points as f64);
    let own = |pixel: usize| {
        let (albedo, slope) = (heights[pixel][1], V2::of(slopes[pixel]));
        let mut sum = PixelGradient::default();
        for (k, g) in gradient[points * pixel..][..points].iter().enumerate() {
            let by_depth = if directed { g[3] } else { g[1] };
            if directed {
                // Per lateral area of a pixel, albedo times normal is albedo times (slope, -1).
                sum.tilts += V2 { x: g[0], y: g[1] } * (share * albedo);
                sum.brighter = sum.brighter + share * (slope.x * g[0] + slope.y * g[1] - g[2]);
            } else {
                sum.brighter = sum.brighter + share * g[0];
            }
            sum.deeper = sum.deeper + by_depth;
            sum.tilts += field.part(k, points) * by_depth;
        }
        sum
    };
    let group = WORKGROUP as usize;
    let groups = height_gradient[..count].par_chunks_mut(group).zip(l1_partials.par_iter_mut()).enumerate();
    let largest: Vec<[F; 2]> = groups
        .map(|(i, (out, partial))| {
            let (mut largest, mut energy) = ([F::zero(); 2], F::zero());
            for (k, out) in out.iter_mut().enumerate() {
                let mut sum = own(i * group + k);
                energy = energy + prior.add(i * group + k, &mut sum);
                *out = [sum.tilts.x, sum.tilts.y, sum.deeper, sum.brighter];
                largest = [largest[0].max(sum.deeper.abs()), largest[1].max(sum.brighter.abs())];
            }
            *partial = energy;
            largest
        })
        .collect();
    for k in 0..2 {
        let most = &mut weights[SURFACE_LARGEST as usize + k];
        *most = largest.iter().fold(*most, |most, group| most.max(group[k]));
    }
}

/// Gradients by a pixel's slopes, depth and albedo.
#[derive(Default)]
struct PixelGradient<F> {
    tilts: V2<F>,
    deeper: F,
    brighter: F,
}

struct Prior<'p, F> {
    field: &'p PixelField<'p, F>,
    heights: &'p [[F; 2]],
    slopes: &'p [[F; 2]],
    bond_depths: &'p [F],
    bend: F,
    jump: F,
    sparse: F,
    faint: F,
}

impl<F: Real> Prior<'_, F> {
    /// Adds the gradients of the prior at a pixel. Returns its energy: half of that of every bond.
    fn add(&self, pixel: usize, sum: &mut PixelGradient<F>) -> F {
        let Prior { field, heights, slopes, bend, jump, .. } = *self;
        let ([depth, albedo], slope, half) = (heights[pixel], V2::of(slopes[pixel]), F::of(0.5));
        let own_depth = self.bond_depths[field.pixels[pixel] as usize];
        let mut energy = F::zero();
        for (k, other) in field.neighbours(pixel).into_iter().enumerate().filter(|(_, other)| *other != NOWHERE) {
            let other = other as usize;
            let weight = field.bond(k, self.bond_depths[field.pixels[other] as usize] - own_depth);
            let d = field.offset(k);
            let plane = half * (slope + V2::of(slopes[other])).dot(d);
            let off = (heights[other][0] - depth - plane) / field.size;
            let differs = albedo - heights[other][1];
            let steep = bend * weight * off / field.size;
            sum.deeper = sum.deeper - steep;
            sum.tilts += d * (-half * steep);
            sum.brighter = sum.brighter + jump * weight * differs;
            energy = energy + half * half * weight * (bend * off * off + jump * differs * differs);
        }
        if self.sparse > F::zero() {
            let lit = F::one() + albedo / self.faint;
            sum.brighter = sum.brighter + self.sparse / lit;
            energy = energy + self.sparse * self.faint * lit.ln();
        }
        energy
    }
}
