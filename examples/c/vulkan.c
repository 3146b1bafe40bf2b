/* A program with a Vulkan device of its own, whose camera's driver leaves counts in a buffer of that device. thirdbounce reads them
 * there and leaves the maps in another buffer, where the program's next pass would draw them; this one writes a picture.
 *
 *     cc vulkan.c $(pkg-config --cflags --libs thirdbounce vulkan) -lpthread -lm -o vulkan && ./vulkan last.pgm
 */
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <thirdbounce.h>
#include <vulkan/vulkan.h>

enum { SIDE = 16, PAIRS = SIDE * SIDE, BINS = 224, PIXELS = 32, FRAMES = 2 };
static const double BIN_WIDTH = 0.0125; /* metres of path */

struct buffer {
    VkBuffer handle;
    VkDeviceMemory memory;
    VkDeviceSize bytes;
    void *at; /* mapped */
};

static void must(tb_status status, const char *doing) {
    if (status == TB_OK) return;
    fprintf(stderr, "%s: %s\n  %s\n", doing, tb_last_error(), tb_last_hint());
    exit(1);
}

static void vk(VkResult result, const char *doing) {
    if (result == VK_SUCCESS) return;
    fprintf(stderr, "%s: VkResult %d\n", doing, (int)result);
    exit(1);
}

/* The library submits from a thread of its own. */
static void lock(void *user) { pthread_mutex_lock(user); }
static void unlock(void *user) { pthread_mutex_unlock(user); }

/* The first physical device, with what the library asks for. */
static void open_device(tb_vulkan *vulkan) {
    const VkApplicationInfo application = {.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO, .apiVersion = VK_API_VERSION_1_2};
    const VkInstanceCreateInfo info = {.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO, .pApplicationInfo = &application};
    VkInstance instance;
    vk(vkCreateInstance(&info, NULL, &instance), "an instance");
    uint32_t count = 1;
    VkPhysicalDevice physical = VK_NULL_HANDLE;
    const VkResult listed = vkEnumeratePhysicalDevices(instance, &count, &physical);
    vk(listed == VK_INCOMPLETE ? VK_SUCCESS : listed, "devices");

    vulkan->get_instance_proc_addr = (tb_void_function)vkGetInstanceProcAddr;
    vulkan->instance = instance, vulkan->api_version = VK_API_VERSION_1_2, vulkan->physical_device = physical;
    tb_requirements wanted = {.size = sizeof wanted};
    must(tb_vulkan_requirements(vulkan, &wanted), "asking what to enable");

    VkPhysicalDeviceShaderAtomicFloatFeaturesEXT atomics = {
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_ATOMIC_FLOAT_FEATURES_EXT, .shaderBufferFloat32AtomicAdd = VK_TRUE};
    const VkBool32 int64 = (wanted.features & TB_FEATURE_INT64_ATOMICS) != 0;
    VkPhysicalDeviceVulkan12Features v12 = {.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES,
                                            .pNext = wanted.features & TB_FEATURE_FLOAT_ATOMICS ? &atomics : NULL,
                                            .timelineSemaphore = VK_TRUE,
                                            .shaderBufferInt64Atomics = int64};
    const VkPhysicalDeviceFeatures features = {.shaderInt64 = int64};
    const float priority = 1.0f;
    const VkDeviceQueueCreateInfo queue = {.sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO,
                                           .queueFamilyIndex = wanted.queue_family,
                                           .queueCount = 1,
                                           .pQueuePriorities = &priority};
    const VkDeviceCreateInfo create = {.sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO,
                                       .pNext = &v12,
                                       .queueCreateInfoCount = 1,
                                       .pQueueCreateInfos = &queue,
                                       .enabledExtensionCount = wanted.extension_count,
                                       .ppEnabledExtensionNames = wanted.extensions,
                                       .pEnabledFeatures = &features};
    VkDevice device;
    VkQueue made;
    vk(vkCreateDevice(physical, &create, NULL, &device), "a device");
    vkGetDeviceQueue(device, wanted.queue_family, 0, &made);
    vulkan->device = device, vulkan->queue = made, vulkan->queue_family = wanted.queue_family;
    vulkan->enabled_features = wanted.features;
}

static struct buffer new_buffer(const tb_vulkan *vulkan, VkDeviceSize bytes, VkBufferUsageFlags usage) {
    struct buffer made = {.bytes = bytes};
    const VkBufferCreateInfo info = {.sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO, .size = bytes, .usage = usage};
    vk(vkCreateBuffer(vulkan->device, &info, NULL, &made.handle), "a buffer");
    VkMemoryRequirements needs;
    vkGetBufferMemoryRequirements(vulkan->device, made.handle, &needs);
    VkPhysicalDeviceMemoryProperties types;
    vkGetPhysicalDeviceMemoryProperties(vulkan->physical_device, &types);
    const VkMemoryPropertyFlags wanted = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    uint32_t type = 0;
    while (!(needs.memoryTypeBits >> type & 1) || (types.memoryTypes[type].propertyFlags & wanted) != wanted) type++;
    const VkMemoryAllocateInfo allocate = {
        .sType = VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO, .allocationSize = needs.size, .memoryTypeIndex = type};
    vk(vkAllocateMemory(vulkan->device, &allocate, NULL, &made.memory), "memory");
    vk(vkBindBufferMemory(vulkan->device, made.handle, made.memory, 0), "binding");
    vk(vkMapMemory(vulkan->device, made.memory, 0, VK_WHOLE_SIZE, 0, &made.at), "mapping");
    return made;
}

static void free_buffer(const tb_vulkan *vulkan, struct buffer *buffer) {
    vkDestroyBuffer(vulkan->device, buffer->handle, NULL);
    vkFreeMemory(vulkan->device, buffer->memory, NULL);
}

/* What the wall sees of a plate that moves to the right, as the camera's driver counts it. */
static void expose(uint16_t *counts, double (*wall)[3], int frame) {
    for (int i = 0; i < PAIRS * BINS; i++) counts[i] = (uint16_t)(i * 7919 % 11 / 9);
    for (int pair = 0; pair < PAIRS; pair++) {
        for (int part = 0; part < 64; part++) {
            const double dx = wall[pair][0] - 0.1 * frame + 0.2 - 0.04 * (part / 8), dy = wall[pair][1] + 0.1 - 0.04 * (part % 8);
            const double distance = sqrt(dx * dx + dy * dy + 0.36);
            counts[pair * BINS + (int)(2.0 * distance / BIN_WIDTH)] += (uint16_t)floor(8.0 / pow(distance, 4.0));
        }
    }
}

/* The mask of the maps, top row first, +x on the left as seen from the wall. */
static void write_picture(const char *path, const float *maps) {
    FILE *file = fopen(path, "wb");
    if (file == NULL) return;
    fprintf(file, "P5 %d %d 255\n", PIXELS, PIXELS);
    for (int row = PIXELS; row-- > 0;)
        for (int ix = PIXELS; ix-- > 0;) fputc(maps[5 * PIXELS * PIXELS + ix * PIXELS + row] == 1.0f ? 255 : 0, file);
    fclose(file);
}

int main(int count, char **arguments) {
    static double wall[PAIRS][3];
    for (int pair = 0; pair < PAIRS; pair++) {
        wall[pair][0] = (pair / SIDE + 0.5) / SIDE - 0.5;
        wall[pair][1] = (pair % SIDE + 0.5) / SIDE - 0.5;
    }
    static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
    tb_vulkan vulkan = {.size = sizeof vulkan, .lock = lock, .unlock = unlock, .user_data = &mutex};
    open_device(&vulkan);
    tb_device *device = NULL;
    tb_session *session = NULL;
    must(tb_device_from_vulkan(TB_API_VERSION, &vulkan, &device), "taking the device");
    printf("on %s\n", tb_device_name(device));
    tb_scan scan = {.size = sizeof scan, .points_x = SIDE, .points_y = SIDE, .laser_xyz = &wall[0][0]};
    scan.bins = BINS, scan.bin_width = BIN_WIDTH, scan.photon_counts = 1;
    tb_settings settings = {.size = sizeof settings, .lateral = PIXELS, .options = "iterations=20", .external_frames = 1};
    must(tb_session_new(device, &scan, &settings, &session), "making a session");

    struct buffer counts = new_buffer(&vulkan, 2 * PAIRS * BINS, VK_BUFFER_USAGE_TRANSFER_SRC_BIT);
    struct buffer maps = new_buffer(&vulkan, tb_session_maps_bytes(session), VK_BUFFER_USAGE_TRANSFER_DST_BIT);
    const VkSemaphoreTypeCreateInfo timeline = {.sType = VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO,
                                                .semaphoreType = VK_SEMAPHORE_TYPE_TIMELINE};
    const VkSemaphoreCreateInfo info = {.sType = VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO, .pNext = &timeline};
    VkSemaphore taken, done;
    vk(vkCreateSemaphore(vulkan.device, &info, NULL, &taken), "a semaphore");
    vk(vkCreateSemaphore(vulkan.device, &info, NULL, &done), "a semaphore");

    tb_frame frame = {.size = sizeof frame};
    for (uint64_t i = 1; i <= FRAMES; i++) {
        /* The camera may write again as soon as the counts were copied; they are there when the frame is submitted. */
        const uint64_t before = i - 1;
        const VkSemaphoreWaitInfo free_again = {.sType = VK_STRUCTURE_TYPE_SEMAPHORE_WAIT_INFO,
                                                .semaphoreCount = 1, .pSemaphores = &taken, .pValues = &before};
        vk(vkWaitSemaphores(vulkan.device, &free_again, UINT64_MAX), "waiting");
        expose(counts.at, wall, (int)i);
        const tb_external_frame lent = {.size = sizeof lent,
                                    .counts = {(uint64_t)counts.handle, 0, counts.bytes},
                                    .format = TB_FORMAT_U16,
                                    .counts_copied = {(uint64_t)taken, i},
                                    .maps = {(uint64_t)maps.handle, 0, maps.bytes},
                                    .maps_ready = {(uint64_t)done, i}};
        must(tb_session_submit_external(session, &lent, NULL), "submitting");
        must(tb_session_wait(session, -1.0, &frame), "solving");
        /* The device says so itself, perhaps a moment after the session. */
        const VkSemaphoreWaitInfo all_there = {.sType = VK_STRUCTURE_TYPE_SEMAPHORE_WAIT_INFO,
                                               .semaphoreCount = 1, .pSemaphores = &done, .pValues = &i};
        vk(vkWaitSemaphores(vulkan.device, &all_there, 10000000000), "waiting for the maps");
        const float *planes = maps.at;
        int lit = 0;
        for (int pixel = 0; pixel < PIXELS * PIXELS; pixel++) lit += planes[5 * PIXELS * PIXELS + pixel] == 1.0f;
        printf("frame %d: %d pixels of surface in the buffer, maps done\n", (int)frame.id, lit);
    }
    if (count > 1) write_picture(arguments[1], maps.at);
    tb_session_free(session);
    tb_device_close(device);
    vkDestroySemaphore(vulkan.device, taken, NULL);
    vkDestroySemaphore(vulkan.device, done, NULL);
    free_buffer(&vulkan, &counts);
    free_buffer(&vulkan, &maps);
    vkDestroyDevice(vulkan.device, NULL);
    vkDestroyInstance(vulkan.instance, NULL);
    return 0;
}
