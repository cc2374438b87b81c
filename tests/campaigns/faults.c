/* Lets the FAULT_AT-th write, fsync, close or rename below FAULT_DIR fail with FAULT_ERRNO; counts them to FAULT_LOG. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static long seen;

static int below(const char *path) {
    const char *folder = getenv("FAULT_DIR");
    return folder && strncmp(path, folder, strlen(folder)) == 0;
}

static int is_due(void) {
    const char *log = getenv("FAULT_LOG");
    long now = __sync_add_and_fetch(&seen, 1);
    if (log) {
        FILE *file = fopen(log, "w");
        if (file) { fprintf(file, "%ld", now); fclose(file); }
    }
    if (now != atol(getenv("FAULT_AT") ? getenv("FAULT_AT") : "0")) return 0;
    errno = atoi(getenv("FAULT_ERRNO"));
    return 1;
}

static int due(int fd) {
    char link[64], path[PATH_MAX + 1];
    int kept = errno;
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t n = readlink(link, path, PATH_MAX);
    if (n <= 0) { errno = kept; return 0; }
    path[n] = 0;
    if (!below(path)) { errno = kept; return 0; }
    int fails = is_due();
    if (!fails) errno = kept;
    return fails;
}

#define REAL(name) __typeof__(name) *real = (__typeof__(name) *)dlsym(RTLD_NEXT, #name)

ssize_t write(int fd, const void *data, size_t size) { REAL(write); return due(fd) ? -1 : real(fd, data, size); }
ssize_t pwrite(int fd, const void *data, size_t size, off_t at) { REAL(pwrite); return due(fd) ? -1 : real(fd, data, size, at); }
ssize_t pwrite64(int fd, const void *data, size_t size, off64_t at) { REAL(pwrite64); return due(fd) ? -1 : real(fd, data, size, at); }
int fsync(int fd) { REAL(fsync); return due(fd) ? -1 : real(fd); }
int close(int fd) { REAL(close); if ((fcntl(fd, F_GETFL) & O_ACCMODE) != O_RDONLY && due(fd)) { int kept = errno; real(fd); errno = kept; return -1; } return real(fd); }
int rename(const char *from, const char *to) { REAL(rename); return below(to) && is_due() ? -1 : real(from, to); }
