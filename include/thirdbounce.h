/* thirdbounce: reconstructs what is behind a corner. Written by `make header` from capi/src; docs/guide/embedding.md explains it. */

#ifndef THIRDBOUNCE_H
#define THIRDBOUNCE_H

#include <stddef.h>
#include <stdint.h>

// Version of this interface. Structs may grow within a version: they begin with their size.
#define TB_API_VERSION 1

// Most settings that a `tb_problem` names.
#define TB_PROBLEM_SETTINGS 4

// Most extensions that `tb_requirements` names.
#define TB_EXTENSIONS 8

// VkPhysicalDeviceVulkan12Features::timelineSemaphore. It must be enabled.
#define TB_FEATURE_TIMELINE_SEMAPHORE 1

// VkPhysicalDeviceFeatures::shaderInt64 and VkPhysicalDeviceVulkan12Features::shaderBufferInt64Atomics.
#define TB_FEATURE_INT64_ATOMICS 2

// VK_EXT_shader_atomic_float with shaderBufferFloat32AtomicAdd.
#define TB_FEATURE_FLOAT_ATOMICS 4

// VK_EXT_memory_budget.
#define TB_FEATURE_MEMORY_BUDGET 8

// VK_KHR_portability_subset.
#define TB_FEATURE_PORTABILITY_SUBSET 16

// VK_KHR_external_memory_fd.
#define TB_FEATURE_EXTERNAL_MEMORY_FD 32

// VK_EXT_debug_utils, of the instance.
#define TB_FEATURE_DEBUG_UTILS 64

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
    // What looks wrong with a result.
    TB_WARNING = 2,
} tb_level;

// What counts in a buffer are.
typedef enum tb_format {
    // 32-bit floats.
    TB_F32 = 0,
    // 32-bit unsigned integers.
    TB_U32 = 1,
    // 16-bit unsigned integers, two to a word.
    TB_U16 = 2,
} tb_format;

// What becomes of a frame that is submitted while another one is being solved.
typedef enum tb_feed {
    // It is refused: TB_OPTIONS.
    TB_ONE = 0,
    // It waits, in the place of the one that waited.
    TB_NEWEST = 1,
    // It waits behind all others, up to `waiting` of tb_settings. Each is solved, once the result before it was taken.
    TB_EVERY = 2,
    // It is added to a running sum, which was multiplied by `decay` of tb_settings before, and is solved as soon as that is
    // possible.
    TB_SUM = 3,
} tb_feed;

// A buffer over memory that another program or interface shares.
typedef struct tb_buffer tb_buffer;

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

// Times of the last frames, up to 256, from submission to result, seconds: what waits is included.
typedef struct tb_latency {
    // sizeof(tb_latency): set it before the call.
    size_t size;
    // Frames that were solved.
    uint64_t frames;
    // Frames that were submitted and never solved, as newer ones replaced them.
    uint64_t dropped;
    // The last frame's time, and those that half, nine of ten and ninety-nine of a hundred frames do not exceed.
    double last;
    double median;
    double p90;
    double p99;
    // Results in a second, while frames came; 0 before the second one.
    double frames_per_second;
} tb_latency;

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
    // The counts of a frame, bin b of pair p at [p * bins + b], copied. The box ends where their light does, and quick solves
    // find the model and the pulse that nobody gave. NULL: the box ends where the bins do, and the model is cosine unless
    // `options` of tb_settings says otherwise.
    const float *counts;
} tb_scan;

// What a progress function is told.
typedef struct tb_progress {
    // sizeof(tb_progress) of the library.
    size_t size;
    // The frame; 0 while `tb_session_new` looks for the model and the pulse.
    uint64_t frame;
    // Iterations done, and iterations of the whole frame.
    size_t iteration;
    size_t iterations;
    // The loss; NaN while a closed form is computed.
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
    // "surface", "paper", or a closed-form method such as "lct" or "fbp"; NULL: the default solver.
    const char *solver;
    // Lateral pixels of the maps; 0: the solver's default.
    size_t lateral;
    // Further options of the solver as "name=value name=value", by their names on the command line, "model=lambertian" among
    // them; NULL: none.
    const char *options;
    // Most device memory to use, bytes; 0: what is free.
    uint64_t memory;
    // A frame that takes longer is stopped, seconds; 0: none is.
    double time_limit;
    // Hears of the progress. Called by the session's own thread, and by `tb_session_new` while it looks for model and pulse; it must not call functions of this session but
    // `tb_session_cancel`.
    tb_hear hear;
    // Given to `hear`.
    void *user;
    // 1: a frame begins with the surface of the frame before, with fewer iterations. For "surface".
    uint32_t follow;
    // 1: frames may be in buffers of the program (`tb_session_submit_lent`).
    uint32_t lent;
    // Time for a frame, seconds: as many iterations as fit, and always a whole picture; 0: no limit. It needs `follow`.
    double budget;
    // How many neighbouring bins are one for the solver; 0: as many as the maps' pixels do not tell apart.
    size_t sum;
    // What becomes of frames that are submitted while one is solved: a `tb_feed`.
    uint32_t feed;
    // Not used: 0.
    uint32_t reserved;
    // Most frames that wait with TB_EVERY; 0: 16.
    size_t waiting;
    // What a sum is multiplied by before the next frame, from 0 to 1, with TB_SUM.
    double decay;
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

// A function of any kind: PFN_vkVoidFunction.
typedef void (*tb_function)(void);

// Handles of a program's own Vulkan. Zero everything, then set `size`.
typedef struct tb_vulkan {
    // sizeof(tb_vulkan).
    size_t size;
    // vkGetInstanceProcAddr of the loader that made the instance.
    tb_function get_instance_proc_addr;
    // VkInstance, and VkApplicationInfo::apiVersion that it was made with: at least 1.2.
    void *instance;
    uint32_t api_version;
    // Family of `queue`. Not used by `tb_vulkan_requirements`, as all that follows.
    uint32_t queue_family;
    // VkPhysicalDevice. `tb_vulkan_requirements` uses it, too.
    void *physical_device;
    // VkDevice, and a VkQueue of it that computes.
    void *device;
    void *queue;
    // TB_FEATURE_ bits of what was enabled.
    uint32_t enabled;
    // Not used: 0.
    uint32_t reserved;
    // Called around submissions to the queue, by any thread; both NULL if nobody else uses the queue.
    void (*lock)(void *user);
    void (*unlock)(void *user);
    // Given to both.
    void *user;
    // VkPipelineCache for the library's kernels; 0: one of its own.
    uint64_t pipeline_cache;
} tb_vulkan;

// What a device is to be made with. Set `size` before the call.
typedef struct tb_requirements {
    // sizeof(tb_requirements).
    size_t size;
    // Least VkApplicationInfo::apiVersion.
    uint32_t api_version;
    // A family whose queues compute; any other that computes will do.
    uint32_t queue_family;
    // TB_FEATURE_ bits of what the device offers of that which the library uses: enable all, or less.
    uint32_t features;
    // The extensions of the device for them; they live as long as the program.
    uint32_t extension_count;
    const char *extensions[TB_EXTENSIONS];
} tb_requirements;

// A part of a program's VkBuffer: whole words of 4 bytes.
typedef struct tb_part {
    // VkBuffer; 0: none.
    uint64_t buffer;
    // First byte, and how many.
    uint64_t offset;
    uint64_t bytes;
} tb_part;

// A value of a program's timeline semaphore.
typedef struct tb_moment {
    // VkSemaphore; 0: none.
    uint64_t semaphore;
    // Its value.
    uint64_t value;
} tb_moment;

// A frame whose counts lie in a program's buffer, and whose maps go into one. Zero everything, then set `size`.
typedef struct tb_lent_frame {
    // sizeof(tb_lent_frame).
    size_t size;
    // The counts, those of bin b of pair p as number p * bins + b. The buffer has VK_BUFFER_USAGE_TRANSFER_SRC_BIT.
    struct tb_part counts;
    // Imported memory in place of `counts`; NULL: none.
    const struct tb_buffer *imported;
    // What they are: a tb_format.
    uint32_t format;
    // Not used: 0.
    uint32_t reserved;
    // The counts are there from then on; without a semaphore: now.
    struct tb_moment after;
    // Brought about when the counts were copied.
    struct tb_moment taken;
    // Where the maps go, as floats one after the other for n pixels: albedo, depth, normals (x, y, z of each), mask (1 or 0),
    // confidence; `tb_session_maps_bytes` bytes. The buffer has VK_BUFFER_USAGE_TRANSFER_DST_BIT.
    struct tb_part maps;
    // Brought about when the maps are there.
    struct tb_moment done;
} tb_lent_frame;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Version of the library, "0.1.0". Any thread.
const char *tb_version(void);

// Opens a device into `device`. `api_version` is `TB_API_VERSION`: a library of another version refuses it. `name` is a
// part of the device's name, its index or its UUID, or NULL for the best one. Any thread.
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

// As `tb_session_submit`, for a scan that goes on: only pairs whose byte in `measured`, `pairs` of them, is not 0 have new
// counts. The others keep those of the frames before; their places in `counts` are not read as counts, but must be finite. Pairs
// that were never measured are dark.
//
// # Safety
// `session` lives. `counts` holds `count` numbers, and `measured` `pairs` bytes. `frame` is NULL or may be written.
enum tb_status tb_session_submit_part(const struct tb_session *session,
                                      const float *counts,
                                      size_t count,
                                      const uint8_t *measured,
                                      size_t pairs,
                                      uint64_t *frame);

// How long the last frames took, into `latency`. Any thread, also while another one waits.
//
// # Safety
// `session` lives. `latency` begins with its size, and may be written.
enum tb_status tb_session_latency(const struct tb_session *session, struct tb_latency *latency);

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
// frame is being solved, unless `feed` of tb_settings lets it wait: nothing changes then. Any thread, also while another
// one waits.
//
// # Safety
// `session` lives. `counts` holds `count` numbers. `frame` is NULL or may be written.
enum tb_status tb_session_submit(const struct tb_session *session,
                                 const float *counts,
                                 size_t count,
                                 uint64_t *frame);

// Waits up to `seconds` for the next result, that of the frame that was submitted last unless every frame counts: 0 only looks, below 0 waits as long as it takes. TB_OK with
// the frame; TB_NOT_YET if it is not solved by then, or there is none; else why it failed or that it was stopped
// (TB_CANCELLED). The next one can be submitted then. Above 0 it also waits for a frame that another thread submits meanwhile. Below 0 without a frame is TB_OPTIONS. Any thread; calls for one
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

// Says what a device of the program's own is to be made with: `vulkan` needs no more than an instance and a physical device.
// Any thread.
//
// # Safety
// `vulkan` and `out` begin with their sizes. The handles are valid and belong together.
enum tb_status tb_vulkan_requirements(const struct tb_vulkan *vulkan,
                                      struct tb_requirements *out);

// Makes a device of a program's own handles into `device`: see `tb_device_open`. Nothing of them is destroyed by
// `tb_device_close`. Any thread.
//
// # Safety
// `vulkan` begins with its size. The handles are valid, belong together, and live until the device and all sessions of it are
// gone; `enabled` says no more than was enabled; `lock` and `unlock` may be called by any thread meanwhile. `device` points to a
// pointer.
enum tb_status tb_device_of_vulkan(uint32_t api_version,
                                   const struct tb_vulkan *vulkan,
                                   struct tb_device **device);

// Begins to solve a frame in buffers of the program's, and returns: see `tb_session_submit`. The session was made with `lent`
// in its settings. A frame that fails or is stopped brings its moments about, too. Any thread; calls for one session wait for each
// other.
//
// # Safety
// `session` lives. `lent` begins with its size. Buffers and semaphores are of the session's device and live until the frame is
// over; nobody writes the counts from `after` to `taken`, or uses the maps' buffer before `done`. `frame` is NULL or may be written.
enum tb_status tb_session_submit_lent(const struct tb_session *session,
                                      const struct tb_lent_frame *lent,
                                      uint64_t *frame);

// Bytes of a frame's maps in a program's buffer; 0 without a session. Any thread.
//
// # Safety
// `session` lives, or is NULL.
uint64_t tb_session_maps_bytes(const struct tb_session *session);

// Imports memory of another program or interface (CUDA, another device of the same GPU) into `buffer`: the first `bytes` bytes
// of the memory behind the opaque file descriptor `fd`, which has `memory_bytes` in all. The descriptor belongs to the library
// afterwards, if this succeeds. The memory's type is taken to be the lowest that fits: where the exporter had a choice, use
// `tb_buffer_import_fd_of_type`. Any thread.
//
// # Safety
// `device` is open. `fd` is one of memory of this GPU, of so many bytes. `buffer` points to a pointer.
enum tb_status tb_buffer_import_fd(const struct tb_device *device,
                                   int32_t fd,
                                   uint64_t memory_bytes,
                                   uint64_t bytes,
                                   struct tb_buffer **buffer);

// As `tb_buffer_import_fd`, for memory that was allocated with this VkMemoryAllocateInfo::memoryTypeIndex, which Vulkan asks to
// be the same. Any thread.
//
// # Safety
// As `tb_buffer_import_fd`.
enum tb_status tb_buffer_import_fd_of_type(const struct tb_device *device,
                                           int32_t fd,
                                           uint64_t memory_bytes,
                                           uint32_t memory_type,
                                           uint64_t bytes,
                                           struct tb_buffer **buffer);

// Gives imported memory back; NULL does nothing. Frames that use it keep it. Any thread, once.
//
// # Safety
// `buffer` lives, and nobody uses the handle meanwhile or afterwards.
void tb_buffer_free(struct tb_buffer *buffer);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* THIRDBOUNCE_H */
