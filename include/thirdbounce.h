/* thirdbounce: non-line-of-sight reconstruction. Written by `make header` from capi/src; docs/rust-c-vulkan.md explains it. */

#ifndef THIRDBOUNCE_H
#define THIRDBOUNCE_H

#include <stddef.h>
#include <stdint.h>

// Version of this interface. Structs may grow at their end within a version: they begin with their size.
#define TB_API_VERSION 1

// Maximum number of settings in `tb_error_info`.
#define TB_ERROR_INFO_SETTINGS 4

// Maximum number of extensions in `tb_requirements`.
#define TB_EXTENSIONS 8

// VkPhysicalDeviceVulkan12Features::timelineSemaphore. Required.
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

// VK_EXT_debug_utils of the instance.
#define TB_FEATURE_DEBUG_UTILS 64

// Status code.
typedef enum tb_status {
    // Success.
    TB_OK = 0,
    // Invalid scan or counts.
    TB_ERROR_INPUT = 1,
    // Invalid argument or setting, or a call not allowed in the session's state.
    TB_ERROR_OPTIONS = 2,
    // No such device, a missing feature, or a lost device.
    TB_ERROR_DEVICE = 3,
    // Out of host or device memory.
    TB_ERROR_MEMORY = 4,
    // A result could not be written.
    TB_ERROR_OUTPUT = 5,
    // The frame was cancelled.
    TB_ERROR_CANCELLED = 6,
    // A defect of the library.
    TB_ERROR_DEFECT = 7,
    // No result yet.
    TB_NOT_READY = 8,
} tb_status;

// Level of a log message.
typedef enum tb_level {
    // Information on the library's actions.
    TB_LEVEL_NOTE = 0,
    // Reason of a failed call.
    TB_LEVEL_ERROR = 1,
    // Warning about a result.
    TB_LEVEL_WARNING = 2,
} tb_level;

// Type of counts in a buffer.
typedef enum tb_format {
    // 32-bit floats.
    TB_FORMAT_F32 = 0,
    // 32-bit unsigned integers.
    TB_FORMAT_U32 = 1,
    // 16-bit unsigned integers, two per word.
    TB_FORMAT_U16 = 2,
} tb_format;

// Handling of frames submitted during a solve.
typedef enum tb_frame_policy {
    // Refused with TB_ERROR_OPTIONS.
    TB_FRAMES_REFUSE = 0,
    // Waits, replacing a waiting frame.
    TB_FRAMES_NEWEST = 1,
    // Queued, up to `queue_length` of tb_settings. Each is solved after the previous result was taken.
    TB_FRAMES_QUEUE = 2,
    // Added to a running sum, multiplied by `sum_decay` of tb_settings before, and solved as soon as possible.
    TB_FRAMES_SUM = 3,
} tb_frame_policy;

// A buffer over imported external memory.
typedef struct tb_buffer tb_buffer;

// A capture that was read from a file.
typedef struct tb_capture tb_capture;

// An opened device (of Vulkan, or the host), usable from any thread and by any number of sessions.
typedef struct tb_device tb_device;

// A solver prepared for the frames of one scan.
typedef struct tb_session tb_session;

// A device of this machine: of Vulkan, or the host. Texts end with a zero byte; longer ones are cut.
typedef struct tb_device_info {
    // sizeof(tb_device_info): set it before the call.
    size_t size;
    // Bytes of the largest device-local heap; of the host, bytes that are available.
    uint64_t memory_bytes;
    // Name, a part of which `tb_device_open` accepts.
    char name[256];
    // Name and version of the driver.
    char driver[256];
    // "discrete GPU", "integrated GPU", "virtual GPU", "host", "CPU" or "other".
    char kind[16];
    // UUID as 32 hexadecimal digits, which `tb_device_open` accepts, identical in CUDA.
    char uuid[40];
} tb_device_info;

// Machine-readable details of an error. Set `size` before the call.
typedef struct tb_error_info {
    // sizeof(tb_error_info).
    size_t size;
    // Status of the call; TB_OK if none failed.
    enum tb_status status;
    // Number of `settings`.
    uint32_t setting_count;
    // Names of settings that may fix the error ("lateral", "memory"), with static lifetime.
    const char *settings[TB_ERROR_INFO_SETTINGS];
    // Bytes requested and bytes available; 0 if unknown or not a memory error.
    uint64_t requested_bytes;
    uint64_t available_bytes;
} tb_error_info;

// Latency of the last frames (at most 256) from submission to result, seconds, including queueing.
typedef struct tb_latency {
    // sizeof(tb_latency): set it before the call.
    size_t size;
    // Solved frames.
    uint64_t frames;
    // Frames replaced by newer ones before they were solved.
    uint64_t dropped;
    // Last frame, median, 90th and 99th percentile.
    double last;
    double median;
    double p90;
    double p99;
    // Results per second while frames arrive; 0 before the second result.
    double frames_per_second;
} tb_latency;

// Receives log messages. `text` is valid during the call.
typedef void (*tb_log_callback)(void *user_data, enum tb_level level, const char *text);

// Laser-sensor pairs and histogram layout. Zero-initialise, then set `size`; zero is the default of every optional
// field.
typedef struct tb_scan {
    // sizeof(tb_scan).
    size_t size;
    // Points along x and y; 1 for a list of pairs. Pair ix * points_y + iy is at ix along +x and iy along +y.
    size_t points_x;
    size_t points_y;
    // Laser points in metres, x, y, z per pair. Copied.
    const double *laser_xyz;
    // Sensor points in metres, x, y, z per pair; NULL: the laser points (confocal). Copied.
    const double *sensor_xyz;
    // Bins per histogram.
    size_t bins;
    // Bin width, metres of path (seconds times 299792458).
    double bin_width;
    // Leading edge of bin 0, metres of path.
    double t_start;
    // 1 if counts are photon counts (integers with a variance equal to their mean).
    uint32_t photon_counts;
    // Reserved: 0.
    uint32_t reserved;
    // Full width at half maximum of the impulse response, metres of path; 0 if unknown.
    double pulse_fwhm;
    // Full width at half maximum of the laser and sensor spots on the wall, metres; 0 for points.
    double laser_spot_fwhm;
    double sensor_spot_fwhm;
    // Counts of one frame, bin b of pair p at [p * bins + b], copied: the volume then ends at their deepest signal,
    // and unspecified reflectance model and impulse response are estimated. NULL: the volume ends with the bins, and
    // the model is cosine unless set in `options` of tb_settings.
    const float *counts;
    // A capture of `tb_read` in place of all fields above; NULL: none. `tb_capture_scan` sets it.
    const struct tb_capture *capture;
    // Counts of the same scan without the object, as `counts`, copied: their light is subtracted from every frame, with a gain of its own,
    // where held-out pairs of `counts` prove it. NULL: none. Needs `counts`.
    const float *empty;
} tb_scan;

// Progress of a frame.
typedef struct tb_progress {
    // sizeof(tb_progress) of the library.
    size_t size;
    // Frame number; 0 during the estimates of `tb_session_new`.
    uint64_t frame;
    // Iterations done, and total iterations of the frame.
    size_t iteration;
    size_t iterations;
    // Loss; NaN during a closed form.
    double loss;
    // Seconds since the start of the frame.
    double seconds;
    // Share of the total iterations of the frame, or of the estimates: 0 to 1, never falling. A fit that converges ends before 1.
    double fraction;
} tb_progress;

// Receives progress reports. Returns 0 to continue; any other value cancels the frame.
typedef int32_t (*tb_progress_callback)(void *user_data, const struct tb_progress *progress);

// Settings of a session. Zero-initialise, then set `size`; zero is the default of every field.
typedef struct tb_settings {
    // sizeof(tb_settings).
    size_t size;
    // "surface", "paper", or a closed-form method such as "lct" or "fbp"; NULL: the default solver.
    const char *solver;
    // Lateral pixels of the maps; 0: the solver's default.
    size_t lateral;
    // Further solver options as "name=value name=value", with names of the command line, including
    // "model=lambertian"; NULL: none.
    const char *options;
    // Maximum device memory, bytes; 0: all free memory.
    uint64_t memory_limit;
    // Time after which a frame is cancelled, seconds; 0: none.
    double time_limit;
    // Progress callback, called by the session's thread, and by `tb_session_new` during estimates. It may call
    // `tb_session_cancel` but no other function of this session.
    tb_progress_callback progress;
    // Passed to `progress`.
    void *user_data;
    // 1: frames start from the previous frame's surface, with fewer iterations. For "surface".
    uint32_t warm_start;
    // 1: frames may be in external buffers (`tb_session_submit_external`).
    uint32_t external_frames;
    // Time per frame, seconds: as many iterations as fit, always a complete result; 0: no limit. Requires
    // `warm_start`.
    double frame_budget;
    // Number of neighbouring bins summed for the solver; 0: chosen by the resolution of the maps.
    size_t sum_bins;
    // Handling of frames submitted during a solve: a `tb_frame_policy`.
    uint32_t frame_policy;
    // Reserved: 0.
    uint32_t reserved;
    // Maximum number of queued frames with TB_FRAMES_QUEUE; 0: 16.
    size_t queue_length;
    // Factor of the sum before the next frame is added, 0 to 1, with TB_FRAMES_SUM.
    double sum_decay;
    // Number of solved frames, 5 to 1000 (31 is usual), whose static light is subtracted as an empty room, so that moving objects are
    // left; 0: nothing is subtracted. The first five frames are solved as measured, with a warning.
    size_t moving_frames;
} tb_settings;

// A solved frame. All arrays belong to the session and remain valid until the next `tb_session_wait` that returns a
// frame, and until the session is freed. Pixel [ix * ny + iy] is at ix along +x and iy along +y.
typedef struct tb_frame {
    // sizeof(tb_frame): set it before the call.
    size_t size;
    // Frame number.
    uint64_t id;
    // Pixels along x and y.
    size_t nx;
    size_t ny;
    // Outer edges of the pixels, metres: x min, x max, y min, y max.
    double extent[4];
    // Albedo, in units of the scaled counts.
    const float *albedo;
    // Depth, metres; NaN without surface.
    const float *depth;
    // Unit normals toward the wall, x, y, z per pixel; NaN without surface.
    const float *normal;
    // 1 where there is surface.
    const uint8_t *mask;
    // Number of iterations.
    size_t iterations;
    // Solve time, seconds.
    double seconds;
    // Expected depth error, metres: two of three pixels with a given value have a smaller error; NaN without
    // surface. NULL if unknown.
    const float *depth_error;
    // The second layer behind the first, as above; NULL if no pixel has two surfaces.
    const float *behind_albedo;
    const float *behind_depth;
    const float *behind_normal;
    const uint8_t *behind_mask;
    const float *behind_depth_error;
    // The reconstructed volume: corners x, y, z in metres, and voxels of the finest grid along each axis.
    double volume_min[3];
    double volume_max[3];
    size_t voxels[3];
    // 1 if started from the previous frame's solution.
    uint32_t warm_started;
    // The verdict on the result: 1 good, 2 fair, 3 poor. The reasons of a poor one are warnings of the log.
    uint32_t verdict;
} tb_frame;

// Generic function pointer: PFN_vkVoidFunction.
typedef void (*tb_void_function)(void);

// Handles of an application's Vulkan. Zero-initialise, then set `size`.
typedef struct tb_vulkan {
    // sizeof(tb_vulkan).
    size_t size;
    // vkGetInstanceProcAddr of the loader that created the instance.
    tb_void_function get_instance_proc_addr;
    // VkInstance, and its VkApplicationInfo::apiVersion: at least 1.2.
    void *instance;
    uint32_t api_version;
    // Family of `queue`. This and the following fields are not used by `tb_vulkan_requirements`, except as noted.
    uint32_t queue_family;
    // VkPhysicalDevice. Used by `tb_vulkan_requirements` as well.
    void *physical_device;
    // VkDevice, and a compute-capable VkQueue of it.
    void *device;
    void *queue;
    // TB_FEATURE_ bits of the enabled features.
    uint32_t enabled_features;
    // Reserved: 0.
    uint32_t reserved;
    // Called around submissions to the queue, by any thread; both NULL if the queue is not used otherwise.
    void (*lock)(void *user_data);
    void (*unlock)(void *user_data);
    // Passed to both.
    void *user_data;
    // VkPipelineCache for the library's kernels; 0: a cache of the library.
    uint64_t pipeline_cache;
} tb_vulkan;

// Requirements for creating a device. Set `size` before the call.
typedef struct tb_requirements {
    // sizeof(tb_requirements).
    size_t size;
    // Minimum VkApplicationInfo::apiVersion.
    uint32_t api_version;
    // A compute queue family; any other compute family is suitable.
    uint32_t queue_family;
    // TB_FEATURE_ bits that the device offers and the library uses; any subset may be enabled.
    uint32_t features;
    // Device extensions for these features, with static lifetime.
    uint32_t extension_count;
    const char *extensions[TB_EXTENSIONS];
} tb_requirements;

// A range of a VkBuffer, in whole words of 4 bytes.
typedef struct tb_buffer_range {
    // VkBuffer; 0: none.
    uint64_t buffer;
    // Offset and size in bytes.
    uint64_t offset;
    uint64_t bytes;
} tb_buffer_range;

// A value of a timeline semaphore.
typedef struct tb_timeline_point {
    // VkSemaphore; 0: none.
    uint64_t semaphore;
    // Semaphore value.
    uint64_t value;
} tb_timeline_point;

// A frame with counts, and optionally maps, in external buffers. Zero-initialise, then set `size`.
typedef struct tb_external_frame {
    // sizeof(tb_external_frame).
    size_t size;
    // Counts, bin b of pair p at element p * bins + b. The buffer has VK_BUFFER_USAGE_TRANSFER_SRC_BIT.
    struct tb_buffer_range counts;
    // Imported memory instead of `counts`; NULL: none.
    const struct tb_buffer *imported;
    // Type of the counts: a tb_format.
    uint32_t format;
    // Reserved: 0.
    uint32_t reserved;
    // Point at which the counts are available; without a semaphore: immediately.
    struct tb_timeline_point counts_ready;
    // Signalled once the counts are copied.
    struct tb_timeline_point counts_copied;
    // Destination of the maps, as float planes of n pixels: albedo, depth, normals (x, y, z of each), mask (1 or 0),
    // expected depth error; `tb_session_maps_bytes` bytes. The buffer has VK_BUFFER_USAGE_TRANSFER_DST_BIT.
    struct tb_buffer_range maps;
    // Signalled once the maps are available.
    struct tb_timeline_point maps_ready;
} tb_external_frame;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Version of the library, "0.1.0". Any thread.
const char *tb_version(void);

// Opens a device. `api_version` is `TB_API_VERSION`; a library of another version refuses it. `name` is a part of
// the device's name, its index or its UUID, or NULL for the best device. Any thread.
//
// # Safety
// `name` is NULL or a zero-terminated string; `device` is writable.
enum tb_status tb_device_open(uint32_t api_version,
                              const char *name,
                              struct tb_device **device);

// Name of the device, with the lifetime of `device`. Any thread.
//
// # Safety
// `device` is open.
const char *tb_device_name(const struct tb_device *device);

// Closes a device handle; NULL is ignored. Sessions keep the device alive. Any thread, once.
//
// # Safety
// `device` is open and not used concurrently or afterwards.
void tb_device_close(struct tb_device *device);

// Writes the number of devices to `count`. Any thread.
//
// # Safety
// `count` is writable.
enum tb_status tb_device_count(uint32_t *count);

// Writes the device of this index, from 0, to `info`. The index as text opens it. Any thread.
//
// # Safety
// `info` begins with its size and is writable.
enum tb_status tb_device_info_at(uint32_t index, struct tb_device_info *info);

// Message of this thread's last failed call; empty without one. Valid until this thread's next failed call.
const char *tb_last_error(void);

// Hint for fixing that error. Lifetime as for `tb_last_error`.
const char *tb_last_hint(void);

// Writes the details of that error to `info`. Returns TB_ERROR_OPTIONS if `info` is NULL or too small; the last
// error is unchanged.
//
// # Safety
// `info` begins with its size and is writable.
enum tb_status tb_last_error_info(struct tb_error_info *info);

// Reads a capture of any format and prepares it as `thirdbounce reconstruct` does. `options` are those of the capture as
// "name=value name=value", with names of the command line ("wall=2m stride=2"); NULL: none. Any thread.
//
// # Safety
// `path` and `options` are NULL or zero-terminated strings; `capture` is writable.
enum tb_status tb_read(const char *path,
                       const char *options,
                       struct tb_capture **capture);

// Saves the maps of the last frame that `tb_session_wait` returned into `folder`, which is created: maps.npz, maps.mat,
// maps.exr, pictures, points and mesh. Any thread; calls on one session are serialised.
//
// # Safety
// `session` is valid. `folder` is a zero-terminated string.
enum tb_status tb_save(const struct tb_session *session,
                       const char *folder);

// As `tb_session_submit`, for a partial scan: only pairs whose byte in `measured` (`pairs` bytes) is nonzero have
// new counts. Other pairs keep their previous counts; their values in `counts` are ignored but must be finite. Pairs
// never measured are dark.
//
// # Safety
// `session` is valid. `counts` has `count` values and `measured` `pairs` bytes. `frame` is NULL or writable.
enum tb_status tb_session_submit_partial(const struct tb_session *session,
                                         const float *counts,
                                         size_t count,
                                         const uint8_t *measured,
                                         size_t pairs,
                                         uint64_t *frame);

// Writes the latency statistics to `latency`. Any thread, also during a wait of another one.
//
// # Safety
// `session` is valid. `latency` begins with its size and is writable.
enum tb_status tb_session_latency(const struct tb_session *session, struct tb_latency *latency);

// Sets the receiver of log messages; NULL disables logging. Any thread. `log` is called by any thread that calls the
// library, one at a time, and must not call the library.
//
// # Safety
// `log` remains callable with `user_data` until it is replaced.
void tb_set_log_callback(tb_log_callback log,
                         void *user_data);

// Writes the scan of a capture with its counts to `scan`, with the lifetime of `capture`. A session of it also has the
// capture's impulse response and wall normals.
//
// # Safety
// `capture` is valid. `scan` begins with its size and is writable.
enum tb_status tb_capture_scan(const struct tb_capture *capture,
                               struct tb_scan *scan);

// Frees a capture; NULL is ignored. Sessions do not need it after `tb_session_new`. Any thread, once.
//
// # Safety
// `capture` is valid and not used concurrently or afterwards.
void tb_capture_free(struct tb_capture *capture);

// Creates a session, including compilation and allocation. Any thread.
//
// # Safety
// `device` is open. `scan` and `settings` begin with their sizes; `settings` may be NULL. Strings are
// zero-terminated, arrays have the lengths in `tb_scan`, and `session` is writable. `progress` remains callable with
// `user_data` by another thread until the session is freed.
enum tb_status tb_session_new(const struct tb_device *device,
                              const struct tb_scan *scan,
                              const struct tb_settings *settings,
                              struct tb_session **session);

// Submits a frame without waiting. `counts` has `count` values, bin b of pair p at [p * bins + b], and is copied.
// `frame` receives the frame number, or is NULL. Returns TB_ERROR_INPUT for invalid counts, and TB_ERROR_OPTIONS
// during a solve unless `frame_policy` of tb_settings allows queueing, without side effects. Any thread, also during
// a wait of another one.
//
// # Safety
// `session` is valid. `counts` has `count` values. `frame` is NULL or writable.
enum tb_status tb_session_submit(const struct tb_session *session,
                                 const float *counts,
                                 size_t count,
                                 uint64_t *frame);

// Waits up to `seconds` for the next result: that of the frame submitted last, unless the policy is TB_FRAMES_QUEUE.
// 0 polls; a negative value waits without limit. Returns TB_OK with the frame, TB_NOT_READY without a result in time
// or without a frame, otherwise the frame's error or TB_ERROR_CANCELLED, after which the next frame can be
// submitted. A positive value also waits for a frame submitted concurrently; a negative value without a frame
// returns TB_ERROR_OPTIONS. Any thread; calls on one session are serialised.
//
// # Safety
// `session` is valid. `frame` begins with its size and is writable.
enum tb_status tb_session_wait(const struct tb_session *session,
                               double seconds,
                               struct tb_frame *frame);

// Cancels the current frame, if any; its `tb_session_wait` returns TB_ERROR_CANCELLED. Does not block. Any thread,
// also during a wait of another one, and from `progress`; not from a signal handler.
//
// # Safety
// `session` is valid.
enum tb_status tb_session_cancel(const struct tb_session *session);

// Cancels all work of the session and frees it with its last frame; NULL is ignored. Any thread, once; not from
// `progress`.
//
// # Safety
// `session` is valid and not used concurrently or afterwards.
void tb_session_free(struct tb_session *session);

// Writes the requirements for creating a device; only instance and physical device of `vulkan` are used. Any thread.
//
// # Safety
// `vulkan` and `out` begin with their sizes. The handles are valid and belong together.
enum tb_status tb_vulkan_requirements(const struct tb_vulkan *vulkan,
                                      struct tb_requirements *out);

// Creates a device from an application's handles: see `tb_device_open`. `tb_device_close` destroys none of them. Any
// thread.
//
// # Safety
// `vulkan` begins with its size. The handles are valid, belong together, and outlive the device and all its
// sessions; `enabled_features` has only enabled features; `lock` and `unlock` are callable by any thread meanwhile.
// `device` is writable.
enum tb_status tb_device_from_vulkan(uint32_t api_version,
                                     const struct tb_vulkan *vulkan,
                                     struct tb_device **device);

// Submits a frame in external buffers without waiting: see `tb_session_submit`. Requires `external_frames` in the
// session's settings. Failed and cancelled frames signal their timeline points as well. Any thread; calls on one
// session are serialised.
//
// # Safety
// `session` is valid. `external` begins with its size. Buffers and semaphores belong to the session's device and
// live until the frame is finished; the counts are not written between `counts_ready` and `counts_copied`, and the
// maps' buffer is not used before `maps_ready`. `frame` is NULL or writable.
enum tb_status tb_session_submit_external(const struct tb_session *session,
                                          const struct tb_external_frame *external,
                                          uint64_t *frame);

// Size of a frame's maps in an external buffer, bytes; 0 without a session. Any thread.
//
// # Safety
// `session` is valid or NULL.
uint64_t tb_session_maps_bytes(const struct tb_session *session);

// Imports external memory (of CUDA, or of another device on the same GPU): the first `bytes` bytes of the memory
// behind the opaque file descriptor `fd`, whose allocation has `memory_bytes` bytes. On success the library owns the
// descriptor. Assumes the lowest suitable memory type; otherwise use `tb_buffer_import_fd_of_type`. Any thread.
//
// # Safety
// `device` is open. `fd` refers to memory of this GPU of the given size. `buffer` is writable.
enum tb_status tb_buffer_import_fd(const struct tb_device *device,
                                   int32_t fd,
                                   uint64_t memory_bytes,
                                   uint64_t bytes,
                                   struct tb_buffer **buffer);

// As `tb_buffer_import_fd`, for memory allocated with this VkMemoryAllocateInfo::memoryTypeIndex, which Vulkan
// requires to match. Any thread.
//
// # Safety
// As `tb_buffer_import_fd`.
enum tb_status tb_buffer_import_fd_of_type(const struct tb_device *device,
                                           int32_t fd,
                                           uint64_t memory_bytes,
                                           uint32_t memory_type,
                                           uint64_t bytes,
                                           struct tb_buffer **buffer);

// Frees imported memory; NULL is ignored. Frames that use it keep it alive. Any thread, once.
//
// # Safety
// `buffer` is valid and not used concurrently or afterwards.
void tb_buffer_free(struct tb_buffer *buffer);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* THIRDBOUNCE_H */
