/* Intercepts a daemon's file operations and its wall clock, by LD_PRELOAD.
 *
 *   GLASSWING_SHIM_ROOT   only files below this directory are affected
 *   GLASSWING_SHIM_LOG    file to which every change below it is appended (see record())
 *   GLASSWING_SHIM_FAIL   CALL@N=ERROR: the Nth CALL (write, fsync, rename, open) below it and every later one fails with
 *                         ERROR (EIO, ENOSPC, EMFILE), as long as the file named by GLASSWING_SHIM_WHILE exists;
 *                         write@N=short: writes take half of their data
 *   GLASSWING_SHIM_CLOCK  file with the number of seconds by which the wall clock is ahead
 *   GLASSWING_SHIM_STRUCK file that grows by a byte with every call that failed or was short, and whenever the daemon
 *                         reads a wall clock that was set anew
 */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static pthread_once_t once = PTHREAD_ONCE_INIT;
static char root[PATH_MAX];
static size_t root_size;
static int log_fd = -1;
static char fail_call[16], while_there[PATH_MAX];
static int fail_at, fail_error, fail_short, calls;

static void set_up(void) {
  const char* text = getenv("GLASSWING_SHIM_ROOT");
  if (text == NULL) return;
  root_size = (size_t)snprintf(root, sizeof root, "%s/", text);
  const char* log = getenv("GLASSWING_SHIM_LOG");
  if (log != NULL) log_fd = (int)syscall(SYS_openat, AT_FDCWD, log, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  const char* watched = getenv("GLASSWING_SHIM_WHILE");
  if (watched != NULL) snprintf(while_there, sizeof while_there, "%s", watched);
  const char* fail = getenv("GLASSWING_SHIM_FAIL");
  char error[16] = "";
  if (fail != NULL && sscanf(fail, "%15[a-z]@%d=%15s", fail_call, &fail_at, error) == 3) {
    fail_short = strcmp(error, "short") == 0;
    fail_error = strcmp(error, "ENOSPC") == 0 ? ENOSPC : strcmp(error, "EMFILE") == 0 ? EMFILE : EIO;
  }
}

static int is_below(const char* path) {
  pthread_once(&once, set_up);
  return root_size > 0 && path != NULL && strncmp(path, root, root_size) == 0;
}

/* Finds the path of an open file. Returns 0 if it is not below the root. */
static int path_of(int fd, char* path) {
  char link[64];
  pthread_once(&once, set_up);
  if (root_size == 0) return 0;
  snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
  const ssize_t size = readlink(link, path, PATH_MAX - 1);
  if (size <= 0) return 0;
  path[size] = '\0';
  /* The root itself counts, since it may be flushed. */
  return is_below(path) || (strncmp(path, root, root_size - 1) == 0 && path[root_size - 1] == '\0');
}

static int fails(const char* call) {
  if (fail_at == 0 || strcmp(call, fail_call) != 0) return 0;
  if (while_there[0] != '\0' && syscall(SYS_access, while_there, F_OK) != 0) return 0;
  return __sync_add_and_fetch(&calls, 1) >= fail_at;
}

/* Tells the test that a fault happened. */
static void strike(void) {
  const char* file = getenv("GLASSWING_SHIM_STRUCK");
  if (file == NULL) return;
  const int fd = (int)syscall(SYS_openat, AT_FDCWD, file, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (fd < 0) return;
  syscall(SYS_write, fd, "!", 1);
  syscall(SYS_close, fd);
}

static int refuse(void) {
  strike();
  errno = fail_error;
  return -1;
}

/* Appends "CALL OFFSET SIZE PATH[<tab>OTHER]", a newline, SIZE bytes and a newline. Records are in the order of the
 * changes, and each is written before the call returns. */
static void record(const char* call, long long offset, const char* path, const char* other, const void* bytes, size_t size) {
  if (log_fd < 0) return;
  char head[2 * PATH_MAX + 64];
  const int count = snprintf(head, sizeof head, "%s %lld %zu %s%s%s\n", call, offset, size, path, other ? "\t" : "", other ? other : "");
  struct iovec parts[3] = {{head, (size_t)count}, {(void*)(uintptr_t)bytes, size}, {(char[]){"\n"}, 1}};
  syscall(SYS_writev, log_fd, parts, 3);
}

static ssize_t log_write(int fd, const void* bytes, size_t size, long long offset, int has_offset) {
  char path[PATH_MAX];
  if (!path_of(fd, path))
    return has_offset ? (ssize_t)syscall(SYS_pwrite64, fd, bytes, size, offset) : (ssize_t)syscall(SYS_write, fd, bytes, size);
  if (fails("write")) {
    if (!fail_short) return refuse();
    if (size > 1) {
      size /= 2;
      strike();
    }
  }
  pthread_mutex_lock(&lock);
  if (!has_offset) {
    offset = syscall(SYS_lseek, fd, 0, SEEK_CUR);
    if (fcntl(fd, F_GETFL) & O_APPEND) {
      struct stat info;
      offset = fstat(fd, &info) == 0 ? (long long)info.st_size : -1;
    }
  }
  const ssize_t done = has_offset ? (ssize_t)syscall(SYS_pwrite64, fd, bytes, size, offset) : (ssize_t)syscall(SYS_write, fd, bytes, size);
  const int error = errno;
  if (done > 0) record("write", offset, path, NULL, bytes, (size_t)done);
  pthread_mutex_unlock(&lock);
  errno = error;
  return done;
}

ssize_t write(int fd, const void* bytes, size_t size) {
  return log_write(fd, bytes, size, 0, 0);
}

ssize_t pwrite64(int fd, const void* bytes, size_t size, off64_t offset) {
  return log_write(fd, bytes, size, offset, 1);
}

ssize_t pwrite(int fd, const void* bytes, size_t size, off_t offset) {
  return log_write(fd, bytes, size, offset, 1);
}

static int flush(int fd, long call) {
  char path[PATH_MAX];
  if (!path_of(fd, path)) return (int)syscall(call, fd);
  if (fails("fsync")) return refuse();
  pthread_mutex_lock(&lock);
  const int done = (int)syscall(call, fd);
  const int error = errno;
  if (done == 0) record("fsync", 0, path, NULL, NULL, 0);
  pthread_mutex_unlock(&lock);
  errno = error;
  return done;
}

int fsync(int fd) {
  return flush(fd, SYS_fsync);
}

int fdatasync(int fd) {
  return flush(fd, SYS_fdatasync);
}

int ftruncate64(int fd, off64_t size) {
  char path[PATH_MAX];
  const int known = path_of(fd, path);
  pthread_mutex_lock(&lock);
  const int done = (int)syscall(SYS_ftruncate, fd, size);
  const int error = errno;
  if (done == 0 && known) record("truncate", size, path, NULL, NULL, 0);
  pthread_mutex_unlock(&lock);
  errno = error;
  return done;
}

int ftruncate(int fd, off_t size) {
  return ftruncate64(fd, size);
}

static int open_at(int directory, const char* path, int flags, mode_t mode) {
  const int known = is_below(path) && (flags & (O_CREAT | O_TRUNC)) != 0;
  if (known && fails("open")) return refuse();
  if (!known) return (int)syscall(SYS_openat, directory, path, flags, mode);
  pthread_mutex_lock(&lock);
  struct stat info;
  const int was_there = stat(path, &info) == 0;
  const int fd = (int)syscall(SYS_openat, directory, path, flags, mode);
  const int error = errno;
  if (fd >= 0 && !was_there) record("create", 0, path, NULL, NULL, 0);
  if (fd >= 0 && was_there && (flags & O_TRUNC) != 0) record("truncate", 0, path, NULL, NULL, 0);
  pthread_mutex_unlock(&lock);
  errno = error;
  return fd;
}

static mode_t mode_of(int flags, va_list arguments) {
  return (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(arguments, mode_t) : 0;
}

#define OPEN(name)                                    \
  int name(const char* path, int flags, ...) {        \
    va_list arguments;                                \
    va_start(arguments, flags);                       \
    const mode_t mode = mode_of(flags, arguments);    \
    va_end(arguments);                                \
    return open_at(AT_FDCWD, path, flags, mode);      \
  }
OPEN(open)
OPEN(open64)

int openat(int directory, const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = mode_of(flags, arguments);
  va_end(arguments);
  return open_at(directory, path, flags, mode);
}

/* Performs and records a change of names, unless it must fail. */
static int change_name(const char* call, const char* path, const char* other, int (*change)(const char*, const char*)) {
  if (!is_below(path)) return change(path, other);
  if (fails(call)) return refuse();
  pthread_mutex_lock(&lock);
  const int done = change(path, other);
  const int error = errno;
  if (done == 0) record(call, 0, path, other, NULL, 0);
  pthread_mutex_unlock(&lock);
  errno = error;
  return done;
}

static int do_rename(const char* from, const char* to) {
  return (int)syscall(SYS_renameat2, AT_FDCWD, from, AT_FDCWD, to, 0);
}
static int do_unlink(const char* path, const char* unused) {
  (void)unused;
  return (int)syscall(SYS_unlinkat, AT_FDCWD, path, 0);
}
static int do_rmdir(const char* path, const char* unused) {
  (void)unused;
  return (int)syscall(SYS_unlinkat, AT_FDCWD, path, AT_REMOVEDIR);
}
static int do_mkdir(const char* path, const char* unused) {
  (void)unused;
  return (int)syscall(SYS_mkdirat, AT_FDCWD, path, 0777);
}

int rename(const char* from, const char* to) {
  return change_name("rename", from, to, do_rename);
}
int unlink(const char* path) {
  return change_name("unlink", path, NULL, do_unlink);
}
int rmdir(const char* path) {
  return change_name("rmdir", path, NULL, do_rmdir);
}
int mkdir(const char* path, mode_t mode) {
  (void)mode;
  return change_name("mkdir", path, NULL, do_mkdir);
}
int remove(const char* path) {
  struct stat info;
  return lstat(path, &info) == 0 && S_ISDIR(info.st_mode) ? rmdir(path) : unlink(path);
}

/* Used to remove whole trees: the path is relative to an open directory. */
int unlinkat(int directory, const char* path, int flags) {
  char whole[2 * PATH_MAX];
  if (path[0] != '/' && directory != AT_FDCWD) {
    char above[PATH_MAX];
    if (path_of(directory, above)) {
      snprintf(whole, sizeof whole, "%s/%s", above, path);
      return (flags & AT_REMOVEDIR) != 0 ? rmdir(whole) : unlink(whole);
    }
  }
  return (int)syscall(SYS_unlinkat, directory, path, flags);
}

/* Reads the file again at most every 10 ms of the monotonic clock. */
static long seconds_ahead(void) {
  static const char* file;
  static int is_known;
  static long ahead;
  static struct timespec read_at;
  struct timespec now;
  if (!is_known) {
    file = getenv("GLASSWING_SHIM_CLOCK");
    is_known = 1;
  }
  if (file == NULL) return 0;
  syscall(SYS_clock_gettime, CLOCK_MONOTONIC, &now);
  if ((now.tv_sec - read_at.tv_sec) * 1000000000L + now.tv_nsec - read_at.tv_nsec < 10000000L) return ahead;
  read_at = now;
  const long before = ahead;
  char text[32] = "";
  const int fd = (int)syscall(SYS_openat, AT_FDCWD, file, O_RDONLY | O_CLOEXEC, 0);
  if (fd >= 0 && syscall(SYS_read, fd, text, sizeof text - 1) > 0) ahead = atol(text);
  if (fd >= 0) syscall(SYS_close, fd);
  if (ahead != before) strike();
  return ahead;
}

int clock_gettime(clockid_t clock, struct timespec* time) {
  const int done = (int)syscall(SYS_clock_gettime, clock, time);
  if (done == 0 && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) time->tv_sec += seconds_ahead();
  return done;
}

int gettimeofday(struct timeval* restrict time, void* restrict zone) {
  (void)zone;
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  time->tv_sec = now.tv_sec;
  time->tv_usec = now.tv_nsec / 1000;
  return 0;
}

time_t time(time_t* result) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  if (result != NULL) *result = now.tv_sec;
  return now.tv_sec;
}
