//! Labels around commands, for validation messages and debugging tools.

use std::ffi::CStr;
use std::fmt::{self, Write};

use ash::vk;

use super::device::Gpu;

impl Gpu {
    /// Opens a label around subsequent commands of `commands`, shown by RenderDoc and Nsight.
    pub(super) fn open_label(&self, commands: vk::CommandBuffer, text: &dyn std::fmt::Display) {
        let Some(names) = &self.vulkan().names else { return };
        let mut label = Label::default();
        // A truncated label is still closed.
        let _ = write!(label, "{text}");
        let info = vk::DebugUtilsLabelEXT::default().label_name(label.text());
        // SAFETY: the caller is recording into `commands`, and the label lives through the call.
        unsafe { names.cmd_begin_debug_utils_label(commands, &info) };
    }

    /// Closes the innermost label.
    pub(super) fn close_label(&self, commands: vk::CommandBuffer) {
        let Some(names) = &self.vulkan().names else { return };
        // SAFETY: the caller is recording into `commands` and has opened a label in it.
        unsafe { names.cmd_end_debug_utils_label(commands) };
    }
}

/// Inline text of a label, one per command.
struct Label {
    bytes: [u8; 128],
    used: usize,
}

impl Default for Label {
    fn default() -> Label {
        Label { bytes: [0; 128], used: 0 }
    }
}

impl Label {
    /// Content up to the first zero.
    fn text(&self) -> &CStr {
        CStr::from_bytes_until_nul(&self.bytes).unwrap_or_default()
    }
}

impl fmt::Write for Label {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        // The last byte remains zero.
        let room = &mut self.bytes[self.used..127];
        let fits = text.len().min(room.len());
        room[..fits].copy_from_slice(&text.as_bytes()[..fits]);
        self.used += fits;
        if fits < text.len() { Err(fmt::Error) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_label_is_cut_off() {
        let mut label = Label::default();
        let lateral = 32;
        write!(label, "iteration lateral={lateral}").unwrap();
        assert_eq!(label.text(), c"iteration lateral=32");
        assert!(write!(label, "{}", "x".repeat(200)).is_err());
        assert_eq!(label.text().to_bytes().len(), 127);
        assert!(write!(label, "more").is_err() && label.text().to_bytes().ends_with(b"xx"));
    }
}
