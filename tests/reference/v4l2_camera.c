/* Answers as the kernel does for a UVC camera at /dev/video77, in front of the C library of a program (LD_PRELOAD).
 *
 * Written from the kernel's own header, linux/videodev2.h, and shared with nothing of TEGA: capabilities, formats and
 * sizes, rates, controls, buffers that are mapped, queued and filled at the agreed rate, and a file descriptor that
 * becomes readable when one is. The folder that V4L2_CAMERA names has the pictures, WIDTHxHEIGHT.mjpg, each JPEG behind
 * its length, 4 bytes, lowest first; they come again and again. A file `busy` there says that another program streams,
 * `gone` that somebody has pulled the plug, `silent` that it streams and sends nothing.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

#define NODE "/dev/video77"
#define MOST_BUFFERS 8
#define SLOT (1u << 21)

static int camera = -1, streaming, buffers, store = -1;
static unsigned width = 640, height = 480, sequence, rate_hz = 30;
static int queue[MOST_BUFFERS], queued;
static uint8_t *film, *slots;
static size_t film_bytes, film_at;

static void path_of(char *out, size_t size, const char *name) {
    snprintf(out, size, "%s/%s", getenv("V4L2_CAMERA"), name);
}

static int is_there(const char *name) {
    char path[512];
    path_of(path, sizeof path, name);
    return access(path, F_OK) == 0;
}

static int has_size(unsigned w, unsigned h) {
    char name[64];
    snprintf(name, sizeof name, "%ux%u.mjpg", w, h);
    return is_there(name);
}

static void fill_format(struct v4l2_pix_format *pix) {
    pix->width = width;
    pix->height = height;
    pix->pixelformat = V4L2_PIX_FMT_MJPEG;
    pix->field = V4L2_FIELD_NONE;
    pix->bytesperline = 0;
    pix->sizeimage = SLOT;
    pix->colorspace = V4L2_COLORSPACE_JPEG;
}

static void load_film(void) {
    char name[64], path[512];
    snprintf(name, sizeof name, "%ux%u.mjpg", width, height);
    path_of(path, sizeof path, name);
    FILE *file = fopen(path, "rb");
    if (!file) return;
    free(film);
    fseek(file, 0, SEEK_END);
    film_bytes = (size_t)ftell(file);
    rewind(file);
    film = malloc(film_bytes);
    if (fread(film, 1, film_bytes, file) != film_bytes) film_bytes = 0;
    fclose(file);
    film_at = 0;
}

static int fail(int why) {
    errno = why;
    return -1;
}

static int stream(int on) {
    struct itimerspec when = {{0, 0}, {0, 0}};
    if (on) when.it_interval.tv_nsec = when.it_value.tv_nsec = 1000000000L / rate_hz;
    streaming = on;
    if (!on) queued = 0;
    return timerfd_settime(camera, 0, &when, NULL);
}

static int answer(unsigned long request, void *arg) {
    if (is_there("gone")) return fail(ENODEV);
    switch (request) {
    case VIDIOC_QUERYCAP: {
        struct v4l2_capability *cap = arg;
        memset(cap, 0, sizeof *cap);
        strcpy((char *)cap->driver, "uvcvideo");
        strcpy((char *)cap->card, "a camera of a test");
        cap->device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
        cap->capabilities = cap->device_caps | V4L2_CAP_DEVICE_CAPS;
        return 0;
    }
    case VIDIOC_G_INPUT:
        *(int *)arg = 0;
        return 0;
    case VIDIOC_S_INPUT:
        return *(int *)arg ? fail(EINVAL) : 0;
    case VIDIOC_ENUMINPUT: {
        struct v4l2_input *input = arg;
        if (input->index) return fail(EINVAL);
        input->type = V4L2_INPUT_TYPE_CAMERA;
        return 0;
    }
    case VIDIOC_G_FMT:
        fill_format(&((struct v4l2_format *)arg)->fmt.pix);
        return 0;
    case VIDIOC_S_FMT:
    case VIDIOC_TRY_FMT: {
        struct v4l2_pix_format *pix = &((struct v4l2_format *)arg)->fmt.pix;
        if (is_there("busy")) return fail(EBUSY);
        if (streaming || buffers) return fail(EBUSY);
        if (request == VIDIOC_S_FMT && has_size(pix->width, pix->height)) {
            width = pix->width; /* another size: the nearest, which is the one before */
            height = pix->height;
        }
        fill_format(pix);
        return 0;
    }
    case VIDIOC_G_PARM:
    case VIDIOC_S_PARM: {
        struct v4l2_captureparm *parm = &((struct v4l2_streamparm *)arg)->parm.capture;
        struct v4l2_fract per = parm->timeperframe;
        if (request == VIDIOC_S_PARM && per.numerator && per.denominator) rate_hz = per.denominator / per.numerator;
        parm->capability = V4L2_CAP_TIMEPERFRAME;
        parm->timeperframe.numerator = 1;
        parm->timeperframe.denominator = rate_hz;
        return 0;
    }
    case VIDIOC_REQBUFS: {
        struct v4l2_requestbuffers *asked = arg;
        if (is_there("busy")) return fail(EBUSY);
        if (asked->memory != V4L2_MEMORY_MMAP) return fail(EINVAL);
        if (asked->count > MOST_BUFFERS) asked->count = MOST_BUFFERS;
        buffers = (int)asked->count;
        if (buffers && store < 0) {
            store = memfd_create("v4l2", 0);
            if (ftruncate(store, (off_t)SLOT * MOST_BUFFERS)) return -1;
            slots = mmap(NULL, (size_t)SLOT * MOST_BUFFERS, PROT_READ | PROT_WRITE, MAP_SHARED, store, 0);
        }
        return 0;
    }
    case VIDIOC_QUERYBUF:
    case VIDIOC_QBUF: {
        struct v4l2_buffer *buffer = arg;
        if ((int)buffer->index >= buffers) return fail(EINVAL);
        buffer->length = SLOT;
        buffer->m.offset = buffer->index * SLOT;
        if (request == VIDIOC_QBUF && queued < MOST_BUFFERS) queue[queued++] = (int)buffer->index;
        return 0;
    }
    case VIDIOC_STREAMON:
        load_film();
        return is_there("silent") ? streaming = 1, 0 : stream(1);
    case VIDIOC_STREAMOFF:
        return stream(0);
    case VIDIOC_DQBUF: {
        struct v4l2_buffer *buffer = arg;
        uint64_t periods;
        uint32_t size;
        struct timespec now;
        if (!streaming || !queued || film_bytes < sizeof size) return fail(EAGAIN);
        if (syscall(SYS_read, camera, &periods, sizeof periods) != sizeof periods) return fail(EAGAIN);
        if (film_at + sizeof size > film_bytes) film_at = 0;
        memcpy(&size, film + film_at, sizeof size);
        memcpy(slots + (size_t)queue[0] * SLOT, film + film_at + sizeof size, size);
        film_at += sizeof size + size;
        buffer->index = (uint32_t)queue[0];
        memmove(queue, queue + 1, sizeof queue - sizeof *queue);
        queued--;
        sequence += (unsigned)periods;
        clock_gettime(CLOCK_MONOTONIC, &now);
        buffer->timestamp.tv_sec = now.tv_sec;
        buffer->timestamp.tv_usec = now.tv_nsec / 1000;
        buffer->sequence = sequence;
        buffer->bytesused = size;
        buffer->length = SLOT;
        buffer->flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
        return 0;
    }
    default:
        return fail(ENOTTY); /* what this camera has not: controls, standards, cropping */
    }
}

static int opened(const char *path) {
    if (strcmp(path, NODE)) return -2;
    if (is_there("gone")) return fail(ENOENT);
    width = has_size(640, 480) ? 640 : 192;
    height = width == 640 ? 480 : 128;
    streaming = buffers = queued = 0;
    camera = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
    return camera;
}

#define OPENS(name)                                                                                                  \
    int name(const char *path, int flags, ...) {                                                                    \
        va_list rest;                                                                                               \
        va_start(rest, flags);                                                                                      \
        mode_t mode = va_arg(rest, mode_t);                                                                         \
        va_end(rest);                                                                                               \
        int fd = opened(path);                                                                                      \
        if (fd != -2) return fd;                                                                                    \
        return ((int (*)(const char *, int, mode_t))dlsym(RTLD_NEXT, #name))(path, flags, mode);                    \
    }
OPENS(open)
OPENS(open64)

int ioctl(int fd, unsigned long request, ...) {
    va_list rest;
    va_start(rest, request);
    void *arg = va_arg(rest, void *);
    va_end(rest);
    if (fd >= 0 && fd == camera) return answer(request & 0xffffffffu, arg);
    return ((int (*)(int, unsigned long, void *))dlsym(RTLD_NEXT, "ioctl"))(fd, request, arg);
}

typedef void *(*maps)(void *, size_t, int, int, int, off_t);

void *mmap(void *at, size_t size, int access_, int flags, int fd, off_t offset) {
    return ((maps)dlsym(RTLD_NEXT, "mmap"))(at, size, access_, flags, fd >= 0 && fd == camera ? store : fd, offset);
}

void *mmap64(void *at, size_t size, int access_, int flags, int fd, off_t offset) {
    return mmap(at, size, access_, flags, fd, offset);
}

ssize_t read(int fd, void *out, size_t size) {
    if (fd >= 0 && fd == camera) return fail(EINVAL); /* pictures are mapped, never read */
    return ((ssize_t (*)(int, void *, size_t))dlsym(RTLD_NEXT, "read"))(fd, out, size);
}

int close(int fd) {
    if (fd >= 0 && fd == camera) camera = -1;
    return ((int (*)(int))dlsym(RTLD_NEXT, "close"))(fd);
}
