/* A program that captures: a thread stands for the camera and delivers frames, the main thread reconstructs the newest.
 *
 *     cc capture.c $(pkg-config --cflags --libs thirdbounce) -lpthread -lm -o capture && ./capture last.pgm
 */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <thirdbounce.h>
#include <time.h>

enum { SIDE = 16, PAIRS = SIDE * SIDE, BINS = 224, FRAMES = 4 };
static const double BIN_WIDTH = 0.0125; /* metres of path */

struct camera {
    pthread_mutex_t lock;
    pthread_cond_t changed;
    double wall[PAIRS][3];
    float newest[PAIRS * BINS];
    int delivered; /* frames so far */
    int taken;     /* of them, by the main thread */
};

/* What the wall sees of a plate that moves to the right. */
static void expose(struct camera *camera, float *counts, int frame) {
    for (int i = 0; i < PAIRS * BINS; i++) counts[i] = (float)(i * 7919 % 11 / 9);
    for (int pair = 0; pair < PAIRS; pair++) {
        for (int part = 0; part < 64; part++) {
            const double x = 0.04 * frame - 0.2 + 0.04 * (part / 8), y = 0.04 * (part % 8) - 0.1, z = 0.6;
            const double dx = camera->wall[pair][0] - x, dy = camera->wall[pair][1] - y;
            const double distance = sqrt(dx * dx + dy * dy + z * z);
            counts[pair * BINS + (int)(2.0 * distance / BIN_WIDTH)] += (float)floor(8.0 / pow(distance, 4.0));
        }
    }
}

static void *deliver(void *user) {
    struct camera *camera = user;
    float *counts = malloc(sizeof camera->newest);
    for (int frame = 0; frame < FRAMES && counts != NULL; frame++) {
        expose(camera, counts, frame);
        pthread_mutex_lock(&camera->lock);
        while (camera->taken < camera->delivered) pthread_cond_wait(&camera->changed, &camera->lock);
        memcpy(camera->newest, counts, sizeof camera->newest);
        camera->delivered++;
        pthread_cond_broadcast(&camera->changed);
        pthread_mutex_unlock(&camera->lock);
    }
    free(counts);
    return NULL;
}

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void must(tb_status status, const char *doing) {
    if (status == TB_OK) return;
    fprintf(stderr, "%s: %s\n  %s\n", doing, tb_last_error(), tb_last_hint());
    exit(1);
}

/* Called by the session's thread. */
static int32_t count_reports(void *user_data, const tb_progress *progress) {
    atomic_fetch_add((atomic_int *)user_data, 1);
    return progress->loss > 1e30; /* cancels a diverging fit; NaN for closed forms */
}

static void write_picture(const char *path, const tb_frame *frame) {
    FILE *file = fopen(path, "wb");
    if (file == NULL) return;
    float most = 1e-30f;
    for (size_t i = 0; i < frame->nx * frame->ny; i++) most = fmaxf(most, frame->albedo[i]);
    fprintf(file, "P5 %zu %zu 255\n", frame->nx, frame->ny);
    for (size_t row = frame->ny; row-- > 0;)
        for (size_t ix = frame->nx; ix-- > 0;) /* seen from the wall, +x is on the left */
            fputc((int)(255.0f * frame->albedo[ix * frame->ny + row] / most + 0.5f), file);
    fclose(file);
}

int main(int count, char **arguments) {
    struct camera *camera = calloc(1, sizeof *camera);
    if (camera == NULL) return 1;
    pthread_mutex_init(&camera->lock, NULL);
    pthread_cond_init(&camera->changed, NULL);
    for (int pair = 0; pair < PAIRS; pair++) {
        camera->wall[pair][0] = (pair / SIDE + 0.5) / SIDE - 0.5;
        camera->wall[pair][1] = (pair % SIDE + 0.5) / SIDE - 0.5;
    }
    tb_device *device = NULL;
    tb_session *session = NULL;
    must(tb_device_open(TB_API_VERSION, NULL, &device), "opening a device");
    printf("on %s\n", tb_device_name(device));

    atomic_int reports = 0;
    tb_scan scan = {.size = sizeof scan, .points_x = SIDE, .points_y = SIDE, .laser_xyz = &camera->wall[0][0]};
    scan.bins = BINS, scan.bin_width = BIN_WIDTH, scan.photon_counts = 1;
    /* A frame in which the session looks for the model of reflectance and the pulse. */
    expose(camera, camera->newest, 0);
    scan.counts = camera->newest;
    tb_settings settings = {.size = sizeof settings, .lateral = 32, .progress = count_reports, .user_data = &reports};
    settings.options = "iterations=20", settings.warm_start = 1;
    must(tb_session_new(device, &scan, &settings, &session), "making a session");

    pthread_t thread;
    if (pthread_create(&thread, NULL, deliver, camera) != 0) return 1;
    tb_frame frame = {.size = sizeof frame};
    for (int i = 0; i < FRAMES; i++) {
        pthread_mutex_lock(&camera->lock);
        while (camera->delivered == camera->taken) pthread_cond_wait(&camera->changed, &camera->lock);
        const double begun = now();
        must(tb_session_submit(session, camera->newest, PAIRS * BINS, NULL), "submitting");
        camera->taken = camera->delivered;
        pthread_cond_broadcast(&camera->changed);
        pthread_mutex_unlock(&camera->lock);
        must(tb_session_wait(session, -1.0, &frame), "solving");
        size_t lit = 0;
        for (size_t pixel = 0; pixel < frame.nx * frame.ny; pixel++) lit += frame.mask[pixel];
        printf("frame %d: %.0f ms, %zu pixels of surface, %s\n", (int)frame.id, 1e3 * (now() - begun), lit, frame.warm_started ? "warm" : "cold");
    }
    pthread_join(thread, NULL);
    printf("progress of %s\n", atomic_load(&reports) > FRAMES ? "every frame" : "too few frames");
    if (count > 1) write_picture(arguments[1], &frame);
    tb_session_free(session);
    tb_device_close(device);
    free(camera);
    return 0;
}
