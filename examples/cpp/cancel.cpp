// A frame that another thread cancels, frames that are refused, and one that is solved after all.
//
//     c++ -std=c++17 cancel.cpp $(pkg-config --cflags --libs thirdbounce) -lpthread -o cancel && ./cancel
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <mutex>
#include <thirdbounce.hpp>
#include <thread>

using namespace thirdbounce;

namespace {

constexpr std::size_t side = 8, pairs = side * side, bins = 80;
constexpr double bin_width = 0.03;

// Returns how a call failed.
template <class Call>
tb_status refused(Call call) {
    try {
        call();
    } catch (const Error &error) {
        std::printf("refused: %s\n  %s\n", error.what(), error.hint.c_str());
        return error.status;
    }
    return TB_OK;
}

}  // namespace

int main() {
    std::vector<double> wall;
    std::vector<float> counts(pairs * bins, 1.0f);
    for (std::size_t pair = 0; pair < pairs; pair++) {
        const double x = (double(pair / side) + 0.5) / side - 0.5, y = (double(pair % side) + 0.5) / side - 0.5;
        wall.insert(wall.end(), {x, y, 0.0});
        counts[pair * bins + std::size_t(2.0 * std::sqrt(x * x + y * y + 0.49) / bin_width)] += 500.0f;
    }
    std::atomic<int> errors{0};
    set_log([&](tb_level level, const char *) { errors += level == TB_LEVEL_ERROR; });
    const Device device;
    tb_scan scan{};
    scan.size = sizeof scan, scan.points_x = scan.points_y = side, scan.laser_xyz = wall.data();
    scan.bins = bins, scan.bin_width = bin_width;
    // The first report of a frame lets the main thread go on. `fraction` never falls.
    static std::atomic<int> reports{0}, falls{0};
    tb_settings settings{};
    settings.size = sizeof settings, settings.lateral = 16;
    // Written by the session's thread, read by this one.
    struct Newest {
        std::mutex lock;
        tb_progress progress{};
    } newest;
    settings.user_data = &newest;
    settings.progress = [](void *user, const tb_progress *progress) -> int32_t {
        Newest &own = *static_cast<Newest *>(user);
        const std::lock_guard<std::mutex> guard(own.lock);
        tb_progress &last = own.progress;
        falls += (progress->frame == last.frame && progress->fraction < last.fraction) || progress->fraction > 1.0;
        last = *progress;
        reports++;
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
        return 0;
    };
    Session session(device, scan, settings);

    bool good = refused([&] { session.submit(std::vector<float>(3)); }) == TB_ERROR_INPUT;
    std::vector<float> broken = counts;
    broken[5] = std::numeric_limits<float>::quiet_NaN();
    good &= refused([&] { session.submit(broken); }) == TB_ERROR_INPUT;
    good &= refused([&] { session.wait(); }) == TB_ERROR_OPTIONS;
    tb_settings unknown = settings;
    unknown.options = "no-such=1";
    good &= refused([&] { Session(device, scan, unknown); }) == TB_ERROR_OPTIONS;

    tb_settings small = settings;
    small.memory_limit = 1000;
    try {
        Session(device, scan, small);
        good = false;
    } catch (const Error &error) {
        good &= error.status == TB_ERROR_MEMORY && error.info.status == TB_ERROR_MEMORY && !error.settings().empty();
        std::printf("requested %d MB, available %d B\n", int(error.info.requested_bytes >> 20), int(error.info.available_bytes));
    }
    tb_scan without = scan;
    without.laser_xyz = nullptr, without.sensor_xyz = wall.data();
    good &= refused([&] { Session(device, without, settings); }) == TB_ERROR_OPTIONS;
    good &= refused([&] { Device(tb_vulkan{}); }) == TB_ERROR_OPTIONS;

    session.submit(counts);
    while (reports == 0) std::this_thread::yield();
    std::thread([&] { session.cancel(); }).join();
    good &= refused([&] { session.wait(); }) == TB_ERROR_CANCELLED;

    session.submit(counts);
    const tb_frame frame = session.wait();
    std::size_t lit = 0;
    for (std::size_t i = 0; i < frame.nx * frame.ny; i++) {
        lit += frame.mask[i];
        good &= !frame.mask[i] || (frame.depth[i] > frame.volume_min[2] && frame.depth[i] < frame.volume_max[2]);
        good &= !frame.mask[i] || frame.depth_error[i] > 0.0f;
    }
    std::printf("frame %d: %zu pixels of surface\n", int(frame.id), lit);
    {
        const std::lock_guard<std::mutex> guard{newest.lock};
        good &= falls == 0 && newest.progress.frame == frame.id && newest.progress.fraction > 0.0;
    }
    set_log({});
    good &= errors == 8 && refused([&] { session.submit(nullptr, 3); }) == TB_ERROR_OPTIONS && errors == 8;
    std::puts(good && lit > 0 ? "as it should be" : "not as it should be");
    return good && lit > 0 ? 0 : 1;
}
