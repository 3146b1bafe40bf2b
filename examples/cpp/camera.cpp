// A camera thread submits frames as they come, half a scan each; the main thread shows the newest result and how long it took.
//
//     c++ -std=c++17 camera.cpp $(pkg-config --cflags --libs thirdbounce) -lpthread -o camera && ./camera
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <thirdbounce.hpp>
#include <thread>

using namespace thirdbounce;

namespace {

constexpr std::size_t side = 8, pairs = side * side, bins = 80, frames = 12;
constexpr double bin_width = 0.03;

}  // namespace

int main() {
    std::vector<double> wall;
    for (std::size_t pair = 0; pair < pairs; pair++) {
        const double x = (double(pair / side) + 0.5) / side - 0.5, y = (double(pair % side) + 0.5) / side - 0.5;
        wall.insert(wall.end(), {x, y, 0.0});
    }
    const Device device;
    tb_scan scan{};
    scan.size = sizeof scan, scan.points_x = scan.points_y = side, scan.laser_xyz = wall.data();
    scan.bins = bins, scan.bin_width = bin_width, scan.photon_counts = 1;
    tb_settings settings{};
    settings.size = sizeof settings, settings.lateral = 16, settings.options = "iterations=20";
    settings.frame_policy = TB_FRAMES_NEWEST;
    Session session(device, scan, settings);

    std::atomic<bool> ended{false};
    std::thread camera([&] {
        for (std::size_t frame = 0; frame < frames; frame++) {
            // Even pairs, then odd ones; their counts of a plate that moves to the right.
            std::vector<float> counts(pairs * bins);
            std::vector<uint8_t> measured(pairs);
            for (std::size_t pair = frame % 2; pair < pairs; pair += 2) {
                measured[pair] = 1;
                for (int part = 0; part < 36; part++) {
                    const double dx = wall[3 * pair] - (0.01 * double(frame) - 0.2 + 0.06 * (part / 6));
                    const double dy = wall[3 * pair + 1] - (0.06 * (part % 6) - 0.15), far = dx * dx + dy * dy + 0.36;
                    counts[pair * bins + std::size_t(2.0 * std::sqrt(far) / bin_width)] += float(std::floor(9.0 / (far * far)));
                }
            }
            session.submit_partial(counts.data(), counts.size(), measured.data(), measured.size());
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
        }
        ended = true;
    });
    std::size_t shown = 0, lit = 0;
    uint64_t last = 0;
    while (last < frames) {
        const auto frame = session.wait_for(0.2);
        if (!frame) continue;
        lit = 0;
        for (std::size_t i = 0; i < frame->nx * frame->ny; i++) lit += frame->mask[i];
        std::printf("frame %d: %zu pixels of surface\n", int(frame->id), lit);
        last = frame->id, shown++;
    }
    camera.join();
    const tb_latency latency = session.latency();
    std::printf("%d solved, %d dropped, median %.0f ms, 99 %% within %.0f ms\n", int(latency.frames), int(latency.dropped),
                1e3 * latency.median, 1e3 * latency.p99);
    const bool good = ended && lit > 0 && latency.frames == shown && latency.frames + latency.dropped == frames && latency.median <= latency.p99;
    std::puts(good ? "every frame was shown or dropped" : "a frame was lost");
    return good ? 0 : 1;
}
