/* thirdbounce: reconstructs what is behind a corner. Written by `make header` from capi/src; docs/embedding.md explains it. */

#ifndef THIRDBOUNCE_H
#define THIRDBOUNCE_H

#include <stddef.h>
#include <stdint.h>

// Version of this interface. Structs may grow within a version: they begin with their size.
#define TB_API_VERSION 1

// Most settings that a `tb_problem` names.
#define TB_PROBLEM_SETTINGS 4

// How a call went.
typedef enum tb_status {
    // It went well.
    TB_OK = 0,
    // The scan or the counts cannot be used.
    TB_INPUT = 1,
    // An argument or a setting is not valid, or does not fit what the session is doing.
    TB_OPTIONS = 2,
    // No Vulkan device, a missing feature, a lost device.
    TB_DEVICE = 3,
    // Not enough memory.
    TB_MEMORY = 4,
    // Something could not be written.
    TB_OUTPUT = 5,
    // The frame was stopped.
    TB_CANCELLED = 6,
    // A defect of the library.
    TB_DEFECT = 7,
    // No result yet.
    TB_NOT_YET = 8,
} tb_status;

// What a message is.
typedef enum tb_level {
    // What the library did.
    TB_NOTE = 0,
    // Why a call failed.
    TB_ERROR = 1,
} tb_level;

// An opened Vulkan device. Any thread may use it, and any number of sessions at once.
typedef struct tb_device tb_device;

// A solver with everything that it needs for frames of one scan.
typedef struct tb_session tb_session;

// What was wrong, for programs. Set `size` before the call.
typedef struct tb_problem {
    // sizeof(tb_problem).
    size_t size;
    // The status of the call; TB_OK if none failed.
    enum tb_status status;
    // How many of `settings` are there.
    uint32_t setting_count;
    // The settings that may mend it, by their names in the library ("lateral", "memory"). They live as long as the program.
    const char *settings[TB_PROBLEM_SETTINGS];
    // What was asked for and what there is, bytes; 0 if unknown or if it is not about memory.
    uint64_t asked;
    uint64_t available;
} tb_problem;

// Receives messages. `text` is valid during the call.
typedef void (*tb_log)(void *user, enum tb_level level, const char *text);

// Pairs of wall points and their histograms' bins. Zero everything, then set `size`; zero is the default of every field
// that may be left out.
typedef struct tb_scan {
    // sizeof(tb_scan).
    size_t size;
    // Points along x, and along y; 1 for a list of pairs. Pair ix * points_y + iy is at ix along +x and iy along +y.
    size_t points_x;
    size_t points_y;
    // Laser points, metres: x, y, z of each pair. Copied.
    const double *laser;
    // Sensor points, metres: x, y, z of each pair. NULL: the laser's. Copied.
    const double *sensor;
    // Bins of a histogram.
    size_t bins;
    // Width of a bin, metres of path: seconds times 299792458.
    double bin_width;
    // Leading edge of bin 0, metres of path.
    double t_start;
    // 1 if counts are photon counts: whole, and their variance is their mean.
    uint32_t photon_counts;
    // Not used: 0.
    uint32_t reserved;
    // Full width at half maximum of the instrument's pulse, metres of path; 0 if unknown.
    double pulse_fwhm;
    // The same of the laser's and of the sensor's spot on the wall, metres; 0 for points.
    double laser_spot;
    double sensor_spot;
} tb_scan;

// What a progress function is told.
typedef struct tb_progress {
    // sizeof(tb_progress) of the library.
    size_t size;
    // The frame.
    uint64_t frame;
    // Iterations done, and iterations of the whole frame.
    size_t iteration;
    size_t iterations;
    // The loss.
    double loss;
    // Seconds since the frame began.
    double seconds;
} tb_progress;

// Hears of the progress. Returns 0 to go on; anything else stops the frame.
typedef int32_t (*tb_hear)(void *user, const struct tb_progress *progress);

// How a session solves. Zero everything, then set `size`; zero is the default of every field.
typedef struct tb_settings {
    // sizeof(tb_settings).
    size_t size;
    // "vector", "paper" or a closed-form method such as "lct" or "fbp"; NULL: the default solver.
    const char *solver;
    // Lateral pixels of the maps; 0: the solver's default.
    size_t lateral;
    // Further options of the solver as "name=value name=value", by their names on the command line; NULL: none.
    const char *options;
    // Most device memory to use, bytes; 0: what is free.
    uint64_t memory;
    // A frame that takes longer is stopped, seconds; 0: none is.
    double time_limit;
    // Hears of the progress. Called by the session's own thread; it must not call functions of this session but
    // `tb_session_cancel`.
    tb_hear hear;
    // Given to `hear`.
    void *user;
    // 1: a frame begins with the solution of the frame before, and takes a fifth of the iterations. For "vector".
    uint32_t follow;
    // Not used: 0.
    uint32_t reserved;
    // Time for a frame, seconds: as many iterations as fit, and always a whole picture; 0: no limit. It needs `follow`.
    double budget;
} tb_settings;

// A solved frame. All arrays belong to the session. They stay valid until the next `tb_session_wait` that returns a frame,
// and until the session is freed. Pixel [ix * ny + iy] of each is at ix along +x and iy along +y.
typedef struct tb_frame {
    // sizeof(tb_frame): set it before the call.
    size_t size;
    // The frame's number.
    uint64_t id;
    // Pixels along x and y.
    size_t nx;
    size_t ny;
    // Outer edges of the pixels, metres: x min, x max, y min, y max.
    double extent[4];
    // Albedo; its unit is that of the scaled counts.
    const float *albedo;
    // Depth, metres; NaN where nothing is.
    const float *depth;
    // Unit normals toward the wall, x, y, z of each pixel; NaN where nothing is.
    const float *normal;
    // 1 where there is surface.
    const uint8_t *mask;
    // Iterations that were done.
    size_t iterations;
    // Seconds that solving took.
    double seconds;
    // The depth error that two of three pixels with this value do not exceed, metres; NaN where nothing is. NULL without.
    const float *confidence;
    // The surfaces behind the first ones, as above; NULL where no pixel has two.
    const float *behind_albedo;
    const float *behind_depth;
    const float *behind_normal;
    const uint8_t *behind_mask;
    const float *behind_confidence;
    // The box that is reconstructed: its corners x, y, z, metres, and the voxels of the finest volume along each.
    double box_min[3];
    double box_max[3];
    size_t voxels[3];
    // 1 if it began with the solution of the frame before.
    uint32_t warm;
    // Not used: 0.
    uint32_t reserved;
} tb_frame;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Version of the library, "0.1.0". Any thread.
const char *tb_version(void);

// Opens a device into `device`. `api_version` is `TB_API_VERSION`: a library of another version refuses it. `name` is a
// part of the device's name or its index, or NULL for the best one. Any thread.
//
// # Safety
// `name` is NULL or a string that ends with a zero; `device` points to a pointer.
enum tb_status tb_device_open(uint32_t api_version,
                              const char *name,
                              struct tb_device **device);

// The device's name; it lives as long as `device`. Any thread.
//
// # Safety
// `device` is open.
const char *tb_device_name(const struct tb_device *device);

// Gives a device back; NULL does nothing. Sessions keep what they need of it. Any thread, once.
//
// # Safety
// `device` is open, and nobody uses the handle meanwhile or afterwards.
void tb_device_close(struct tb_device *device);

// What was wrong at this thread's last call that failed; empty if none did. Valid until this thread's next call that
// fails.
const char *tb_last_error(void);

// How to mend it. As `tb_last_error`.
const char *tb_last_remedy(void);

// The same in numbers and names: writes it to `problem`. TB_OPTIONS if `problem` is NULL or too small; the last error stays.
//
// # Safety
// `problem` begins with its size, and may be written.
enum tb_status tb_last_problem(struct tb_problem *problem);

// Sends messages to `log` from now on, with `user`; NULL sends none. Any thread. `log` is called by any thread that calls
// the library, one at a time, and must not call the library itself.
//
// # Safety
// `log` may be called with `user` until another one is set.
void tb_set_log(tb_log log,
                void *user);

// Makes a session into `session`: everything is compiled and allocated here. Any thread.
//
// # Safety
// `device` is open. `scan` and `settings` begin with their sizes; `settings` may be NULL. Strings end with a zero, arrays
// are as long as `tb_scan` says, and `session` points to a pointer. `hear` may be called with `user` by another thread
// until the session is freed.
enum tb_status tb_session_new(const struct tb_device *device,
                              const struct tb_scan *scan,
                              const struct tb_settings *settings,
                              struct tb_session **session);

// Begins to solve a frame and returns. `counts` are those of bin b of pair p at [p * bins + b], `count` of them; they are
// copied. `frame` receives the frame's number; it may be NULL. TB_INPUT if the counts cannot be used, TB_OPTIONS while a
// frame is being solved: nothing changes then. Any thread; calls for one session wait for each other.
//
// # Safety
// `session` lives. `counts` holds `count` numbers. `frame` is NULL or may be written.
enum tb_status tb_session_submit(const struct tb_session *session,
                                 const float *counts,
                                 size_t count,
                                 uint64_t *frame);

// Waits up to `seconds` for the frame that was submitted last: 0 only looks, below 0 waits as long as it takes. TB_OK with
// the frame; TB_NOT_YET if it is not solved by then, or there is none; else why it failed or that it was stopped
// (TB_CANCELLED). The next one can be submitted then. Below 0 without a frame is TB_OPTIONS. Any thread; calls for one
// session wait for each other.
//
// # Safety
// `session` lives. `frame` begins with its size, and may be written.
enum tb_status tb_session_wait(const struct tb_session *session,
                               double seconds,
                               struct tb_frame *frame);

// Stops the frame that is being solved, if there is one; its `tb_session_wait` then returns TB_CANCELLED. Returns at once.
// Any thread, also while another one waits, and from `hear`; not from a signal handler.
//
// # Safety
// `session` lives.
enum tb_status tb_session_cancel(const struct tb_session *session);

// Stops what the session does, and frees it with its last frame; NULL does nothing. Any thread, once; not from `hear`.
//
// # Safety
// `session` lives, and nobody uses the handle meanwhile or afterwards.
void tb_session_free(struct tb_session *session);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* THIRDBOUNCE_H */
