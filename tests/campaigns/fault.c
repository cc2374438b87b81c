/* Lets one call of a process fail: the N-th open for writing, write, fsync, close, rename, ... below a folder.

   Loaded with LD_PRELOAD. fault_arm(folder, at, error, lasting, log): call number `at` fails with `error`. If `lasting`,
   the disk is full from there on: the first write is cut to half its length, as the kernel does it, and all that takes
   space fails after it; else that one call fails. at = 0 only counts; `log` is a file descriptor for the names of the
   calls, or -1. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

static char folder[PATH_MAX];
static long target, calls;
static int error_number, is_lasting, log_to = -1;

void fault_arm(const char *below, long at, int error, int lasting, int log) {
    snprintf(folder, sizeof folder, "%s", below);
    target = at, error_number = error, is_lasting = lasting, log_to = log, calls = 0;
}
long fault_calls(void) { return calls; }

static int strikes(const char *name, const char *path, int takes_space) {
    if (!folder[0] || strncmp(path, folder, strlen(folder))) return 0;
    if (is_lasting && !takes_space) return 0;
    long number = __atomic_add_fetch(&calls, 1, __ATOMIC_SEQ_CST);
    if (log_to >= 0) dprintf(log_to, "%s %s\n", name, path);
    if (!target || number < target || (number > target && !is_lasting)) return 0;
    errno = error_number;
    return 1;
}
static int strikes_handle(const char *name, int handle, int takes_space) {
    char link[64], path[PATH_MAX];
    if (!folder[0]) return 0;
    snprintf(link, sizeof link, "/proc/self/fd/%d", handle);
    ssize_t size = readlink(link, path, sizeof path - 1);
    if (size < 0) return 0;
    path[size] = 0;
    return strikes(name, path, takes_space);
}
static size_t half(size_t size) { return is_lasting && calls == target ? size / 2 : 0; }

#define REAL(name) __typeof__(&name) real = (__typeof__(&name))dlsym(RTLD_NEXT, #name)
#define ON_HANDLE(name, space, parameters, ...) \
    int name parameters { REAL(name); return strikes_handle(#name, handle, space) ? -1 : real(__VA_ARGS__); }
#define ON_PATH(name, space, parameters, ...) \
    int name parameters { REAL(name); return strikes(#name, path, space) ? -1 : real(__VA_ARGS__); }
#define ON_WRITE(name, parameters, ...) \
    ssize_t name parameters { \
        REAL(name); \
        if (strikes_handle(#name, handle, 1) && !(size = half(size))) return -1; \
        return real(__VA_ARGS__); \
    }
#define ON_OPEN(name) \
    int name(const char *path, int flags, ...) { \
        REAL(name); \
        va_list more; \
        va_start(more, flags); \
        mode_t mode = va_arg(more, mode_t); \
        va_end(more); \
        return flags & (O_WRONLY | O_RDWR) && strikes(#name, path, !!(flags & O_CREAT)) ? -1 : real(path, flags, mode); \
    }

ON_WRITE(write, (int handle, const void *data, size_t size), handle, data, size)
ON_WRITE(pwrite, (int handle, const void *data, size_t size, off_t at), handle, data, size, at)
ON_WRITE(pwrite64, (int handle, const void *data, size_t size, off64_t at), handle, data, size, at)
ON_OPEN(open)
ON_OPEN(open64)
ON_HANDLE(fsync, 0, (int handle), handle)
ON_HANDLE(fdatasync, 0, (int handle), handle)
ON_HANDLE(ftruncate, 1, (int handle, off_t size), handle, size)
ON_HANDLE(ftruncate64, 1, (int handle, off64_t size), handle, size)
ON_PATH(rename, 0, (const char *path, const char *to), path, to)
ON_PATH(unlink, 0, (const char *path), path)
ON_PATH(mkdir, 1, (const char *path, mode_t mode), path, mode)

int symlink(const char *to, const char *path) {
    REAL(symlink);
    return strikes("symlink", path, 1) ? -1 : real(to, path);
}
int close(int handle) { /* the handle is gone whatever close returns */
    REAL(close);
    int struck = strikes_handle("close", handle, 0), result = real(handle);
    if (struck) errno = error_number;
    return struck ? -1 : result;
}
