// thirdbounce for C++17: owning handles, errors as exceptions. Thread rules are those of thirdbounce.h.
#ifndef THIRDBOUNCE_HPP
#define THIRDBOUNCE_HPP

#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "thirdbounce.h"

namespace thirdbounce {

// Message and hint of a failed call.
struct Error : std::runtime_error {
    Error(tb_status status, const std::string &what, const std::string &hint)
        : std::runtime_error(what), status(status), hint(hint) {}
    tb_status status;
    std::string hint;
};

inline void check(tb_status status) {
    if (status != TB_OK) throw Error(status, tb_last_error(), tb_last_hint());
}

// The Vulkan devices of this machine.
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

// An opened device.
class Device {
public:
    // Opens the device with this part in its name, or the best one.
    explicit Device(const char *name = nullptr) {
        tb_device *made = nullptr;
        check(tb_device_open(TB_API_VERSION, name, &made));
        handle_.reset(made);
    }
    std::string name() const { return tb_device_name(handle_.get()); }
    const tb_device *handle() const { return handle_.get(); }

private:
    struct Close {
        void operator()(tb_device *device) const { tb_device_close(device); }
    };
    std::unique_ptr<tb_device, Close> handle_;
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
    uint64_t submit(const std::vector<float> &counts) {
        uint64_t id = 0;
        check(tb_session_submit(handle_.get(), counts.data(), counts.size(), &id));
        return id;
    }
    // Submits a partial scan: only pairs with a nonzero byte have new counts.
    uint64_t submit_part(const std::vector<float> &counts, const std::vector<uint8_t> &measured) {
        uint64_t id = 0;
        check(tb_session_submit_partial(handle_.get(), counts.data(), counts.size(), measured.data(), measured.size(), &id));
        return id;
    }
    // Latency statistics of the last frames.
    tb_latency latency() const {
        tb_latency latency{};
        latency.size = sizeof latency;
        check(tb_session_latency(handle_.get(), &latency));
        return latency;
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
    // Cancels the current frame. Any thread.
    void cancel() const { check(tb_session_cancel(handle_.get())); }

private:
    struct Free {
        void operator()(tb_session *session) const { tb_session_free(session); }
    };
    std::unique_ptr<tb_session, Free> handle_;
};

}  // namespace thirdbounce

#endif
