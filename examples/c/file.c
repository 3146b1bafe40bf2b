/* A capture file to maps.npz and pictures in a folder.
 *
 *     cc file.c $(pkg-config --cflags --libs thirdbounce) -o file && ./file capture.npz result
 */
#include <stdio.h>
#include <stdlib.h>
#include <thirdbounce.h>

static void must(tb_status status) {
    if (status == TB_OK) return;
    fprintf(stderr, "%s\n  %s\n", tb_last_error(), tb_last_hint());
    exit(1);
}

static int32_t show(void *user_data, const tb_progress *progress) {
    (void)user_data;
    fprintf(stderr, "\r%s %3.0f %%", progress->frame == 0 ? "estimates" : "solve", 100.0 * progress->fraction);
    return 0;
}

int main(int count, char **arguments) {
    if (count != 3) {
        fprintf(stderr, "usage: %s CAPTURE FOLDER\n", arguments[0]);
        return 2;
    }
    tb_device *device = NULL;
    tb_capture *capture = NULL;
    tb_session *session = NULL;
    tb_scan scan = {.size = sizeof scan};
    tb_settings settings = {.size = sizeof settings, .options = "begin=learned", .progress = show};
    tb_frame frame = {.size = sizeof frame};
    must(tb_device_open(TB_API_VERSION, NULL, &device));
    must(tb_read(arguments[1], NULL, &capture));
    must(tb_capture_scan(capture, &scan));
    must(tb_session_new(device, &scan, &settings, &session));
    must(tb_session_submit(session, scan.counts, scan.points_x * scan.points_y * scan.bins, NULL));
    tb_capture_free(capture);
    must(tb_session_wait(session, -1.0, &frame));
    must(tb_save(session, arguments[2]));
    size_t lit = 0;
    for (size_t pixel = 0; pixel < frame.nx * frame.ny; pixel++) lit += frame.mask[pixel];
    printf("\n%zu pixels of surface in %s\n", lit, arguments[2]);
    tb_session_free(session);
    tb_device_close(device);
    return 0;
}
