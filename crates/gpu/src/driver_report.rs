//! Fault reports of a lost device (VK_EXT_device_fault), for the error of the loss.

use std::ffi::{CStr, c_char};

use ash::{ext, vk};

/// Maximum number of addresses and vendor codes in an error.
const NAMED: usize = 4;

/// A fault reported by the driver.
#[derive(Debug, Default)]
struct DriverReport {
    description: String,
    addresses: Vec<vk::DeviceFaultAddressInfoEXT>,
    vendor: Vec<vk::DeviceFaultVendorInfoEXT>,
}

/// Suffix of a device loss error: the driver's report, empty without one. `injected`: address of an injected fault,
/// for tests.
pub(super) fn text(injected: Option<u64>, device: Option<&ext::device_fault::Device>) -> String {
    let injected = injected.map(|address| DriverReport {
        addresses: vec![vk::DeviceFaultAddressInfoEXT {
            address_type: vk::DeviceFaultAddressTypeEXT::READ_INVALID,
            reported_address: address,
            address_precision: 1,
        }],
        ..DriverReport::default()
    });
    injected.or_else(|| device.and_then(asked)).unwrap_or_default().text()
}

/// Queries the driver; `None` without an answer.
fn asked(of: &ext::device_fault::Device) -> Option<DriverReport> {
    let ask = of.fp().get_device_fault_info_ext;
    let mut counts = vk::DeviceFaultCountsEXT::default();
    // SAFETY: the device is lost, as required. Without a second struct only counts are written.
    unsafe { ask(of.device(), &mut counts, std::ptr::null_mut()) }.result().ok()?;
    let mut report = DriverReport {
        addresses: vec![Default::default(); counts.address_info_count as usize],
        vendor: vec![Default::default(); counts.vendor_info_count as usize],
        ..DriverReport::default()
    };
    // The vendor binary is not used.
    counts.vendor_binary_size = 0;
    let mut info = vk::DeviceFaultInfoEXT {
        p_address_infos: report.addresses.as_mut_ptr(),
        p_vendor_infos: report.vendor.as_mut_ptr(),
        ..Default::default()
    };
    // SAFETY: both lists have the lengths in `counts` and outlive the call. If more faults occurred since, the driver
    // fills the lists and returns VK_INCOMPLETE.
    let answer = unsafe { ask(of.device(), &mut counts, &mut info) };
    if !matches!(answer, vk::Result::SUCCESS | vk::Result::INCOMPLETE) {
        return None;
    }
    report.description = text_of(&info.description);
    report.addresses.truncate(counts.address_info_count as usize);
    report.vendor.truncate(counts.vendor_info_count as usize);
    Some(report)
}

/// A driver's text, up to its terminating zero.
fn text_of(chars: &[c_char]) -> String {
    let bytes: &[u8] = bytemuck::cast_slice(chars);
    let text = CStr::from_bytes_until_nul(bytes).map_or(bytes, CStr::to_bytes);
    String::from_utf8_lossy(text).trim().into()
}

impl DriverReport {
    fn text(&self) -> String {
        let of_driver = Some(self.description.clone()).filter(|text| !text.is_empty());
        let addresses = self.addresses.iter().filter_map(place).take(NAMED);
        let codes = self.vendor.iter().take(NAMED).map(|v| {
            format!("{} {:#x} {:#x}", text_of(&v.description), v.vendor_fault_code, v.vendor_fault_data)
        });
        let all: Vec<_> = of_driver.into_iter().chain(addresses).chain(codes).collect();
        if all.is_empty() { String::new() } else { format!("; driver report: {}", all.join(", ")) }
    }
}

/// Address of a fault, with its known precision.
fn place(info: &vk::DeviceFaultAddressInfoEXT) -> Option<String> {
    use vk::DeviceFaultAddressTypeEXT as Type;
    let what = match info.address_type {
        Type::READ_INVALID => "invalid read at",
        Type::WRITE_INVALID => "invalid write at",
        Type::EXECUTE_INVALID => "execution of invalid memory at",
        Type::INSTRUCTION_POINTER_INVALID => "invalid instruction at",
        Type::INSTRUCTION_POINTER_FAULT | Type::INSTRUCTION_POINTER_UNKNOWN => "fault of the instruction at",
        _ => return None,
    };
    let at = info.reported_address;
    // A power of two by specification.
    let last_bits = info.address_precision.max(1).wrapping_sub(1);
    Some(match last_bits {
        0 => format!("{what} {at:#x}"),
        _ => format!("{what} {:#x} to {:#x}", at & !last_bits, at | last_bits),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chars(text: &str) -> [c_char; vk::MAX_DESCRIPTION_SIZE] {
        let mut all = [0; vk::MAX_DESCRIPTION_SIZE];
        all.iter_mut().zip(text.bytes()).for_each(|(c, b)| *c = b as c_char);
        all
    }

    #[test]
    fn an_error_names_what_the_driver_tells_and_only_that() {
        assert_eq!(DriverReport::default().text(), "");
        let at = |address_type, reported_address, address_precision| vk::DeviceFaultAddressInfoEXT {
            address_type,
            reported_address,
            address_precision,
        };
        let none = DriverReport {
            addresses: vec![at(vk::DeviceFaultAddressTypeEXT::NONE, 7, 1)],
            ..DriverReport::default()
        };
        assert_eq!(none.text(), "");
        let report = DriverReport {
            description: text_of(&chars(" MMU fault ")),
            addresses: vec![
                at(vk::DeviceFaultAddressTypeEXT::WRITE_INVALID, 0x12_3456, 0x1000),
                at(vk::DeviceFaultAddressTypeEXT::INSTRUCTION_POINTER_FAULT, 0x20, 0),
            ],
            vendor: vec![vk::DeviceFaultVendorInfoEXT {
                description: chars("engine"),
                vendor_fault_code: 13,
                vendor_fault_data: 255,
            }],
        };
        assert_eq!(
            report.text(),
            "; driver report: MMU fault, invalid write at 0x123000 to 0x123fff, fault of the instruction at 0x20, engine 0xd 0xff"
        );
        let many = vec![at(vk::DeviceFaultAddressTypeEXT::READ_INVALID, 1, 1); 9];
        assert_eq!(
            DriverReport { addresses: many, ..DriverReport::default() }
                .text()
                .matches("invalid read")
                .count(),
            NAMED
        );
        // An unterminated text is used completely.
        assert_eq!(text_of(&[b'x' as c_char; 4]), "xxxx");
    }
}
