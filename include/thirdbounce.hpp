// thirdbounce for C++17: handles that free themselves, errors as exceptions. Thread rules are those of thirdbounce.h.
#ifndef THIRDBOUNCE_HPP
#define THIRDBOUNCE_HPP

#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "thirdbounce.h"

namespace thirdbounce {

// What was wrong, and how to mend it.
struct Error : std::runtime_error {
    Error(tb_status status, const std::string &what, const std::string &remedy)
        : std::runtime_error(what), status(status), remedy(remedy) {}
    tb_status status;
    std::string remedy;
};

inline void check(tb_status status) {
    if (status != TB_OK) throw Error(status, tb_last_error(), tb_last_hint());
}

// An opened device.
class Device {
public:
    // The device whose name has this part, or the best one.
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

// A solver for frames of one scan.
class Session {
public:
    Session(const Device &device, const tb_scan &scan, const tb_settings &settings) {
        tb_session *made = nullptr;
        check(tb_session_new(device.handle(), &scan, &settings, &made));
        handle_.reset(made);
    }
    // Begins to solve a frame; its number.
    uint64_t submit(const std::vector<float> &counts) {
        uint64_t id = 0;
        check(tb_session_submit(handle_.get(), counts.data(), counts.size(), &id));
        return id;
    }
    // The same for a scan that goes on: only pairs whose byte is not 0 have new counts.
    uint64_t submit_part(const std::vector<float> &counts, const std::vector<uint8_t> &measured) {
        uint64_t id = 0;
        check(tb_session_submit_partial(handle_.get(), counts.data(), counts.size(), measured.data(), measured.size(), &id));
        return id;
    }
    // How long the last frames took.
    tb_latency latency() const {
        tb_latency told{};
        told.size = sizeof told;
        check(tb_session_latency(handle_.get(), &told));
        return told;
    }
    // Waits for the frame that was submitted last.
    tb_frame wait() { return *wait_for(-1.0); }
    // The same, up to so many seconds; nothing if it is not solved by then. The arrays are valid until the next frame.
    std::optional<tb_frame> wait_for(double seconds) {
        tb_frame frame{};
        frame.size = sizeof frame;
        const tb_status status = tb_session_wait(handle_.get(), seconds, &frame);
        if (status == TB_NOT_READY) return std::nullopt;
        check(status);
        return frame;
    }
    // Stops the frame that is being solved. Any thread.
    void cancel() const { check(tb_session_cancel(handle_.get())); }

private:
    struct Free {
        void operator()(tb_session *session) const { tb_session_free(session); }
    };
    std::unique_ptr<tb_session, Free> handle_;
};

}  // namespace thirdbounce

#endif
