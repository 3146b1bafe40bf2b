// thirdbounce for C++17: owning handles, errors as exceptions. Thread rules are those of thirdbounce.h.
#ifndef THIRDBOUNCE_HPP
#define THIRDBOUNCE_HPP

#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "thirdbounce.h"

namespace thirdbounce {

// Message, hint and details of a failed call.
struct Error : std::runtime_error {
    explicit Error(tb_status code) : std::runtime_error(tb_last_error()), status(code), hint(tb_last_hint()) {
        info.size = sizeof info;
        tb_last_error_info(&info);
    }
    tb_status status;
    std::string hint;
    tb_error_info info{};
    // Names of settings that may fix the error.
    std::vector<std::string> settings() const { return {info.settings, info.settings + info.setting_count}; }
};

inline void check(tb_status status) {
    if (status != TB_OK) throw Error(status);
}

// Sets the receiver of log messages; an empty function disables logging. One thread at a time.
inline void set_log(std::function<void(tb_level, const char *)> receiver) {
    static std::function<void(tb_level, const char *)> current;
    tb_set_log_callback(nullptr, nullptr);
    current = std::move(receiver);
    if (current) tb_set_log_callback([](void *, tb_level level, const char *text) { current(level, text); }, nullptr);
}

// The devices of this machine: of Vulkan, and the host.
inline std::vector<tb_device_info> devices() {
    uint32_t count = 0;
    check(tb_device_count(&count));
    std::vector<tb_device_info> all(count);
    for (uint32_t i = 0; i < count; i++) {
        all[i].size = sizeof(tb_device_info);
        check(tb_device_info_at(i, &all[i]));
    }
    return all;
}

// Requirements for creating a Vulkan device.
inline tb_requirements requirements(const tb_vulkan &vulkan) {
    tb_requirements found{};
    found.size = sizeof found;
    check(tb_vulkan_requirements(&vulkan, &found));
    return found;
}

// A handle that `free_handle` frees.
template <typename T, void (*free_handle)(T *)>
struct Freeing {
    void operator()(T *handle) const { free_handle(handle); }
};
template <typename T, void (*free_handle)(T *)>
using Handle = std::unique_ptr<T, Freeing<T, free_handle>>;

// An opened device.
class Device {
public:
    // Opens the device with this part in its name, or the best one.
    explicit Device(const char *part = nullptr) {
        tb_device *made = nullptr;
        check(tb_device_open(TB_API_VERSION, part, &made));
        handle_.reset(made);
    }
    // A device of the application's Vulkan handles.
    explicit Device(const tb_vulkan &vulkan) {
        tb_device *made = nullptr;
        check(tb_device_from_vulkan(TB_API_VERSION, &vulkan, &made));
        handle_.reset(made);
    }
    std::string name() const { return tb_device_name(handle_.get()); }
    const tb_device *handle() const { return handle_.get(); }

private:
    Handle<tb_device, tb_device_close> handle_;
};

// Imported external memory: see tb_buffer_import_fd.
class Buffer {
public:
    Buffer(const Device &device, int fd, uint64_t memory_bytes, uint64_t bytes, std::optional<uint32_t> memory_type = {}) {
        tb_buffer *made = nullptr;
        check(memory_type ? tb_buffer_import_fd_of_type(device.handle(), fd, memory_bytes, *memory_type, bytes, &made)
                          : tb_buffer_import_fd(device.handle(), fd, memory_bytes, bytes, &made));
        handle_.reset(made);
    }
    const tb_buffer *handle() const { return handle_.get(); }

private:
    Handle<tb_buffer, tb_buffer_free> handle_;
};

// A capture of a file, with options such as "wall=2m stride=2".
class Capture {
public:
    explicit Capture(const std::string &path, const char *options = nullptr) {
        tb_capture *made = nullptr;
        check(tb_read(path.c_str(), options, &made));
        handle_.reset(made);
    }
    // The scan with its counts, with the lifetime of the capture.
    tb_scan scan() const {
        tb_scan of{};
        of.size = sizeof of;
        check(tb_capture_scan(handle_.get(), &of));
        return of;
    }

private:
    Handle<tb_capture, tb_capture_free> handle_;
};

// A solver prepared for the frames of one scan.
class Session {
public:
    Session(const Device &device, const tb_scan &scan, const tb_settings &settings) {
        tb_session *made = nullptr;
        check(tb_session_new(device.handle(), &scan, &settings, &made));
        handle_.reset(made);
    }
    // Submits a frame without waiting and returns its number.
    uint64_t submit(const float *counts, std::size_t count) {
        uint64_t id = 0;
        check(tb_session_submit(handle_.get(), counts, count, &id));
        return id;
    }
    uint64_t submit(const std::vector<float> &counts) { return submit(counts.data(), counts.size()); }
    // Submits a partial scan: only pairs with a nonzero byte have new counts.
    uint64_t submit_partial(const float *counts, std::size_t count, const uint8_t *measured, std::size_t pairs) {
        uint64_t id = 0;
        check(tb_session_submit_partial(handle_.get(), counts, count, measured, pairs, &id));
        return id;
    }
    uint64_t submit_partial(const std::vector<float> &counts, const std::vector<uint8_t> &measured) {
        return submit_partial(counts.data(), counts.size(), measured.data(), measured.size());
    }
    // Submits a frame in external buffers.
    uint64_t submit_external(const tb_external_frame &frame) {
        uint64_t id = 0;
        check(tb_session_submit_external(handle_.get(), &frame, &id));
        return id;
    }
    // Size of a frame's maps in an external buffer, bytes.
    uint64_t maps_bytes() const { return tb_session_maps_bytes(handle_.get()); }
    // Latency statistics of the last frames.
    tb_latency latency() const {
        tb_latency measured{};
        measured.size = sizeof measured;
        check(tb_session_latency(handle_.get(), &measured));
        return measured;
    }
    // Waits for the next result.
    tb_frame wait() { return *wait_for(-1.0); }
    // Waits up to `seconds`; empty without a result by then. The arrays are valid until the next frame.
    std::optional<tb_frame> wait_for(double seconds) {
        tb_frame frame{};
        frame.size = sizeof frame;
        const tb_status status = tb_session_wait(handle_.get(), seconds, &frame);
        if (status == TB_NOT_READY) return std::nullopt;
        check(status);
        return frame;
    }
    // Saves the maps of the last frame into a folder.
    void save(const std::string &folder) const { check(tb_save(handle_.get(), folder.c_str())); }
    // Cancels the current frame. Any thread.
    void cancel() const { check(tb_session_cancel(handle_.get())); }
    tb_session *handle() const { return handle_.get(); }

private:
    Handle<tb_session, tb_session_free> handle_;
};

}  // namespace thirdbounce

#endif
