use rayon::prelude::*;

use super::pixels::{NOWHERE, PixelField, facing, has_normals, stretch};
use super::shared::*;
use super::{Call, Cells, Real, V2, larger, watch};

/// Slopes of every pixel, and its samples: 1 or 4 points of its tilted square, with depths limited to the grid's.
pub fn surface_points<F: Real>(call: &Call<'_>, b: &mut [Cells<F>]) {
    bind!(b: pixels u, pixel_of u, heights v2, stencils v2, slopes v2, points v4, normals v4, counts u);
    let (field, count) = (PixelField::<F>::new(call, pixels, pixel_of), call.push.last as usize);
    let each = call.constant("POINTS", 4) as usize;
    let directed = has_normals(call);
    let [near, far] = field.grid.depth_limits();
    let group = WORKGROUP as usize;
    let slopes = &mut slopes[..count];
    slopes.par_chunks_mut(group).enumerate().for_each(|(i, slopes)| {
        for (pixel, slope) in (i * group..).zip(slopes) {
            let own = heights[pixel][0];
            let near = field.neighbours(pixel).into_iter().zip(&stencils[8 * pixel..][..8]);
            let risen = near.filter(|(other, _)| *other != NOWHERE).map(|(other, stencil)| {
                V2::of(*stencil) * (heights[other as usize][0] - own)
            });
            let all = risen.fold(V2::default(), |sum, part| sum + part);
            *slope = [all.x, all.y];
        }
    });
    let slopes = &*slopes;
    let of_pixel = |pixel: usize, points: &mut [[F; 4]]| {
        let ([depth, light], slope) = (heights[pixel], V2::of(slopes[pixel]));
        let albedo = light * stretch(directed, slope) / F::of(each as f64);
        let centre = field.centre(pixel);
        for (k, point) in points.iter_mut().enumerate() {
            let d = field.part(k, each);
            let z = (depth + slope.dot(d)).max(near).min(far);
            *point = [centre.x + d.x, centre.y + d.y, z, albedo];
        }
        albedo
    };
    let points = &mut points[..each * count];
    let peaks: Vec<F> = points
        .par_chunks_mut(each * group)
        .enumerate()
        .map(|(i, points)| {
            let all = (i * group..).zip(points.chunks_exact_mut(each));
            let larger = |most: F, albedo: F| if albedo <= most { most } else { albedo };
            all.map(|(pixel, points)| of_pixel(pixel, points)).fold(F::zero(), larger)
        })
        .collect();
    if directed {
        normals[..each * count].par_chunks_mut(each * group).enumerate().for_each(|(i, normals)| {
            for (pixel, normals) in (i * group..).zip(normals.chunks_exact_mut(each)) {
                normals.fill(facing(V2::of(slopes[pixel])).with(F::zero()));
            }
        });
    }
    watch(counts, FAULT_SAMPLE, slopes.as_flattened());
    watch(counts, FAULT_SAMPLE, &peaks);
    let peak = &mut counts[COUNT_PEAK_ALBEDO as usize];
    *peak = peaks.into_iter().fold(*peak, larger);
}
