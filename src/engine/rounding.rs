//! A test of how a device rounds, for devices that do not promise to round to nearest. Places among bins need it
//! (`glsl/include/place.glsl`).

use crate::advice::advice;
use crate::gpu::{Arena, Buffer, BufferPlan, Executor, Gpu, Place, Schedule};
use crate::transport::kernels::{buffer, kernel};
use crate::{Error, Result};

const BACK: Buffer = Buffer::named("rounding_host");

/// Places that are tested: eighths from zero on.
const PLACES: usize = 64;

/// Tests a device that does not promise how it rounds.
///
/// # Errors
/// It does not round to nearest, or it fails.
pub(crate) fn check(gpu: &Gpu) -> Result<()> {
    if gpu.promises_rounding() || is_nearest(&measure(gpu)?) {
        return Ok(());
    }
    Err(Error::device(
        format!("{} does not round to the nearest number: light would come into wrong bins", gpu.info.name),
        advice!["update its driver, or choose another device with " Device],
    ))
}

/// Places that the device rounded down, each plus 2^23.
fn measure(gpu: &Gpu) -> Result<Vec<f32>> {
    let bytes = 4 * PLACES as u64;
    let plan = [
        BufferPlan::new(buffer::RESULT, bytes, Place::Device),
        BufferPlan::new(BACK, bytes, Place::Readback),
    ];
    let mut executor = Executor::new(gpu, Arena::new(gpu, &plan, None)?)?;
    executor.add_kernel(&kernel::ROUNDING, &kernel::ROUNDING, &[])?;
    let mut s = Schedule::default();
    s.dispatch(&kernel::ROUNDING, [1, 1, 1], PLACES as u64);
    s.copy(buffer::RESULT, BACK, bytes);
    executor.run(&s)?;
    Ok(executor.read(BACK, ..))
}

/// Whether every place lies between its whole part and the next one.
fn is_nearest(wholes: &[f32]) -> bool {
    wholes.iter().enumerate().all(|(i, whole)| {
        let share = i as f64 / 8.0 - (f64::from(*whole) - 8_388_608.0);
        (0.0..=1.0).contains(&share)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::GpuOptions;

    #[test]
    fn this_device_rounds_to_nearest_and_one_that_cuts_off_is_found() {
        let gpu = Gpu::open(&GpuOptions::default()).expect("the host at least");
        let wholes = measure(&gpu).unwrap();
        assert_eq!(wholes.len(), PLACES);
        assert!(is_nearest(&wholes), "{wholes:?}");
        check(&gpu).unwrap();
        // Toward zero: floats from 2^23 on are whole, those below are halves.
        let exact = |i: usize| 8_388_607.5 + i as f64 / 8.0;
        let cut = |v: f64| if v < 8_388_608.0 { (2.0 * v).floor() / 2.0 } else { v.floor() };
        let toward_zero: Vec<f32> = (0..PLACES).map(|i| cut(exact(i)) as f32).collect();
        assert!(!is_nearest(&toward_zero));
    }
}
